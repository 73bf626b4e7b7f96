"""Quijano & Valencia (Universidad del Cauca, 2018) on our bench: pendulum, squat and the walk of a
right half leg, each by motions within and without the Fourier state's model.

Each motion is run with several sensors of the same kind (seeds), for the bias that is drawn for a
sensor decides a single run; the gait that varies is drawn anew for every part as well, so that the
spread is over parts and motions. All filters see the same samples. What differs from the thesis:
its rigs' dimensions, motions and references are not stated (ours are, in the protocols), its
subject walked and ours is a model whose joints move by published curves without skin and heel
strike, it shows the trial of five that fitted best, and its joint angles were judged by another
measurement (Plug-in Gait), ours by the joints themselves.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from testbench.clock import SystemClock
from testbench.estimation.chain.period import base_frequency
from testbench.estimation.chain.placement import Constants, moved
from testbench.estimation.chain.recording import ChainRecording
from testbench.estimation.chain.session import ChainSection
from testbench.estimation.signals.recording import RunFacts
from testbench.evaluation.chain import evaluate_chain
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model.noise import random_stream
from testbench.model.statistics.spread import Change
from testbench.pipeline.analyse import Result
from testbench.pipeline.prepared import Prepared
from testbench.pipeline.request import Request
from testbench.pipeline.run import prepare, run
from testbench.pipeline.watcher import Watcher
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.evaluation import ChainRow
from testbench.records.session.samples import ArmSamples
from testbench.records.specs.protocol_chain import ChainEstimation
from testbench.studies.bench import StudyBench
from testbench.studies.chain.as_printed import run_as_printed
from testbench.studies.chain.motions import (
    LENGTH_SD_PERCENT,
    POSITION_SD_MM,
    RIGS,
    ROTATION_SD_DEG,
    VARIED,
    WALKS,
    Motion,
    write_protocol,
)

AXES = {
    ("hip", "X"): "hip_r_adduction",
    ("hip", "Y"): "hip_r_rotation",
    ("hip", "Z"): "hip_r_flexion",
    ("knee", "Z"): "knee_r_flexion",
    ("ankle", "X"): "ankle_r_inversion",
    ("ankle", "Y"): "ankle_r_rotation",
    ("ankle", "Z"): "ankle_r_flexion",
}
"""The joint of robots/lower_limb that stands for an axis of the tables; the thesis has the right
leg only.
"""
QUANTITIES = ("angle", "rate", "acceleration")
KINDS = ("rmse_deg", "rate_rmse_deg_s", "acceleration_rmse_deg_s2")
KINEMATIC, FOURIER = "kinematic", "fourier"
PRINTED = {KINEMATIC: "kinematic of the text", FOURIER: "fourier of the text"}
"""The thesis's own filter by either state."""
USUAL = "each sensor by vqf_6d"
"""The usual way: each sensor's orientation by itself, and the angles between two segments."""
EXACT, OFF, FITTED = "as stated", "off", "off, placement fitted"
"""Where the sensors of the walk sit."""
RIGS_A_PART = 3
"""Runs of a rig for each part: the ratio of two angles' errors scatters by a factor of two from
run to run, so that five runs tell nothing of it.
"""
MOST_PROCESSES = 8
"""More would wait for memory rather than for processors."""
Estimates = tuple[ChainSection, dict[str, ChainEstimate]]
HARMONICS = (1, 2, 3, 4, 6, 8)
"""Of the 1 to 8 that the source tries (its figures 3.2 to 3.4)."""


@dataclass(frozen=True)
class JointErrors:
    """Errors of one joint by one filter in one motion, a row for each run."""

    rows: list[ChainRow]

    def values(self, kind: str) -> list[float]:
        """One figure of every run."""
        return [float(getattr(row, kind)) for row in self.rows]

    def rms(self, kind: str) -> float:
        """Root of the mean square over the runs, whose sessions are equally long."""
        return float(np.sqrt(np.mean(np.square(self.values(kind)))))

    def mean(self, kind: str) -> float:
        """Over the runs."""
        return float(np.mean(self.values(kind)))

    def sd(self, kind: str) -> float | None:
        """Standard deviation over the runs; None of a single one."""
        return float(np.std(self.values(kind), ddof=1)) if len(self.rows) > 1 else None


