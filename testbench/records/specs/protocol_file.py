"""Read a protocol file with those it includes, and check that its names agree."""

from __future__ import annotations

from keyword import iskeyword
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from testbench.exceptions import FileProblems, NotFoundError, Problem
from testbench.records.disk.yaml_file import YamlDocument, few, load_yaml, validation_problems
from testbench.records.specs.file_kinds import why_no_protocol
from testbench.records.specs.protocol import (
    JOINT_METRICS,
    RESERVED_NAMES,
    SENSOR_METRICS,
    AcceptanceLimit,
    Protocol,
    ProtocolSpec,
    merge,
)
from testbench.records.specs.protocol_chain import CHAIN_METRICS, WHOLE_CHAIN
from testbench.records.specs.protocol_steps import Step
from testbench.records.specs.sensor import PRESET_SUFFIXES, ImuParameters, list_presets
from testbench.records.specs.shipped import shipped_folder

DEEPEST_INCLUDE = 5


def load_protocol(path: str | Path) -> Protocol:
    """Read, validate and cross-check a protocol and those it includes.

    Args:
        path: A file, or the name of a protocol that ships with the bench.

    Raises:
        FileProblems: The file is malformed; every problem at once, with line and column.
        NotFoundError: Neither a file nor the name of a shipped protocol.
    """
    file = Path(path)
    if file.suffix not in {".yaml", ".yml"} and not _exists(file):
        known = {shipped.stem: shipped for shipped in shipped_folder("protocols").glob("*.yaml")}
        if str(path) not in known:
            raise NotFoundError("protocol", str(path), sorted(known))
        file = known[str(path)]
    return _load(file, (), {})


def list_protocols() -> dict[str, str]:
    """Names and purposes of the protocols that ship with the bench."""
    return {
        path.stem: load_yaml(path, ProtocolSpec).value.purpose
        for path in sorted(shipped_folder("protocols").glob("*.yaml"))
    }


def _exists(file: Path) -> bool:
    try:
        return file.exists()
    except OSError:  # such as a name that is too long
        return False


def _load(file: Path, including: tuple[Path, ...], loaded: dict[Path, Protocol]) -> Protocol:
    document = load_yaml(file, ProtocolSpec, _no_protocol)
    presets, problems = _read_presets(document)
    protocol = Protocol(document, presets=presets)
    problems += _Names(document).check()
    own = file.resolve()
    for i, section in enumerate(document.value.sections):
        if section.include is None:
            continue
        try:
            target = _included(file, section.include, (*including, own))
        except ValueError as error:
            problems.append(document.problem(str(error), "sections", i, "include").problems[0])
            continue
        if target not in loaded:
            loaded[target] = _load(target, (*including, own), loaded)
        protocol.included[section.include] = loaded[target]
    if problems:
        raise FileProblems(file, few(problems))
    return protocol


def _no_protocol(data: dict[str, Any]) -> str | None:
    """What a file that is something else looks like, None where it may be meant as a protocol."""
    fields = ProtocolSpec.model_fields
    needed = [
        name for name, field in reversed(fields.items()) if field.is_required()
    ]  # `sections` tells most
    return why_no_protocol(data, needed, list(fields))


def _read_presets(document: YamlDocument[ProtocolSpec]) -> tuple[dict[str, str], list[Problem]]:
    """Put the content of preset files into the sensors that name them.

    So nothing but the protocol is needed later.

    Returns:
        The texts of the files by name, and what is wrong with them.
    """
    texts: dict[str, str] = {}
    problems: list[Problem] = []
    sensors = dict(document.value.sensors)
    for name, sensor in sensors.items():
        if sensor.preset is None or not sensor.preset.endswith(PRESET_SUFFIXES):
            continue
        try:
            target = _beside(document.file, sensor.preset, "a preset")
        except ValueError as error:
            problems.append(document.problem(str(error), "sensors", name, "preset").problems[0])
            continue
        preset = load_yaml(target, ImuParameters)
        texts[sensor.preset] = preset.text
        merged = merge(preset.value.model_dump(), sensor.parameters)
        sensors[name] = sensor.model_copy(update={"preset": None, "parameters": merged})
    if texts:
        document.value = document.value.model_copy(update={"sensors": sensors})
    return texts, problems


