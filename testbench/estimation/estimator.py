"""The stage `estimate`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from testbench.estimation.calibration.stored_calibration import StoredCalibrations
from testbench.estimation.chain.recording import ChainRecording
from testbench.estimation.chain.session import estimate_chain
from testbench.estimation.filters import OrientationFilter
from testbench.estimation.filters.tuned import Parameters, choose_tuned
from testbench.estimation.joints.body_recording import Read, ends
from testbench.estimation.joints.joints import estimate_joints
from testbench.estimation.prepared_sensor import PreparedSensor, prepare_sensor, told_apart
from testbench.estimation.signals.recording import RunFacts, SensorRecording
from testbench.exceptions import BenchError, SessionError
from testbench.records.disk.free_memory import give_back
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration_file import SensorCalibration
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import Estimate, SensorEstimate
from testbench.records.results.tuning import Tuning
from testbench.records.session.session import Session
from testbench.records.specs.protocol import BodyJoint

LEAST_SAMPLES = 10
"""Of a sensor, for anything to be estimated."""


def estimate(
    session: Session,
    filters: Sequence[str | OrientationFilter] | None = None,
    calibrations: list[SensorCalibration] | None = None,
    tunings: Sequence[Tuning] = (),
    parameters: Parameters | None = None,
) -> Estimate:
    """Compute what the sensors, filters and joint angles say.

    Args:
        session: A recording.
        filters: Those to run, by name (with the parameters that the protocol gives them) or as they
            are; those of the protocol, and those that were tuned or set, if None.
        calibrations: To correct the raw samples with first; each sensor takes its own that is
            nearest in time.
        tunings: Whose parameters to use in place of the protocol's, at most one a filter.
        parameters: Single ones to set, by filter and name, whatever protocol or tuning say.

    Raises:
        NotFoundError: An unknown filter or parameter.
        InputError: A parameter's value is not allowed, or a filter that was tuned or set is not
            among those to run.
        SessionError: The session holds no samples.
    """
    settings = session.analysis.estimate
    chosen = choose_tuned(
        filters, settings.filters, settings.filter_parameters, tunings, parameters
    )
    stored = StoredCalibrations.among(calibrations or [], session)
    stored.check()
    run = RunFacts.of(session)
    sensors, read = _one_by_one(session, stored, run, chosen)
    joints = estimate_joints(session.analysis.joints, run, sensors, read, chosen)
    chain, chain_findings = _chain(session, run, sensors)
    used = {kind.name: kind.parameters for kind in chosen}
    given = {name: list(own) for name, own in (parameters or {}).items()}
    tuned = {tuning.filter: tuning.used_on(session, given.get(tuning.filter)) for tuning in tunings}
    known = {kind.name: kind.behaviour for kind in chosen if kind.behaviour}
    return Estimate(
        session.name,
        session.fingerprint,
        sensors,
        joints,
        used,
        {name: entry for name, entry in tuned.items() if entry.tuned},
        chain,
        chain_findings,
        known,
        given,
    )


class PreparedSession:
    """A recording made ready for filters that run over it many times: only what depends on them is
    computed each time.

    Args:
        session: The recording.
        calibrations: As for `estimate`.
        joints: Those wanted, and only their sensors; all sensors and no joint if None.
    """

    def __init__(
        self,
        session: Session,
        calibrations: list[SensorCalibration] | None = None,
        joints: Sequence[str] | None = None,
    ):
        self._session, self._facts = session.name, RunFacts.of(session)
        self._fingerprint = session.fingerprint
        self._joints = {name: session.analysis.joints[name] for name in joints or []}
        wanted = set(session.sensor_names)
        if joints is not None:
            defined = self._joints.values()
            wanted = {sensor for joint in defined for sensor in (joint.proximal, joint.distal)}
        names = [name for name in session.sensor_names if name in wanted]
        stored = StoredCalibrations.among(calibrations or [], session)
        prepared = dict(_prepared(session, stored, names, self._facts))
        self.sensors = told_apart(prepared, self._facts.settings.align_clock)

    def run(self, filters: Sequence[OrientationFilter]) -> Estimate:
        """The estimate by some filters, of the sensors and joints that were prepared."""
        sensors = {name: sensor.run(filters) for name, sensor in self.sensors.items()}
        read = {name: sensor.read for name, sensor in self.sensors.items()}
        joints = estimate_joints(self._joints, self._facts, sensors, read, filters)
        used = {kind.name: kind.parameters for kind in filters}
        return Estimate(self._session, self._fingerprint, sensors, joints, used)


def _one_by_one(
    session: Session,
    stored: StoredCalibrations,
    run: RunFacts,
    filters: Sequence[OrientationFilter],
) -> tuple[dict[str, SensorEstimate], dict[str, Read]]:
    """Estimates of all sensors, and what those of a body's joints read.

    What a sensor is prepared to is let go before the next one is prepared: of hours, two do not
    fit beside one another. Where one is suspected to have moved as the truth of another says, the
    others are prepared once more.
    """
    names = session.sensor_names
    joints = [own for own in session.analysis.joints.values() if isinstance(own, BodyJoint)]
    of_body = {sensor for joint in joints for sensor in ends(joint)}
    found: dict[str, SensorEstimate] = {}
    read: dict[str, Read] = {}
    held: dict[str, PreparedSensor] = {}
    for name, prepared in _prepared(session, stored, names, run):
        if len(names) > 1 and prepared.is_suspect:
            held[name] = prepared
            continue
        if name in of_body:
            read[name] = prepared.read
        light = prepared.light()
        del prepared
        give_back()
        found[name] = light.run(filters)
        del light
        give_back()
    if held:
        every = held | dict(_prepared(session, stored, list(found), run))
        apart = told_apart({name: every[name] for name in names}, run.settings.align_clock)
        found |= {name: apart[name].run(filters) for name in held}
        read |= {name: apart[name].read for name in of_body & held.keys()}
    return {name: found[name] for name in names}, read


def _chain(
    session: Session, run: RunFacts, sensors: Mapping[str, SensorEstimate]
) -> tuple[list[ChainEstimate], list[Finding]]:
    """Joints by the chain filter, where the session asks for them; see `estimate_chain`."""
    if run.settings.chain is None:
        return [], []
    try:
        recording = ChainRecording.of(session, run)
    except BenchError as error:  # the model of an import is not there, or does not fit it
        return [], [finding("chain.not_estimated", "chain", why=str(error))]
    return estimate_chain(recording, sensors, run.settings.chain)


def _prepared(
    session: Session, stored: StoredCalibrations, names: Iterable[str], run: RunFacts
) -> Iterator[tuple[str, PreparedSensor]]:
    """Sensors of a session, opened and prepared, one after the other, with their names.

    Raises:
        SessionError: There is none, or one has too few samples.
    """
    if not session.sensor_names:
        raise SessionError(f"{session.path}: its manifest names no sensors")
    for name in names:
        recording = SensorRecording.of(session, name)
        if recording.raw.count < LEAST_SAMPLES:
            raise SessionError(
                f"{session.path}: sensor '{name}' has {recording.raw.count} samples; nothing can "
                "be estimated"
            )
        yield name, prepare_sensor(recording, run, stored.of(name), stored.findings(name))