@dataclass(frozen=True)
class First:
    """The first run of a motion, for curves.

    Attributes:
        section: With its chain and samples.
        arm: What the arm measured.
        estimates: By filter.
        errors: Of the joints, by filter and column, as `evaluate_chain` gives them.
    """

    section: ChainSection
    arm: ArmSamples
    estimates: dict[str, ChainEstimate]
    errors: dict[str, dict[str, np.ndarray]]


@dataclass(frozen=True)
class Moved:
    """What was found of one motion.

    Attributes:
        motion: Which.
        errors: By joint and filter.
        first: Its first run.
        sessions: Folders, in the order of their seeds.
        lost: How many runs a filter said of itself that it is lost, by filter.
    """

    motion: Motion
    errors: dict[tuple[str, str], JointErrors]
    first: First
    sessions: list[Path]
    lost: dict[str, int]

    @property
    def joints(self) -> list[str]:
        """Names, in order."""
        return list(dict.fromkeys(joint for joint, _ in self.errors))

    def change(self, joint: str, kind: str) -> Change:
        """Error by the Fourier state against that by the kinematic one."""
        first, second = (self.errors[joint, state].values(kind) for state in (FOURIER, KINEMATIC))
        return Change.of(first, second)

    def seven(self, kind: str, filter_name: str) -> list[float]:
        """RMS over the seven axes of the source's tables, by run."""
        own = [self.errors[joint, filter_name].values(kind) for joint in AXES.values()]
        return np.sqrt(np.mean(np.square(own), axis=0)).tolist()


@dataclass(frozen=True)
class Reference5:
    """All that the study measured.

    Attributes:
        rigs: Pendulum and squat, by name of the motion.
        walks: The walk with its sensors where they are stated to be, by name of the motion.
        placed: The varying walk with its sensors elsewhere, `OFF` and `FITTED`.
        usual: RMS of the seven axes by the usual way [deg], by run, sensors as stated and off.
        harmonics: RMS over the seven axes [deg], by name of the walk and number of harmonics.
        series: The same of a series fitted to the true angles alone.
    """

    rigs: dict[str, Moved]
    walks: dict[str, Moved]
    placed: dict[str, Moved]
    usual: dict[str, list[float]]
    harmonics: dict[str, dict[int, float]]
    series: dict[str, dict[int, float]]

    @property
    def moved(self) -> list[Moved]:
        """All motions."""
        return [*self.rigs.values(), *self.walks.values(), *self.placed.values()]

    @property
    def sessions(self) -> list[Path]:
        """Folders of all sessions, each once."""
        return list(dict.fromkeys(path for own in self.moved for path in own.sessions))


@dataclass(frozen=True)
class Task:
    """One run and what is asked of it, as a process of its own takes it.

    Attributes:
        place: Under which its rows are gathered: the name of a motion, `OFF` or `FITTED`.
        motion: What moves the chain.
        asked: The request, as JSON.
        part: Whose sensors they are.
        printed: Whether the thesis's filter runs, too.
        first: Whether it is the one that curves are drawn of.
        chain: How its joints are estimated where its sensors are off; else as its protocol says.
    """

    place: str
    motion: Motion
    asked: str
    part: int
    printed: bool
    first: bool
    chain: dict[str, Any]


