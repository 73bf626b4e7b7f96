"""A valid protocol and what can be wrong with it: the words and the line of each refusal; and files
that are no protocols.
"""

from dataclasses import dataclass

VALID = """\
name: wave
purpose: A valid protocol that the tests break
robot: ur3e
sensors:
  arm:
    preset: ideal
    link: wrist_1_link
    segment: {name: upper_arm}
  forearm:
    preset: ideal
    link: wrist_3_link
    segment: {name: forearm, rotation_deg: {XYZ: [90, 0, 0]}}
    mounting: {position_mm: [0, 0, 10]}
joints:
  elbow: {proximal: arm, distal: forearm, sequence: ZXZ}
variables:
  flexion_deg: {start: 0, stop: 30, step: 15}
  rest_s: 0.5
sections:
  - name: static
    for_each: [flexion_deg]
    steps:
      - move_to_deg: [180, -90, -90, 0, 90, flexion_deg]
        dwell_s: rest_s
  - name: sweep
    steps:
      - move_to_deg: {wrist_3_joint: 30}
      - sweep: {wrist_3_joint: {sine: {amplitude_deg: 20, frequency_hz: 0.5, cycles: 2}}}
        dwell_s: 0.5
estimate: {filters: [device, vqf_6d]}
accept:
  - {metric: elbow.flexion_rmse_deg, max: 1.0}
"""
POSE = "[180, -90, -90, 0, 90, flexion_deg]"


@dataclass(frozen=True)
class Fault:
    """A change of the valid protocol, `old` to `new`: the message must hold `says` and name the
    line that `at` stands in.
    """

    old: str
    new: str
    says: str
    at: str | None = None

    def text(self) -> str:
        assert self.old in VALID
        return VALID.replace(self.old, self.new, 1)

    def line(self) -> int:
        needle = self.at or self.new
        return self.text()[: self.text().index(needle)].count("\n") + 1


