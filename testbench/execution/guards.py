"""Guards: what is watched during a run, and what follows when a limit is broken."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from testbench.exceptions import DriverError
from testbench.frames import NANOSECONDS
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.session.session import Event
from testbench.records.specs.protocol_arm import Action, Guard, Guards

REFERENCE_SAMPLES = 60
"""The magnetic norm is compared with the median of a sensor's first samples, so many."""
CLEAR, CLEAR_OF_HEAT = 0.8, 0.95
"""A limit holds again once the value is below this share of it (above its inverse, for a lower
limit)...
"""
CALM_NS = 3 * NANOSECONDS
"""... for so long [ns]. A silence or a gap is over at once: the next one is another."""
MOST_DIGITS = 8


class GuardTripped(DriverError):
    """A guard stopped the run."""


@dataclass(frozen=True)
class Trip:
    """A limit that was broken.

    Attributes:
        guard: Its name, with the unit.
        subject: Sensor or joint.
        value: What was found, in the guard's unit.
        limit: What it may come to.
        action: What follows.
    """

    guard: str
    subject: str
    value: float
    limit: float
    action: Action

    @property
    def sentence(self) -> str:
        """For people."""
        quantity, _, unit = self.guard.rpartition("_")
        unit = {"percent": "%", "s": "s", "degC": "degC"}[unit]
        name = quantity.replace("_", " ")
        value = next(
            (text for text in self._texts() if float(text) != self.limit), f"{self.value:g}"
        )
        return f"{name} of {self.subject}: {value} {unit}, the limit is {self.limit:.3g} {unit}"

    def _texts(self) -> Iterator[str]:
        """The value, with ever more digits."""
        return (f"{self.value:.{digits}g}" for digits in range(3, MOST_DIGITS))


@dataclass
class _Limit:
    """What must be remembered of a limit: whether it was told to be broken, is broken, and since
    when it clearly holds.
    """

    told: bool = False
    broken: bool = False
    calm_since_ns: int | None = None


@dataclass
class _Sensor:
    """What a guard must remember of a sensor."""

    heard_ns: int = 0
    last_device_ns: int | None = None
    last_host_ns: int | None = None
    last_reading: np.ndarray | None = None
    moved_ns: dict[str, int] = field(default_factory=dict)
    norms: list[float] = field(default_factory=list)