@dataclass
class Found:
    """What a run came to.

    Attributes:
        path: Of its session.
        rows: By place and filter.
        lost: Filters that say of themselves that they are lost, by place.
        usual: RMS of the seven axes by the usual way [deg], of a walk.
        curves: By place, of the run that curves are drawn of.
    """

    path: Path
    rows: dict[tuple[str, str], list[ChainRow]] = field(default_factory=dict)
    lost: list[tuple[str, str]] = field(default_factory=list)
    usual: float | None = None
    curves: dict[str, First] = field(default_factory=dict)

    def add(self, result: Result, task: Task, place: str, own: Estimates) -> None:
        """Judge estimates.

        Args:
            result: Of the run.
            task: That it was.
            place: Under which they are gathered.
            own: The section, and its estimates by filter.
        """
        section, estimates = own
        arm = result.session.arm()
        assert arm is not None  # the bench ran it
        errors = {}
        for name, one in estimates.items():
            self.rows[place, name], errors[name] = evaluate_chain(result.session, one, arm)
            if one.facts.get("lost", False):
                self.lost.append((place, name))
        if task.first:
            self.curves[place] = First(section, arm, estimates, errors)


def reference_5(
    bench: StudyBench,
    sources: Mapping[str, Path] | None = None,
    with_report: bool = True,
    rigs_a_part: int = RIGS_A_PART,
) -> Reference5:
    """Run all motions and judge every filter.

    Args:
        bench: Where the sessions are made; each part has a simulated arm and sensors of its own.
        sources: Files in place of the shipped protocols, by name.
        with_report: Whether the first session of each motion gets its report.html.
        rigs_a_part: Runs of a rig for each part; part s takes the seeds from s times that on.
    """
    with tempfile.TemporaryDirectory() as folder:
        tasks = _tasks(bench, Path(folder), sources or {}, with_report, rigs_a_part)
        found = _side_by_side(bench, tasks)
    rigs = {one.name: _gathered(one, one.name, found) for one in RIGS}
    walks = {one.name: _gathered(one, one.name, found) for one in WALKS}
    placed = {place: _gathered(VARIED, place, found) for place in (OFF, FITTED)}
    usual: dict[str, list[float]] = {EXACT: [], OFF: []}
    for task, own in zip(tasks, found, strict=True):
        if own.usual is not None and task.motion is VARIED:
            usual[OFF if task.place == OFF else EXACT].append(own.usual)
    bench.say("harmonics")
    harmonics = {name: by_harmonics(own.first) for name, own in walks.items()}
    series = {name: fitted_series(own.first) for name, own in walks.items()}
    return Reference5(rigs, walks, placed, usual, harmonics, series)


def _tasks(
    bench: StudyBench,
    folder: Path,
    sources: Mapping[str, Path],
    with_report: bool,
    rigs_a_part: int,
) -> list[Task]:
    """All runs; the long ones come first."""
    tasks = []

    def add(place: str, motion: Motion, seed: int, part: int, first: bool, k: int = 0) -> None:
        drawn = part if motion is VARIED else 0
        source = sources.get(motion.protocol)
        file = write_protocol(motion, folder, drawn, place == OFF, source)
        chain = {}
        if place == OFF:
            stated = write_protocol(motion, folder, drawn, False, source)
            chain = yaml.safe_load(stated.read_text("utf-8"))["estimate"]["chain"]
        asked = bench.request(file, seed, report=with_report and first).canonical()
        tasks.append(Task(place, motion, asked, part, k == 0, first, chain))

    for i, part in enumerate(bench.seeds):
        add(OFF, VARIED, part, part, i == 0)
    for motion in WALKS:
        for i, part in enumerate(bench.seeds):
            add(motion.name, motion, part, part, i == 0)
    for motion in RIGS:
        for i, part in enumerate(bench.seeds):
            for k in range(rigs_a_part):
                seed = rigs_a_part * part + k
                add(motion.name, motion, seed, part, i == 0 and k == 0, k)
    return tasks


def _side_by_side(bench: StudyBench, tasks: Sequence[Task]) -> list[Found]:
    """Do all, as many at a time as there are processors."""
    found = []
    processes = min(len(tasks), cpu_count() or 1, MOST_PROCESSES)
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        for task, own in zip(tasks, pool.map(_run, tasks), strict=True):
            found.append(own)
            bench.say(f"{task.place}: run {len(found)} of {len(tasks)} is done")
    return found