def _beside(file: Path, name: str, what: str) -> Path:
    """A file in the folder of a protocol; a ValueError says what is wrong with the name."""
    missing = f"no file '{name}' beside this protocol"
    try:
        target = (file.parent / name).resolve()
        there = target.is_file()
    except (OSError, ValueError):
        raise ValueError(missing) from None
    if target.parent != file.parent.resolve():
        raise ValueError(f"'{name}' lies elsewhere; {what} must lie in the folder of the protocol")
    if not there:
        raise ValueError(missing)
    return target


def _included(file: Path, name: str, including: tuple[Path, ...]) -> Path:
    """The file that an include names; a ValueError says what is wrong with it."""
    target = _beside(file, name, "an include")
    if target in including:
        raise ValueError(
            f"'{name}' includes itself" + (" by way of others" if target != including[-1] else "")
        )
    if len(including) > DEEPEST_INCLUDE:
        raise ValueError(f"includes nest deeper than {DEEPEST_INCLUDE} files")
    return target


class _Names:
    """Checks that names agree with one another inside a file.

    Args:
        document: The protocol.
    """

    def __init__(self, document: YamlDocument[ProtocolSpec]):
        self.document, self.spec = document, document.value
        self.problems: list[Problem] = []

    def check(self) -> list[Problem]:
        """Every name that does not fit."""
        for name in self.spec.variables:
            if name in RESERVED_NAMES or iskeyword(name):
                self._refuse(
                    f"'{name}' is a word of the expression language; choose another name",
                    "variables",
                    name,
                )
        self._sensors()
        self._joints()
        self._sections()
        for name in self.spec.estimate.euler_ranges:
            self._known(
                [section.name for section in self.spec.sections],
                name,
                "section",
                "estimate",
                "euler_ranges",
                name,
            )
        for i, exclusion in enumerate(self.spec.estimate.exclude):
            for k, name in enumerate(exclusion.sensors):
                place = ("estimate", "exclude", i, "sensors", k)
                self._known(list(self.spec.sensors), name, "sensor", *place)
        if self.spec.estimate.chain is not None:
            for i, name in enumerate(self.spec.estimate.chain.sensors):
                self._known(
                    list(self.spec.sensors), name, "sensor", "estimate", "chain", "sensors", i
                )
            for i, name in enumerate(self.spec.estimate.chain.sections):
                sections = [section.name for section in self.spec.sections]
                self._known(sections, name, "section", "estimate", "chain", "sections", i)
        for i, limit in enumerate(self.spec.accept):
            self._limit(limit, "accept", i)
        return sorted(self.problems, key=lambda problem: (problem.line or 0, problem.column or 0))

    def _refuse(self, message: str, *where: Any) -> None:
        self.problems.append(self.document.problem(message, *where).problems[0])

    def _known(self, known: list[str], name: str, kind: str, *where: Any) -> bool:
        if name not in known:
            self._refuse(str(NotFoundError(kind, name, known)), *where)
        return name in known

    def _sensors(self) -> None:
        for name, sensor in self.spec.sensors.items():
            where = ("sensors", name)
            if (sensor.preset or "").endswith(PRESET_SUFFIXES):
                continue  # a file that could not be read, which has been said
            if sensor.preset is not None and not self._known(
                list_presets(), sensor.preset, "sensor preset", *where, "preset"
            ):
                continue
            try:
                sensor.imu()
            except ValidationError as error:
                self.problems += validation_problems(
                    error, self.document.places, *where, "parameters"
                )

    def _joints(self) -> None:
        sensors = self.spec.sensors
        for name, joint in self.spec.joints.items():
            for side in ("proximal", "distal"):
                sensor = getattr(joint, side)
                if (
                    self._known(list(sensors), sensor, "sensor", "joints", name, side)
                    and sensors[sensor].segment is None
                ):
                    message = (
                        f"sensor '{sensor}' needs a segment: a joint angle is between "
                        "segments, whose axes must be stated"
                    )
                    self._refuse(message, "joints", name, side)
            for i, key in enumerate((joint.constraint.filters if joint.constraint else None) or []):
                where = ("joints", name, "constraint", "filters", i)
                self._known(
                    list(self.spec.estimate.filters), key, "filter of this protocol", *where
                )
            for key in ("misalignment", "flexion_variable"):
                if key in joint.model_fields_set:
                    self._known(
                        list(self.spec.variables),
                        getattr(joint, key),
                        "variable",
                        "joints",
                        name,
                        key,
                    )

    def _sections(self) -> None:
        names: set[str] = set()
        for i, section in enumerate(self.spec.sections):
            if section.name in names:
                self._refuse(f"two sections are called '{section.name}'", "sections", i, "name")
            names.add(section.name)
            self._loop(section.for_each, (), "sections", i, "for_each")
            self._steps(section.steps or [], tuple(section.for_each), "sections", i, "steps")

    def _steps(self, steps: list[Step], looped: tuple[str, ...], *where: Any) -> None:
        for k, step in enumerate(steps):
            loop = step.for_each or []
            self._loop(loop, looped, *where, k, "for_each")
            self._steps(step.steps or [], (*looped, *loop), *where, k, "steps")

    def _loop(self, loop: list[str], looped: tuple[str, ...], *where: Any) -> None:
        for m, name in enumerate(loop):
            if self._known(list(self.spec.variables), name, "variable", *where, m) and name in (
                *looped,
                *loop[:m],
            ):
                self._refuse(f"the variable '{name}' is looped over twice", *where, m)

    # One check a field of the limit, each against the names that the field may hold.
    def _limit(self, limit: AcceptanceLimit, *where: Any) -> None:
        spec = self.spec
        joint_metrics = [f"{joint}.{kind}" for joint in spec.joints for kind in JOINT_METRICS]
        sensor_metrics = [f"{name}.{kind}" for name in spec.sensors for kind in SENSOR_METRICS]
        chain_metrics = _chain_metrics(spec, limit.metric)
        known = self._known(
            [*joint_metrics, *sensor_metrics, *chain_metrics],
            limit.metric,
            "metric",
            *where,
            "metric",
        )
        if limit.section is not None:
            self._known(
                [section.name for section in spec.sections],
                limit.section,
                "section",
                *where,
                "section",
            )
        if limit.filter is not None and limit.metric in chain_metrics:
            assert spec.estimate.chain is not None
            self._known(
                list(spec.estimate.chain.states),
                limit.filter,
                "state of the chain",
                *where,
                "filter",
            )
        elif limit.filter is not None:
            self._known(
                list(spec.estimate.filters),
                limit.filter,
                "filter of this protocol",
                *where,
                "filter",
            )
        if limit.sequence is not None and known:
            if limit.metric not in joint_metrics:
                return self._refuse(
                    "sequence goes with metrics of a joint only", *where, "sequence"
                )
            joint = spec.joints[limit.metric.partition(".")[0]]
            labels = [angle.label for angle in joint.definitions()]
            self._known(
                labels,
                limit.sequence,
                "Euler sequence or definition of this joint",
                *where,
                "sequence",
            )
        return None


def _chain_metrics(spec: ProtocolSpec, wanted: str) -> list[str]:
    """Metrics of the chain's joints.

    Where the protocol names no joints only the plan knows which the arm has: the wanted one is
    taken to be among them.
    """
    chain = spec.estimate.chain
    if chain is None:
        return []
    owner, _, kind = wanted.partition(".")
    joints = chain.joints or ([owner] if kind in CHAIN_METRICS and owner != WHOLE_CHAIN else [])
    metrics = [f"{joint}.{kind}" for joint in joints for kind in CHAIN_METRICS]
    return metrics + [
        f"{WHOLE_CHAIN}.{kind}" for kind in CHAIN_METRICS if kind != "angle_mean_error_deg"
    ]