FAULTS = {
    # Of the wrong type or form
    "a number where text belongs": Fault("name: wave", "name: 5", "name: must be text, not 5"),
    "text where a number belongs": Fault("stop: 30", "stop: far", "must be a number, not 'far'"),
    "a list where a mapping belongs": Fault(
        "{start: 0, stop: 30, step: 15}\n", "{start: [0], stop: 30, step: 15}\n", "not [0]"
    ),
    "a sensor that is a word": Fault(
        "    preset: ideal\n    link: wrist_1_link\n    segment: {name: upper_arm}\n",
        "    broken\n",
        "must be a mapping (key: value), not 'broken'",
        "arm:",
    ),
    "an angle that is a list": Fault(
        "[180, -90,",
        "[180, [90],",
        'must be a number or an expression such as "90 - flexion_deg", not [90]',
    ),
    "an angle that is a truth value": Fault(
        "[180, -90,", "[180, true,", "must be a number or an expression"
    ),
    "an empty angle": Fault("[180, -90,", "[180, ~,", "not empty"),
    "a variable of text": Fault(
        "rest_s: 0.5", "rest_s: long", "must be a number, a list of numbers, or a range"
    ),
    "a name with a space": Fault(
        "name: static", "name: static part", "must be a name (a letter, then"
    ),
    "a choice that does not exist": Fault(
        "sequence: ZXZ", "sequence: ZXZ, flexion: fourth", "must be 'first', 'second' or 'third'"
    ),
    "a speed above the limit": Fault(
        "variables:", "motion: {speed: 2}\nvariables:", "less than or equal to 1, not 2", "speed"
    ),
    "a speed of nothing": Fault(
        "variables:",
        "motion: {speed: 0}\nvariables:",
        "greater than or equal to 0.001, not 0",
        "speed",
    ),
    "a position of two numbers": Fault(
        "[0, 0, 10]", "[0, 10]", "must have at least 3 entries, not 2"
    ),
    "a harmonic without its phase": Fault(
        "{sine: {amplitude_deg: 20, frequency_hz: 0.5, cycles: 2}}",
        "{fourier: {amplitudes_deg: [20, 5], phases_deg: [0], frequency_hz: 0.5, cycles: 2}}",
        "2 amplitudes_deg and 1 phases_deg: each needs its own",
    ),
    "a sensor of the chain that is not there": Fault(
        "filters: [device, vqf_6d]}",
        "filters: [device, vqf_6d], chain: {sensors: [arm, leg]}}",
        "unknown sensor 'leg'",
    ),
    "a section of the chain that is not there": Fault(
        "filters: [device, vqf_6d]}",
        "filters: [device, vqf_6d], chain: {sections: [walk]}}",
        "unknown section 'walk'",
    ),
    "a joint of the chain that the arm lacks": Fault(
        "filters: [device, vqf_6d]}",
        "filters: [device, vqf_6d], chain: {joints: [knee]}}",
        "unknown joint of ur3e 'knee'",
    ),
    "a state of the chain named twice": Fault(
        "filters: [device, vqf_6d]}",
        "filters: [device, vqf_6d], chain: {states: [fourier, fourier]}}",
        "states: fourier stands more than once",
    ),
    "infinity": Fault("rest_s: 0.5", "rest_s: .inf", "must be a finite number"),
    "not a number": Fault("rest_s: 0.5", "rest_s: .nan", "must be a finite number"),
    "a number beyond all bounds": Fault("rest_s: 0.5", "rest_s: 1e999", "must be a finite number"),
    "a number of hundreds of digits": Fault(
        "rest_s: 0.5", "rest_s: " + "9" * 500, "must be a finite number"
    ),
    # Keys
    "an unknown key": Fault("dwell_s: rest_s", "dwel_s: rest_s", "unknown key 'dwel_s'"),
    "a key written twice": Fault(
        "robot: ur3e",
        "robot: ur3e\nname: again",
        "the key 'name' stands twice (first in line 1)",
        "name: again",
    ),
    "a missing link": Fault(
        "    link: wrist_3_link\n", "", "the key 'link' is missing", "forearm:"
    ),
    "a missing robot": Fault("robot: ur3e\n", "", "the key 'robot' is missing", "name: wave"),
    "a key that is a list": Fault(
        "robot: ur3e", "robot: ur3e\n[a]: 1", "keys must be plain words", "[a]"
    ),
    "a key with a line end": Fault(
        "robot: ur3e", 'robot: ur3e\n"a\\nb": 1', r"unknown key 'a\nb'", '"a'
    ),
    # Expressions
    "an expression that breaks off": Fault(
        "90, flexion_deg]", "90, flexion_deg +]", "'flexion_deg +' is not arithmetic; allowed:"
    ),
    "code in an expression": Fault(
        "90, flexion_deg]", "90, \"__import__('os').system('true')\"]", "is not arithmetic"
    ),
    "an attribute in an expression": Fault(
        "90, flexion_deg]", "90, flexion_deg.real]", "uses more than arithmetic"
    ),
    "a power in an expression": Fault(
        "90, flexion_deg]", "90, 9**9**9**9]", "uses more than arithmetic"
    ),
    "an unknown variable": Fault(
        "90, flexion_deg]", "90, flex_deg]", "unknown variable 'flex_deg' in 'flex_deg'; known: "
    ),
    "a variable without its loop": Fault(
        "    for_each: [flexion_deg]\n", "", "has 3 values; name it in a for_each", "flexion_deg]"
    ),
    "a loop over an unknown variable": Fault(
        "for_each: [flexion_deg]", "for_each: [flex_deg]", "unknown variable 'flex_deg'; known:"
    ),
    "a loop over the same variable twice": Fault(
        "[flexion_deg]\n", "[flexion_deg, flexion_deg]\n", "is looped over twice"
    ),
    "a division by zero": Fault("dwell_s: rest_s", "dwell_s: 1 / (rest_s - 0.5)", "has no value"),
    "a function with too few values": Fault(
        "dwell_s: rest_s", "dwell_s: min(1)", "min takes two or more values"
    ),
    "a variable called like a function": Fault(
        "rest_s: 0.5", "rest_s: 0.5\n  max: 3", "word of the expression language", "max: 3"
    ),
    # Loops, ranges, sizes
    "a range that does not reach its end": Fault(
        "step: 15", "step: 7", "is not a whole number of steps of 7"
    ),
    "a range that runs away": Fault("step: 15", "step: -15", "the step points the other way"),
    "a step of zero": Fault("step: 15", "step: 0", "step must not be zero"),
    "a huge range": Fault("step: 15", "step: 1e-9", "3e+10 steps is more than the 100000 allowed"),
    "a range beyond all bounds": Fault(
        "stop: 30, step: 15", "stop: 1e308, step: 5e-324", "more than the 100000 allowed"
    ),
    "an empty list of values": Fault(
        "rest_s: 0.5", "rest_s: []", "must have at least 1 entry, not 0"
    ),
    "a dwell below zero": Fault(
        "dwell_s: rest_s", "dwell_s: -1", "greater than or equal to 0, not -1"
    ),
    "a dwell below zero by an expression": Fault(
        "dwell_s: rest_s", "dwell_s: rest_s - 2", "is -1.5; it must be at least 0"
    ),
    "a dwell of a month": Fault("dwell_s: rest_s", "dwell_s: 3000000", "must be at most 86400"),
    "a sweep of a month": Fault(
        "frequency_hz: 0.5", "frequency_hz: 1e-6", "the sweep would last 4e+06 s", "frequency_hz"
    ),
    "a sweep of half a cycle": Fault("cycles: 2", "cycles: 0.5", "must be at least 1"),
    "a sweep of one and a half cycles": Fault("cycles: 2", "cycles: 1.5", "must be a whole number"),
    "a frequency of zero": Fault("frequency_hz: 0.5", "frequency_hz: 0", "must be greater than 0"),
    "a frequency no arm can follow": Fault(
        "frequency_hz: 0.5", "frequency_hz: 1e300", "must be at most 20"
    ),
    # Steps and sections
    "two actions in a step": Fault(
        "dwell_s: rest_s", "move_to: home", "this one has move_to_deg and move_to", "- move_to_deg"
    ),
    "a step without an action": Fault(
        "- move_to_deg: {wrist_3_joint: 30}", "- name: idle", "a step needs one of: move_to_deg"
    ),
    "no steps": Fault(
        "    steps:\n      - move_to_deg: {wrist_3_joint: 30}\n      - sweep: {wrist_3_joint: "
        "{sine: {amplitude_deg:"
        " 20, frequency_hz: 0.5, cycles: 2}}}\n        dwell_s: 0.5\n",
        "    steps: []\n",
        "steps must not be empty",
        "- name: sweep",
    ),
    "a sweep of two shapes": Fault(
        "{sine: {",
        "{trapezoid: {amplitude_deg: 1, rate_deg_s: 1}, sine: {",
        "one of: sine, fourier, trapezoid",
    ),
    "two sections of one name": Fault(
        "- name: sweep", "- name:  static", "two sections are called 'static'"
    ),
    "too few joint angles": Fault(
        POSE, "[180, -90]", "2 joint angles given; ur3e has 6: shoulder_pan_joint"
    ),
    "an unknown joint": Fault(
        "{wrist_3_joint: 30}",
        "{wrist_4_joint: 30}",
        "unknown joint of ur3e 'wrist_4_joint'; known: sh",
    ),
    "an unknown home": Fault(
        "move_to_deg: {wrist_3_joint: 30}", "move_to: start", "must be 'home', not 'start'"
    ),
    # Names of things
    "an unknown robot": Fault("robot: ur3e", "robot: ur4e", "unknown robot 'ur4e'; known:"),
    "an unknown link": Fault("link: wrist_3_link", "link: hand", "'hand'; known:"),
    "an unknown preset": Fault(
        "    preset: ideal\n    link: wrist_3",
        "    preset: idal\n    link: wrist_3",
        "unknown sensor preset 'idal'; known: bno055, bno080, ideal, matrix, "
        "mpu6050, mpu6050_100hz, ngimu, shimmer3, tech_imu, xsens_dot, xsens_mti",
        "idal",
    ),
    "an unknown parameter": Fault(
        "mounting: {position_mm: [0, 0, 10]}",
        "parameters: {gyroscope: {range: 100}}",
        "unknown key 'range'",
    ),
    "a sensor of nothing": Fault(
        "    preset: ideal\n    link: wrist_3",
        "    link: wrist_3",
        "needs a preset or parameters",
        "forearm:",
    ),
    "an unknown filter": Fault("vqf_6d]", "vqf_7d]", "must be 'device', 'gyro'"),
    "a filter twice": Fault("vqf_6d]", "device]", "device stands more than once"),
    "an unknown metric": Fault(
        "elbow.flexion_rmse_deg",
        "elbow.flexion_rmse",
        "unknown metric 'elbow.flexion_rmse'; known: elb",
    ),
    "a limit on an unknown section": Fault(
        "max: 1.0", "max: 1.0, section: statics", "unknown section 'statics'; known: static, sweep"
    ),
    "a limit without a limit": Fault(", max: 1.0", "", "needs min or max", "- {metric"),
    "limits the wrong way round": Fault(
        "max: 1.0", "max: 1.0, min: 2", "min 2 is greater than max 1"
    ),
    "an unknown sensor of a joint": Fault(
        "distal: forearm", "distal: hand", "unknown sensor 'hand'; known: arm, forearm"
    ),
    "a joint between sensors without segment": Fault(
        "    segment: {name: upper_arm}\n", "", "needs a segment", "proximal: arm"
    ),
    "a joint of one sensor": Fault(
        "distal: forearm", "distal: arm", "proximal and distal are the same sensor"
    ),
    "a sequence compared with itself": Fault(
        "sequence: ZXZ}",
        "sequence: ZXZ, compare: [{sequence: ZXZ}]}",
        "the Euler sequence ZXZ stands more than once",
    ),
    "an unknown Euler sequence": Fault("{XYZ: [90, 0, 0]}", "{ZZZ: [90, 0, 0]}", "must be 'XYZ'"),
    "two Euler sequences": Fault(
        "{XYZ: [90, 0, 0]}",
        "{XYZ: [90, 0, 0], ZYX: [0, 0, 0]}",
        "takes one Euler sequence, not XYZ and ZYX",
    ),
    # Motion that cannot be
    "a pose out of the limits": Fault(
        "[180, -90,", "[180, -400,", "joint shoulder_lift_joint: position -"
    ),
    "a pose beyond all bounds": Fault(
        POSE, "[180, -90, -90, 0, 90, 1e300]", "1e+300 must be at most 36000"
    ),
    "a sweep that is too fast": Fault(
        "frequency_hz: 0.5", "frequency_hz: 6", "joint wrist_3_joint: velocity ", "- sweep"
    ),
    "a fold of the forearm into the shoulder": Fault(
        POSE, "[0, -90, 175, 0, 0, 0]", "come within "
    ),
    "an arm in the floor": Fault(POSE, "[0, 30, 0, 0, 0, 0]", "and the floor "),
    "a sensor beyond its range": Fault(
        "mounting: {position_mm: [0, 0, 10]}",
        "parameters: {gyroscope: {range_deg_s: 5}}",
        "exceeds its range of 5.00 deg/s",
        "- move_to_deg: [180",
    ),
    # YAML
    "a tab": Fault("    preset: ideal", "\tpreset: ideal", "a tab cannot indent; use spaces"),
    "a bracket that stays open": Fault("[0, 0, 10]}", "[0, 0, 10}", "not valid YAML"),
    "an alias": Fault(
        POSE, "&pose [1, 2, 3]\n      - move_to_deg: *pose", "aliases (*name) are not", "&pose"
    ),
    "a tag that would make an object": Fault(
        "robot: ur3e", "robot: !!python/object/apply:os.system [true]", "is not allowed"
    ),
    "a tag on a word": Fault("robot: ur3e", "robot: !!python/name:os.system x", "is not allowed"),
    "a tag of the user's": Fault("robot: ur3e", "robot: !arm ur3e", "the tag !arm is not allowed"),
    "a tag that does not fit": Fault(
        "robot: ur3e", "robot: !!bool ur3e", "is not of the type that its tag says"
    ),
    "a second document": Fault(
        "robot: ur3e", "robot: ur3e\n---\nrobot: ur3e", "more than one document", "---"
    ),
    "deep nesting": Fault(
        "rest_s: 0.5", "rest_s: " + "[" * 60 + "]" * 60, "nested deeper than 40 levels"
    ),
    "a control character": Fault(
        "robot: ur3e", "robot: ur\x013e", "the character U+0001 is not allowed"
    ),
    # Includes
    "an include that is missing": Fault(
        "- name: sweep",
        "- {name: more, include: none.yaml}\n  - name: sweep",
        "no file 'none.yaml' beside this protocol",
    ),
    "an include that leaves the folder": Fault(
        "- name: sweep",
        "- {name: more, include: ../wave.yaml}\n  - name: sweep",
        "an include must lie in the folder of the protocol",
    ),
    "an include of an absolute path": Fault(
        "- name: sweep",
        "- {name: more, include: /etc/passwd}\n  - name: sweep",
        "an include must lie in the folder of the protocol",
    ),
    "an include with a zero byte": Fault(
        "- name: sweep", '- {name: more, include: "a\\0b"}\n  - name: sweep', "no file"
    ),
    "an include of itself": Fault(
        "- name: sweep",
        "- {name: more, include: wave.yaml}\n  - name: sweep",
        "'wave.yaml' includes itself",
    ),
    "an include with steps": Fault(
        "name: sweep",
        "name: sweep\n    include: other.yaml",
        "either steps or include",
        "- name: sweep",
    ),
}