def _run(task: Task) -> Found:
    """Run and judge, in a process of its own."""
    request = Request.model_validate_json(task.asked)
    unseeded = request.run.model_copy(update={"seed": 0})
    planned = _planned(request.model_copy(update={"run": unseeded}).canonical())
    result = run(request, Watcher(SystemClock()), planned)
    found = Found(result.session.path)
    wrong = task.part if task.place == OFF else None
    section = section_of(result, wrong, task.chain)
    own = (
        {one.state: one for one in result.estimate.chain} if wrong is None else own_states(section)
    )
    if task.printed:
        own |= printed(section)
    found.add(result, task, task.place, (section, own))
    if wrong is not None:
        again = section_of(result, wrong, {**task.chain, "placement": WANTED})
        found.add(result, task, FITTED, (again, own_states(again)))
    if task.motion in WALKS:
        found.usual = usual_way(result)
    return found


@lru_cache(maxsize=2)
def _planned(asked: str) -> Prepared:
    """The plan of a request, made once for all its parts."""
    return prepare(Request.model_validate_json(asked))


def _gathered(motion: Motion, place: str, found: Sequence[Found]) -> Moved:
    """What all runs of one place came to."""
    rows: dict[tuple[str, str], list[ChainRow]] = {}
    lost: dict[str, int] = {}
    own = [one for one in found if any(key == place for key, _ in one.rows)]
    for one in own:
        for (key, name), judged in one.rows.items():
            if key != place:
                continue
            lost[name] = lost.get(name, 0) + ((place, name) in one.lost)
            for row in judged:
                rows.setdefault((row.joint, name), []).append(row)
    errors = {key: JointErrors(judged) for key, judged in rows.items()}
    first = next(one.curves[place] for one in own if place in one.curves)
    return Moved(motion, errors, first, [one.path for one in own], lost)


WANTED = {
    "rotation_sd_deg": ROTATION_SD_DEG,
    "position_sd_mm": POSITION_SD_MM,
    "length_sd_percent": LENGTH_SD_PERCENT,
}
"""What is fitted of sensors that are off."""


def section_of(
    result: Result, wrong_lengths: int | None = None, chain: Mapping[str, Any] | None = None
) -> ChainSection:
    """The judged section of a session, ready for filters.

    Args:
        result: Of the run.
        wrong_lengths: Seed of errors of the segments' lengths; None for none.
        chain: How its joints are estimated, as a protocol has it; as its own says if none.
    """
    facts = RunFacts.of(result.session)
    wanted = facts.settings.chain
    recording = ChainRecording.of(result.session, facts)
    if wanted is None or recording is None:
        raise InputError(f"{result.session.name} asks for no chain")
    if chain:
        wanted = ChainEstimation.model_validate(chain)
    names = wanted.sensors or list(recording.carried)
    name = (wanted.sections or recording.sections)[0]
    section = ChainSection(recording, result.estimate.sensors, names, wanted, name)
    if wrong_lengths is not None:
        constants = Constants.of(section.chain, 0.0, 0.0, 1.0)
        values = np.zeros(len(constants.sd))
        rng = random_stream(wrong_lengths, "reference-5", "lengths")
        own = rng.normal(0.0, LENGTH_SD_PERCENT / 100, len(constants.names))
        values[len(values) - len(own) :] = own
        section.chain = moved(section.chain, constants, values)
    return section


def own_states(section: ChainSection) -> dict[str, ChainEstimate]:
    """Our filter by both states."""
    return {
        KINEMATIC: section.estimate("kinematic")[0],
        FOURIER: section.estimate("fourier")[0],
    }


def printed(section: ChainSection) -> dict[str, ChainEstimate]:
    """The thesis's filter by both states, where our sensors are taken to sit."""
    found = {}
    frequency = section.wanted.frequency_hz or base_frequency(section.samples, section.begins_s)
    for state, own in ((KINEMATIC, None), (FOURIER, frequency)):
        motion = run_as_printed(section.chain, section.samples, own)
        found[PRINTED[state]] = ChainEstimate(
            section=section.section,
            state=PRINTED[state],
            sensors=section.chain.sensors,
            joints=section.chain.joints,
            facts={},
            host_time_ns=np.round(motion.time * NANOSECONDS).astype(np.int64),
            mean=motion.mean,
            sd=motion.sd,
        )
    return found


