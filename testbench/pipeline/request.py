"""What somebody asks of the bench, as records that every caller builds and hands on.

A record is frozen, compares and hashes by its content, and goes through JSON unchanged, so that it
can be sent to another process, kept beside a result and found again by its hash. Nothing that lives
is in it: who looks on while it is carried out, and the clock, are a `Watcher`; what a person allows
a real arm to do is a `Consent`, given for one run and never stored. Files are named, not held.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from testbench.drivers.arms.catalogue import SIM
from testbench.model.integrators import Stages
from testbench.records.specs.asked import Asked, Place
from testbench.records.specs.laboratory import Statement
from testbench.records.specs.strict import EulerSequence


class ArmRequest(Asked):
    """Which arm moves, and which sensors are recorded on it."""

    driver: str = Field(default=SIM.name, description="Of the catalogue of arms, by its name.")
    host: str = Field(default="", description="Address of the controller.")
    log: Place | None = Field(default=None, description="A recorded motion to replay.")
    kinematics: Place | None = Field(
        default=None, description="The arm's own DH corrections (YAML); nominal values if null."
    )
    serial: tuple[str, ...] = Field(
        default=(), description="Live sensors on serial ports, each `NAME=PORT:FORMAT`."
    )
    dots: tuple[str, ...] = Field(default=(), description="Xsens DOTs, each `NAME=ADDRESS`.")
    simulate_imus: bool = Field(
        default=False, description="Sensors are simulated on the motion that the arm reports."
    )


class RunRequest(Asked):
    """What to run, and where."""

    protocol: Place | None = Field(
        default=None,
        description="File, or the name of one that ships; of a session that is gone on with: its "
        "own copy if null.",
    )
    robot: Place | None = Field(
        default=None, description="Name, robot.yaml or URDF; the protocol's if null."
    )
    arm: ArmRequest = Field(default=ArmRequest())
    seed: int = Field(default=0, ge=0, description="Of every random number of a simulation.")
    speed: Literal["fast", "realtime"] = Field(
        default="fast",
        description="Virtual time of a simulated arm: as fast as the machine goes, or a second a "
        "second.",
    )
    logs: Place = Field(default="logs", description="Folder that sessions are made in.")
    resume: Place | None = Field(
        default=None, description="Session whose run broke off, to go on with."
    )


class ExportRequest(Asked):
    """A session for other programs."""

    format: str = Field(description="As `testbench.formats.exporters.EXPORTS` has them.")
    out: Place | None = Field(
        default=None,
        description="File or folder to write; one in the session's folder `export` if null.",
    )
    filter: str | None = Field(
        default=None,
        description="Whose orientation: a filter's name, `path/to/file.py:ClassName`, or `truth`; "
        "those of the estimate if null.",
    )
    parameters: dict[str, dict[str, float]] = Field(
        default={}, description="Parameters of filters to set; see AnalysisRequest."
    )
    frame: Literal["opensim", "world"] = Field(
        default="opensim", description="Frame of orientations for OpenSim."
    )
    model: Literal["rajagopal", "gait2392"] = Field(
        default="rajagopal", description="Model of OpenSim whose coordinates joint angles are."
    )
    force: bool = Field(default=False, description="Replace an earlier export.")


class AnalysisRequest(Asked):
    """How to analyse a recording, and what to write about it.

    Of two values for one parameter of a filter the later of these holds: the filter's default, the
    protocol's, the tuned one (a whole set, in place of the protocol's), the one that is set here.
    """

    filters: tuple[str, ...] | None = Field(
        default=None,
        description="Names, or `path/to/file.py:ClassName`; those of the protocol, and those that "
        "were tuned or set, if null.",
    )
    parameters: dict[str, dict[str, float]] = Field(
        default={}, description="Parameters of filters to set, by filter and name."
    )
    calibrations: Place | None = Field(
        default=None,
        description="Stored calibration, or a folder of them, that corrects the raw samples first.",
    )
    tunings: tuple[Place, ...] = Field(
        default=(), description="Files of tuned parameters, at most one a filter."
    )
    compare: str | None = Field(
        default=None,
        description="Filter, such as `device`, that the others are compared with and that is not "
        "taken for the truth; that of the session's settings if null.",
    )
    euler_sequence: EulerSequence | None = Field(
        default=None,
        description="Of the Euler angles of sensors that nobody judges; that of the session's "
        "settings if null.",
    )
    returned: bool = Field(
        default=False,
        description="Whether each sensor ended at rest in the orientation it began in; true also "
        "where the session's settings say so.",
    )
    repeats: Place | None = Field(
        default=None,
        description="Folder with further sessions of the same protocol, whose scatter tells what "
        "another part, mounting or power-up changes.",
    )
    verify: bool = Field(
        default=True,
        description="Whether raw files of the sessions that are named here are compared with the "
        "hashes of their manifests first.",
    )
    report: bool = Field(default=True, description="Whether to write report.html.")
    printed: bool = Field(
        default=False, description="Whether to print it to report.pdf, by a browser."
    )
    band: Place | None = Field(
        default=None,
        description="Normal band to draw behind average cycles: file, or the name of one that "
        "ships.",
    )
    markdown: Place | None = Field(
        default=None, description="File for a summary in Markdown; none if null."
    )
    junit: Place | None = Field(default=None, description="File for JUnit XML; none if null.")
    exports: tuple[ExportRequest, ...] = Field(
        default=(),
        description="Formats to write the session in; a filter of theirs is one that was run.",
    )


class Request(Asked):
    """What to run, and how to analyse it."""

    run: RunRequest = Field(default=RunRequest())
    analysis: AnalysisRequest = Field(default=AnalysisRequest())


class ViewRequest(Asked):
    """How a session is looked at: in a window if nothing else is said."""

    web: bool = Field(default=False, description="Serve to browsers instead.")
    port: int | None = Field(
        default=None, ge=1, le=65535, description="Of the page; 9090, or a free one, if null."
    )
    bind: str = Field(
        default="127.0.0.1",
        min_length=1,
        description="Address of this machine that the viewer listens at.",
    )
    save: Place | None = Field(default=None, description="A .rrd file to write instead.")
    screenshot: Place | None = Field(default=None, description="A .png file to write instead.")
    time_s: float | None = Field(
        default=None,
        description="Instant of the picture [s]; two thirds into the longest section if null.",
    )
    size: tuple[Annotated[int, Field(ge=200, le=8000)], Annotated[int, Field(ge=200, le=8000)]] = (
        Field(default=(1920, 1200), description="Width and height of the picture [pixels].")
    )
    pane: str | None = Field(
        default=None, description="The one pane that is shown, by its name; all if null."
    )


class FollowRequest(Asked):
    """Which session is looked at while it is recorded."""

    session: Place = Field(description="Folder of the session.")
    view: ViewRequest = Field(
        default=ViewRequest(), description="Where it is shown; no picture is drawn of it."
    )
    with_run: bool = Field(
        default=False, description="A page is served only as long as the session is recorded."
    )


class CalibrationRequest(Asked):
    """How a sensor is calibrated, and where the result is kept."""

    out: Place = Field(
        description="A .yaml file, or a folder, in which the file is called after the date and the "
        "sensor."
    )
    sensor: str | None = Field(
        default=None, description="Its name; may be null where the session has one."
    )
    methods: tuple[str, ...] = Field(
        default=(), description="At most one a triad; the best that the recording allows if none."
    )
    segmentation: Literal["arm", "gyroscope", "peaks", "variance"] | None = Field(
        default=None, description="Who says where the rests are; the arm if it was there."
    )
    held_out: tuple[Place, ...] = Field(
        default=(), description="Sessions whose poses validate, in place of cross-validation."
    )
    field_ut: tuple[float, float, float] | None = Field(
        default=None, description="Field of the earth in the world [uT], where it is known."
    )
    turn_deg: float | None = Field(
        default=None,
        description="Of ferraris_gyroscope: angle of the largest turn about each axis [deg]; "
        "negative: clockwise, against the axis.",
    )
    integrator: str | None = Field(
        default=None,
        description="Of the turns, by gravity_turns or attitude, as `testbench.model.integrators` "
        "names it; rk4 if null.",
    )
    stages: Stages | None = Field(
        default=None,
        description="Where its rates inside a step come from; measured in the middle where the "
        "integrator gains by it if null.",
    )
    g_sensitivity: bool | None = Field(
        default=None,
        description="Whether the response to specific force is fitted too; by attitude alone if "
        "null.",
    )
    every: int = Field(
        default=1, ge=1, description="Only one sample of so many of each turn is taken."
    )
    report: bool = Field(default=True, description="Whether to write an HTML report beside it.")
    verify: bool = Field(
        default=True,
        description="Whether raw files of `held_out` are compared with the "
        "hashes of their manifests first.",
    )


class NoiseRequest(Asked):
    """What is wanted of the noise at rest."""

    sensor: str | None = Field(
        default=None, description="Its name; all if null, but for a preset where there are several."
    )
    out: Place | None = Field(default=None, description="Preset file to write.")
    like: Place | None = Field(
        default=None,
        description="Preset, by name or file, that gives what a rest cannot show, such as ranges; "
        "that of the session's protocol if null.",
    )


class CertificateRequest(Asked):
    """A certificate of a session: of what, by whom, and where it is kept."""

    kind: Literal["noise", "calibration", "test"] = Field(description="What it is of.")
    sensor: str | None = Field(
        default=None,
        description="Its name; may be null where the session has one, and of a test.",
    )
    calibration: Place | None = Field(
        default=None,
        description="Stored calibration that was made from the session, or a folder with it; "
        "calibrated anew if null.",
    )
    analysis: AnalysisRequest = Field(
        default=AnalysisRequest(), description="How a session is analysed that is tested."
    )
    laboratory: Place | None = Field(
        default=None, description="File of laboratory data; the user's own if null."
    )
    stated: Statement = Field(default=Statement(), description="What is stated beside it.")
    pdf: bool = Field(default=False, description="Whether to set its pages as well.")
    out: Place | None = Field(
        default=None,
        description="PDF file, whose JSON lies beside it; one in the session's folder if null.",
    )


class AuditRequest(Asked):
    """What is asked of the sensors of a recording by themselves."""

    sensor: str | None = Field(default=None, description="Its name; all if null.")
    faces: tuple[str, ...] = Field(
        default=(),
        description="Which axis of the part pointed up in each rest, such as `+z`, in their order.",
    )
    least_rest_s: float = Field(
        default=1.0, gt=0, description="Shortest rest that counts as one on a face [s]."
    )


class SimulateRequest(Asked):
    """Sensors that ride on a motion that a file holds."""

    motion: Place = Field(description="File of poses over time, .csv or .npz.")
    out: Place = Field(description="Folder of the session, to be made.")
    preset: str = Field(
        default="xsens_dot", description="Data sheet of every sensor, by name or file."
    )
    sensors: tuple[str, ...] = Field(
        default=(), description="Data sheets of single bodies, each `BODY=PRESET`."
    )
    seed: int = Field(default=0, ge=0, description="Of the sensors that are drawn.")


class GaitRequest(Asked):
    """How a walk is reckoned, and what is known of it."""

    on: tuple[str, ...] = Field(
        default=(),
        description="Where sensors sit, each `[SENSOR=]PLACE`: foot, shank, wrist or chest; found "
        "where nothing is said.",
    )
    mounting: tuple[str, ...] = Field(
        default=(),
        description="How sensors of the regression are worn, each `[SENSOR=]MOUNTING`: level, "
        "frontal, lateral or found.",
    )
    parameters: str = Field(
        default="",
        description="Published ones of the regression, by name; a sensor on a foot goes by it, "
        "too, where some are named. By place if empty.",
    )
    filter: str = Field(default="euler_ekf", description="Whose orientation the regression takes.")
    filter_parameters: dict[str, dict[str, float]] = Field(
        default={}, description="Parameters of that filter to set, by filter and name."
    )
    floor: Literal["found", "level", "any"] = Field(
        default="found", description="Whether all stands of a foot are equally high."
    )
    calibrations: Place | None = Field(
        default=None,
        description="Stored calibration, or a folder of them: each sensor takes its own nearest in "
        "time.",
    )
    cycles: int | None = Field(default=None, description="Strides of one leg, as counted.")
    distance_m: float | None = Field(default=None, description="Length of the way, as measured.")
    corners_m: tuple[tuple[float, float], ...] = Field(
        default=(), description="Corners of the path, from its start to its end, x and y each."
    )
    report: bool = Field(default=True, description="Whether to write report.html anew.")


class TuneRequest(Asked):
    """Which parameters of a filter are looked for, on which sessions, and how hard."""

    sessions: tuple[Place, ...] = Field(
        description="Sessions to tune on, with truth, or with what is compared with."
    )
    filter: str = Field(description="A name, or `path/to/file.py:ClassName`.")
    out: Place = Field(description="File to write (.json).")
    objective: str | None = Field(
        default=None,
        description="Metric to make small, as `evaluate` spells it; total_rmse_deg if null, or of "
        "a comparison total_difference_rms_deg.",
    )
    compare: str | None = Field(
        default=None,
        description="Filter, such as `device`, that takes the place of the truth; the result is "
        "then no judgement, and its file says so. The truth if null.",
    )
    tuned: tuple[str, ...] | None = Field(
        default=None, description="Names of the parameters to tune; all if null."
    )
    parameters: dict[str, dict[str, float]] = Field(
        default={},
        description="Parameters of the filter to set: the search begins there, and those that are "
        "not tuned stay there.",
    )
    test: tuple[Place, ...] = Field(default=(), description="Sessions to test on, never tuned on.")
    test_share: float | None = Field(
        default=None, description="Part of the sessions to draw for the test instead, 0 to 1."
    )
    seed: int = Field(default=0, ge=0, description="Of that draw.")
    leave_one_out: bool = Field(
        default=False, description="Also test each session by the set that all others choose."
    )
    values: int = Field(default=9, ge=3, description="Values of each parameter in the grid.")
    points: int = Field(
        default=300, ge=1, description="Most points of a grid of every combination."
    )
    refinement: bool = Field(default=True, description="Whether Nelder-Mead follows the grid.")
    calibrations: Place | None = Field(default=None, description="As for an analysis.")
    verify: bool = Field(
        default=True,
        description="Whether raw files of the sessions are compared with the "
        "hashes of their manifests first.",
    )


class StudyRequest(Asked):
    """Which question is asked of whole runs."""

    name: str | None = Field(
        default=None, description="Of the study; every one that stands for a publication if null."
    )
    protocol: Place | None = Field(
        default=None, description="File, or the name of one that ships; the study's own if null."
    )
    session: Place | None = Field(
        default=None,
        description="Recording to ask instead of running anything; nothing is written into it.",
    )
    verify: bool = Field(
        default=True,
        description="Whether raw files of the session are compared with the hashes of its manifest "
        "first.",
    )
    seed: int = Field(default=0, ge=0, description="Of the first simulated part.")
    parts: int = Field(default=5, ge=1, description="How many simulated parts.")
    logs: Place = Field(
        default="logs", description="Folder that the sessions and the study are kept in."
    )
    options: dict[str, str] = Field(
        default={}, description="Of the study, by name; `testbench study --list` names them."
    )


class DesignRequest(Asked):
    """A calibration to design, and the protocol that it is compared with."""

    out: Place = Field(description="Protocol file to write.")
    robot: Place = Field(description="Name, robot.yaml or URDF.")
    like: Place = Field(
        default="calibration_3d",
        description="Protocol whose sensor is calibrated, and whose static poses are the "
        "comparison.",
    )
    sensor: str | None = Field(
        default=None, description="Which of its sensors; may be null where it has one."
    )
    link: str | None = Field(
        default=None, description="Link that carries the sensor; that of the protocol if null."
    )
    poses: int = Field(default=12, description="Number of static poses.")
    turns: int = Field(default=9, description="Number of turns there and back.")
    joints: tuple[str, ...] | None = Field(
        default=None, description="Joints that may move; the last three if null."
    )
    criterion: Literal["D", "A"] = Field(
        default="D", description="Volume of the confidence ellipsoid, or sum of variances."
    )
    dwell_s: float = Field(default=5.0, description="Rest at each pose [s].")
    turn_deg: float = Field(default=90.0, description="Amplitude of a turn [deg].")
    seed: int = Field(default=0, ge=0, description="Of the candidate poses.")


class CompareRequest(Asked):
    """Sessions to compare: whether errors became larger from one side to the other."""

    base: Place = Field(description="A session, or a folder of sessions, that is compared with.")
    new: tuple[Place, ...] = Field(
        description="Sessions or folders of sessions, which are the other side together."
    )
    metrics: tuple[str, ...] = Field(
        default=(),
        description="As `evaluate` spells them, or without the joint or sensor, such as "
        "`flexion_rmse_deg`; those that a report begins with if none.",
    )
    filters: tuple[str, ...] = Field(
        default=(), description="Whose errors are compared; those of all if none."
    )
    margin: float = Field(
        default=0.0, description="A larger difference counts, in the unit of each metric."
    )
    same_part: bool = Field(
        default=False,
        description="Whether all sessions have the same sensors, though no manifest tells it.",
    )
    calibrations: Place | None = Field(default=None, description="As for an analysis.")
    verify: bool = Field(
        default=True,
        description="Whether raw files of the sessions are compared with the hashes of their "
        "manifests first.",
    )
    report: Place | None = Field(
        default=None,
        description="HTML file to write; one beside the first new session if null.",
    )
    write_report: bool = Field(default=True, description="Whether to write it.")
    markdown: Place | None = Field(
        default=None, description="File for a summary in Markdown; none if null."
    )
    junit: Place | None = Field(default=None, description="File for JUnit XML; none if null.")


class RecordRequest(Asked):
    """Devices to record alone, without an arm."""

    serial: tuple[str, ...] = Field(
        default=(), description="Boards on serial ports, each `[NAME=]PORT:FORMAT`."
    )
    dots: tuple[str, ...] = Field(
        default=(), description="Xsens DOTs, each `[NAME=]ADDRESS` or an advertised name."
    )
    duration_s: float | None = Field(
        default=None, description="Length [s]; until the operator ends it if null."
    )
    logs: Place = Field(default="logs", description="Folder that sessions are made in.")
    name: str = Field(default="recording", description="Of the recording.")
    dot_payload: str = Field(default="custom_mode_5", description="Payload mode of the DOTs.")
    dot_rate_hz: int = Field(default=60, description="Output rate of the DOTs [Hz].")
    dot_sync: bool = Field(
        default=False, description="Bring the clocks of the DOTs together before they start."
    )


class TruthRequest(Asked):
    """Truth of a foreign recording in a file of its own."""

    file: Place = Field(
        description="A joint log, commanded joint angles, orientations, or angles of a body's "
        "joints."
    )
    robot: Place | None = Field(
        default=None, description="The arm whose log it is; null: the file holds no log of one."
    )
    links: tuple[str, ...] = Field(
        default=(), description="Links that carry the sensors, each `[SENSOR=]LINK`."
    )
    mountings: tuple[str, ...] = Field(
        default=(),
        description="Sensors in their links, each `[SENSOR=]MAP`, the map as YAML: "
        "`rotation_deg: {ZYX: [0, 90, 0]}, position_mm: [0, 0, 25]`.",
    )
    dwell_s: float | None = Field(
        default=None, description="How long each commanded pose is held [s]."
    )
    move_s: float | None = Field(
        default=None, description="How long each move takes [s]; found in the samples if null."
    )
    offset_s: float | None = Field(
        default=None, description="Added to the file's times [s]; null: found by the motion."
    )
    rate_hz: float | None = Field(default=None, description="Of a log without times [Hz].")
    sd_deg: float | None = Field(
        default=None,
        description="Standard uncertainty of its orientations about each axis [deg]; null: by the "
        "markers or the robot, where there are any.",
    )
    joint_unit: Literal["deg", "rad"] | None = Field(
        default=None, description="Of the log's joint angles, where it does not say."
    )
    calibration_poses: int = Field(
        default=0,
        ge=0,
        description="The first so many commanded poses calibrate the sensors and are not judged.",
    )
    time_unit: str | None = Field(
        default=None, description="Of its times, where neither their title nor their size tell it."
    )
    clusters: tuple[str, ...] = Field(
        default=(),
        description="Markers that carry the sensors, each `SENSOR=M1,M2,M3`; or `SENSOR=BODY`, a "
        "rigid body, a frame or a topic of poses.",
    )
    angles: tuple[str, ...] = Field(
        default=(),
        description="Columns that are angles of the recording's joints, each "
        "`JOINT.ANGLE=COLUMN`, or `=-COLUMN` where it counts the other way; or `JOINT=POINT`, the "
        "three angles of a point of C3D.",
    )


class BodyRequest(Asked):
    """Joints between the sensors of a foreign recording, each part as text."""

    joints: tuple[str, ...] = Field(default=(), description="Each `NAME=PROXIMAL:DISTAL`.")
    sequences: tuple[str, ...] = Field(
        default=(),
        description="How their angles are written, each `[JOINT=]ZXY`, a named definition, or a "
        "mapping such as `{hinge: [0, 0, 1]}`.",
    )
    segments: tuple[str, ...] = Field(
        default=(), description="Segments that sensors stand for, each `SENSOR=NAME`."
    )
    place_by: str | None = Field(
        default=None,
        description="standing, functional or stated; what suits it if null.",
    )
    standing: str | None = Field(
        default=None, description="When the person stands, `FROM:TO` [s]; the first rest if null."
    )
    forward: tuple[str, ...] = Field(
        default=(), description="Axes that point forwards while standing, each `SENSOR=-z`."
    )


class ImportRequest(Asked):
    """A foreign recording that becomes a session."""

    format: str = Field(description="As `testbench formats` lists them.")
    files: tuple[Place, ...] = Field(description="To read.")
    out: Place = Field(description="Folder of the session, to be made.")
    mapping: Place | None = Field(default=None, description="Of the generic format.")
    rate_hz: float | None = Field(
        default=None, description="Sampling rate [Hz], where the files do not say."
    )
    units: tuple[str, ...] = Field(
        default=(), description="Units, each `WHAT=UNIT`, such as `acc=g` or `time=ms`."
    )
    axes: str | None = Field(
        default=None, description="Axis map of every sensor, by name or as `x: -z, y: -y, z: -x`."
    )
    recorded_at: str | None = Field(
        default=None, description="When it was recorded, ISO 8601, where the files do not say."
    )
    encoding: str | None = Field(
        default=None, description="Of text files, such as `cp1252`; by their first bytes if null."
    )
    hemisphere: Literal["north", "south"] | None = Field(
        default=None,
        description="Where it was recorded: with a magnetometer it tells the accelerometer's sign.",
    )
    simulated: bool = Field(
        default=False, description="Whether the samples come from a model, which is said with them."
    )
    truth: TruthRequest | None = Field(
        default=None, description="Where the truth is, if not there."
    )
    body: BodyRequest | None = Field(
        default=None, description="Joints between the sensors, beside those of a mapping."
    )