class GuardWatch:
    """Looks at everything that is recorded, chunk by chunk.

    Says once that a limit is broken, until it clearly holds again.

    Args:
        guards: Limits and actions.
        sensors: Names.
        live: Whether they are devices; simulated ones may well say the same for long.

    Attributes:
        counts: How often each limit was broken, told or not, by "guard of subject".
        told: How often that was told.
        shares: How much of its limit each guard last came to, by guard and subject; 1 is the limit.
    """

    def __init__(self, guards: Guards, sensors: list[str], live: bool = False):
        self.guards, self._live = guards, live
        self._sensors = {name: _Sensor() for name in sensors}
        self._limits: dict[tuple[str, str], _Limit] = {}
        self._now_ns = 0
        self.counts: Counter[str] = Counter()
        self.told: Counter[str] = Counter()
        self.shares: dict[tuple[str, str], float] = {}

    @property
    def summary(self) -> str:
        """How often each limit was broken, and how often that was told where it was not every time;
        empty if nothing was told.
        """
        if not self.told:
            return ""
        counted = [
            f"{name} {count}" + (f" (told {self.told[name]})" if self.told[name] < count else "")
            for name, count in sorted(self.counts.items())
        ]
        return f"guards: {', '.join(counted)}"

    def look(
        self,
        now_ns: int,
        arm: ArmSamples,
        imus: Mapping[str, ImuSamples],
        events: Mapping[str, list[Event]] | None = None,
    ) -> list[Trip]:
        """What is broken now and was not at the last look.

        Args:
            now_ns: Host time.
            arm: What it reported since the last look.
            imus: What each sensor delivered since then, by its name.
            events: Of the sensors.
        """
        self._now_ns = now_ns
        trips: list[Trip] = []
        for name, samples in imus.items():
            known = self._sensors[name]
            if len(samples):
                known.heard_ns = now_ns
                if self._live:
                    for guard, value in self._liveliness(known, samples).items():
                        self._judge(trips, guard, name, value)
                self._judge(trips, "sample_gap_s", name, self._largest_gap(known, samples))
                self._judge(
                    trips, "magnetic_disturbance_percent", name, self._disturbance(known, samples)
                )
            silence = (now_ns - known.heard_ns) / NANOSECONDS
            self._judge(trips, "imu_silence_s", name, silence)
        for column, values in arm.extras.items():
            if column.startswith("temperature_") and len(values):
                joint = column.removeprefix("temperature_").removesuffix("_degC")
                self._judge(trips, "temperature_degC", joint, float(values.max()))
        for name, happened in (events or {}).items():
            for event in happened:
                charge = event.details.get("battery_percent")
                if charge is not None:
                    self._judge(trips, "battery_percent", name, float(charge), low=True)
        return trips

    def _judge(
        self, trips: list[Trip], guard: str, subject: str, value: float | None, low: bool = False
    ) -> None:
        setting: Guard = getattr(self.guards, guard)
        if setting.action == "off" or value is None:
            return
        used = value / setting.limit
        self.shares[guard, subject] = 1 / max(used, 0.01) if low else used
        broken = value < setting.limit if low else value > setting.limit
        known = self._limits.setdefault((guard, subject), _Limit())
        if broken:
            self.counts[f"{guard} of {subject}"] += not known.broken
            if not known.told:
                trips.append(Trip(guard, subject, value, setting.limit, setting.action))
                self.told[f"{guard} of {subject}"] += 1
            known.told, known.calm_since_ns = True, None
        elif guard.endswith("_s"):
            known.told = False
        elif known.told:
            share = CLEAR_OF_HEAT if guard == "temperature_degC" else CLEAR
            calm = value > setting.limit / share if low else value < setting.limit * share
            known.calm_since_ns = (
                (known.calm_since_ns if known.calm_since_ns is not None else self._now_ns)
                if calm
                else None
            )
            if known.calm_since_ns is not None and self._now_ns - known.calm_since_ns >= CALM_NS:
                known.told = False
        known.broken = broken

    @staticmethod
    def _liveliness(known: _Sensor, samples: ImuSamples) -> dict[str, float | None]:
        """For how long time and readings stand still, and the longest wait for a sample [s], by
        guard.
        """
        device, host = samples.device_time_ns, samples.host_time_ns
        reading = np.column_stack([samples.gyr, samples.acc])
        gap = None
        if known.last_host_ns is None:
            known.moved_ns = dict.fromkeys(("stuck_time_s", "stuck_reading_s"), int(host[0]))
        else:
            gap = float(np.diff(host, prepend=known.last_host_ns).max()) / NANOSECONDS
        before = device[0] if known.last_device_ns is None else known.last_device_ns
        rows = reading[:1] if known.last_reading is None else known.last_reading[None]
        moved = {
            "stuck_time_s": np.diff(device, prepend=before) != 0,
            "stuck_reading_s": (np.diff(reading, axis=0, prepend=rows) != 0).any(axis=1),
        }
        for guard, changes in moved.items():
            if changes.any():
                known.moved_ns[guard] = int(host[np.flatnonzero(changes)[-1]])
        known.last_host_ns, known.last_reading = int(host[-1]), reading[-1]
        stuck = {
            guard: (int(host[-1]) - since) / NANOSECONDS for guard, since in known.moved_ns.items()
        }
        return {**stuck, "arrival_gap_s": gap}

    @staticmethod
    def _largest_gap(known: _Sensor, samples: ImuSamples) -> float | None:
        times = samples.device_time_ns
        if known.last_device_ns is not None:
            times = np.append(known.last_device_ns, times)
        known.last_device_ns = int(times[-1])
        return float(np.diff(times).max()) / NANOSECONDS if len(times) > 1 else None

    @staticmethod
    def _disturbance(known: _Sensor, samples: ImuSamples) -> float | None:
        if samples.mag is None:
            return None
        norms = np.linalg.norm(samples.mag, axis=1)
        norms = norms[np.isfinite(norms)]
        if len(known.norms) < REFERENCE_SAMPLES:
            known.norms += norms[: REFERENCE_SAMPLES - len(known.norms)].tolist()
            return None
        if not len(norms):
            return None
        usual = float(np.median(known.norms))
        return 100 * float(np.abs(np.median(norms) - usual)) / usual if usual > 0 else None