def usual_way(result: Result) -> float:
    """RMS over the seven axes of the angles between segments by each sensor's own filter [deg]."""
    arm, squares = result.session.arm(), []
    assert arm is not None
    walking = [step for step in result.session.steps if step.role == "evaluation"]
    left_out = result.session.analysis.estimate.chain
    margin = round(NANOSECONDS * (left_out.settling_s if left_out is not None else 0.0))
    for kind in ("hip", "knee", "ankle"):
        own = result.estimate.joints[f"{kind}_r"]
        time = own.host_time_ns
        judged = np.zeros(len(time), bool)
        for step in walking:
            judged |= (time >= step.start_ns + margin) & (time <= step.settled_ns - margin)
        (angles,) = [a for (name, _), a in own.angles.items() if name == "vqf_6d"]
        for axis, column, sign in USUAL_COLUMNS[kind]:
            true = arm.q_measured[:, arm.joint_names.index(AXES[kind, axis])]
            error = sign * angles[:, column] - np.interp(time, arm.host_time_ns, true)
            error = (error[judged & np.isfinite(error)] + np.pi) % (2 * np.pi) - np.pi
            squares.append(float(np.mean(error**2)))
    return float(np.degrees(np.sqrt(np.mean(squares))))


USUAL_COLUMNS = {
    "hip": (("X", 0, 1), ("Y", 1, 1), ("Z", 2, -1)),
    "knee": (("Z", 2, 1),),
    "ankle": (("X", 0, 1), ("Y", 1, 1), ("Z", 2, -1)),
}
"""Axis of the tables, column of the Euler angles XZY, and the sign that makes it that joint."""


def by_harmonics(first: First) -> dict[int, float]:
    """RMS over the seven axes [deg] by the Fourier state with so many harmonics."""
    found = {}
    section, wanted = first.section, first.section.wanted
    for number in HARMONICS:
        update = {"harmonics": number, "placement": None}
        section.wanted = ChainEstimation.model_validate(wanted.model_dump() | update)
        found[number] = _rms_of(section.estimate("fourier")[0], first)
    section.wanted = wanted
    return found


def _rms_of(estimate: ChainEstimate, first: First) -> float:
    judged = first.errors[FOURIER]["judged"]
    squares = []
    for joint in AXES.values():
        true = first.arm.q_measured[:, first.arm.joint_names.index(joint)]
        at = np.interp(estimate.host_time_ns, first.arm.host_time_ns, true)
        error = estimate.mean[:, 0, estimate.joints.index(joint)] - at
        squares.append(np.mean(error[judged] ** 2))
    return float(np.degrees(np.sqrt(np.mean(squares))))


def fitted_series(first: First) -> dict[int, float]:
    """RMS over the seven axes [deg] that a series of so many harmonics leaves of the true angles.

    Without any sensor: what the source's figures 3.2 to 3.4 show.
    """
    judged = first.errors[FOURIER]["judged"]
    time = first.estimates[FOURIER].host_time_ns[judged]
    seconds = (time - time[0]) / NANOSECONDS
    frequency = first.estimates[FOURIER].facts["frequency_hz"]
    angles = np.column_stack(
        [
            np.interp(
                time,
                first.arm.host_time_ns,
                first.arm.q_measured[:, first.arm.joint_names.index(joint)],
            )
            for joint in AXES.values()
        ]
    )
    found = {}
    for number in HARMONICS:
        phases = 2 * np.pi * frequency * np.outer(seconds, np.arange(1, number + 1))
        columns = np.hstack([np.ones((len(time), 1)), np.cos(phases), np.sin(phases)])
        left = angles - columns @ np.linalg.lstsq(columns, angles, rcond=None)[0]
        found[number] = float(np.degrees(np.sqrt(np.mean(left**2))))
    return found