WHOLE_FILES = {
    "an empty file": (b"", "the file is empty; it must hold a mapping"),
    "a file of comments": (b"# nothing\n", "the file is empty"),
    "a list at the top": (b"- a\n- b\n", "the file holds a list"),
    "a word at the top": (b"hello\n", "the file holds text"),
    "no YAML": (b"{]%$", "not valid YAML"),
    "binary": (bytes(range(256)), "not UTF-8 text"),
    "Latin letters in another encoding": (
        VALID.replace("valid", "gültig").encode("latin-1"),
        "not UTF-8 text",
    ),
    "zero bytes": (b"name: \x00\x00\n", "the character U+0000 is not allowed"),
    "UTF-16": (VALID.encode("utf-16"), "not UTF-8 text"),
    "a file that is too large": (b"# " + b"x" * 300_000, "larger than the 250 kB allowed"),
    "brackets without end": (b"[" * 100_000, "nested too deeply"),
    "mappings without end": (b"{a: " * 50_000, "nested too deeply"),
    "an alias bomb": (
        b"a: &a [x, x, x]\n"
        + b"".join(
            b"%c: &%c [*%c, *%c, *%c]\n" % (c, c, c - 1, c - 1, c - 1) for c in range(98, 118)
        ),
        "aliases (*name) are not allowed",
    ),
    "a list that holds itself": (b"a: &a [*a]\n", "aliases (*name) are not allowed"),
}
