"""How many of the faults that recordings have are named by the checks of self-consistency.

Each fault is put into recordings that are right: simulated ones, and where they are to be had the
real ones. It must be named, or said to be what the motion does not show.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from testbench.consistency.angular_rate import names_of
from testbench.records.findings.finding import Finding, Severity
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.recordings import Known, check_samples, real, simulated
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show

COUNT = 200
LEAST_NAMED, MOST_UNCHECKED = 98.0, 10.0
NAMED, UNCHECKED, OTHER, MISSED = "named", "unchecked", "named wrongly", "missed"
SCALES = ("scale_or_rate", "gain_or_rate")
"""Either says that a scale or the rate is wrong, by a number that is listed or by any."""
GAIN_WITHIN = 0.2
"""Part by which a gain that was fitted may be off for the fault to be named by it."""
Change = Callable[[ImuSamples], ImuSamples]


@dataclass(frozen=True)
class Fault:
    """A fault, and how it must be told.

    Attributes:
        name: For people.
        put: Puts it into samples.
        needs: Quantities without which it cannot be there: "mag", "device_q".
        codes: Any of these findings names it.
        says: What such a finding must name, as its values show it; "" where the code says it all.
        about: What an unchecked one is called, in part.
    """

    name: str
    put: Change
    codes: tuple[str, ...]
    says: str = ""
    needs: tuple[str, ...] = ()
    about: str = "gyroscope against accelerometer"


def _axes(quantity: str, matrix: np.ndarray) -> Change:
    def put(samples: ImuSamples) -> ImuSamples:
        return replace(samples, **{quantity: getattr(samples, quantity) @ matrix.T})

    return put


def _scaled(quantity: str, factor: float) -> Change:
    return lambda samples: replace(samples, **{quantity: getattr(samples, quantity) * factor})


def _clock(factor: float) -> Change:
    def put(samples: ImuSamples) -> ImuSamples:
        time = samples.device_time_ns - samples.device_time_ns[0]
        time = np.round(time * factor).astype(np.int64)
        return replace(samples, device_time_ns=time, host_time_ns=time)

    return put


def _quaternion(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda samples: replace(samples, device_q=change(samples.device_q))


def _without_gravity(samples: ImuSamples) -> ImuSamples:
    """What is left of the accelerometer if a device takes gravity off by its own orientation."""
    if samples.device_q is None:
        # the slow part is taken for gravity
        width = 401
        slow = np.column_stack(
            [
                np.convolve(np.pad(axis, width // 2, mode="edge"), np.ones(width) / width, "valid")
                for axis in samples.acc.T
            ]
        )
        return replace(samples, acc=samples.acc - slow)
    w, x, y, z = samples.device_q.T
    up = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    return replace(samples, acc=samples.acc - 9.80665 * up)


def _zero(samples: ImuSamples) -> ImuSamples:
    return replace(samples, acc=np.zeros_like(samples.acc))


def _ned(q: np.ndarray) -> np.ndarray:
    half = np.sqrt(0.5)
    w, x, y, z = q.T
    # the turn of NED into ENU, conjugated, before it: (0, -half, -half, 0)
    return np.column_stack([half * (x + y), half * (-w - z), half * (-w + z), half * (x - y)])


SIGNS = {axis: np.diag([-1.0 if i == k else 1.0 for i in range(3)]) for k, axis in enumerate("xyz")}
SWAPS = {
    "x and y": np.eye(3)[[1, 0, 2]],
    "y and z": np.eye(3)[[0, 2, 1]],
    "x and z": np.eye(3)[[2, 1, 0]],
}
TURN = np.eye(3)[[1, 2, 0]]
AK8963 = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])


def _of_gyroscope() -> list[Fault]:
    mirrored = ("gyr_mirrored",)
    found = [
        Fault(f"gyr: sign of {axis}", _axes("gyr", m), mirrored, names_of(m.T))
        for axis, m in SIGNS.items()
    ]
    found += [
        Fault(f"gyr: {axes} swapped", _axes("gyr", m), mirrored, names_of(m.T))
        for axes, m in SWAPS.items()
    ]
    return found + [
        Fault("gyr: all negated", _scaled("gyr", -1), ("gyr_negated",)),
        Fault("gyr: axes turned", _axes("gyr", TURN), ("gyr_or_acc_axes",), names_of(TURN.T)),
        Fault("gyr: scale 2", _scaled("gyr", 2), SCALES, "0.5"),
        Fault("gyr: scale 0.5", _scaled("gyr", 0.5), SCALES, "2"),
        Fault("gyr: deg/s as rad/s", _scaled("gyr", 180 / np.pi), ("gyr_unit",), "deg/s"),
        Fault("gyr: rad/s as deg/s", _scaled("gyr", np.pi / 180), ("gyr_unit",), "rad/s"),
    ]


def _of_accelerometer() -> list[Fault]:
    axes = ("gyr_or_acc_axes", "acc_axes")
    found = [
        Fault(f"acc: sign of {axis}", _axes("acc", m), axes, names_of(m.T))
        for axis, m in SIGNS.items()
    ]
    found += [
        Fault(f"acc: {axes_} swapped", _axes("acc", m), axes, names_of(m.T))
        for axes_, m in SWAPS.items()
    ]
    return found + [
        Fault("acc: axes turned", _axes("acc", TURN), axes, names_of(TURN.T)),
        Fault(
            "acc: negated, as by phones",
            _scaled("acc", -1),
            ("acc_negated", "orientation_down"),
            needs=("device_q",),
            about="orientation",
        ),
        Fault(
            "acc: negated, without an orientation",
            lambda samples: replace(samples, acc=-samples.acc, device_q=None),
            ("acc_or_mag_negated",),
            about="accelerometer: sign",
        ),
        *(
            Fault(f"acc: {unit} as m/s^2", _scaled("acc", each), ("acc_unit",), unit, about="unit")
            for unit, each in {"g": 1 / 9.80665, "mg": 1000 / 9.80665}.items()
        ),
        Fault("acc: m/s^2 as g", _scaled("acc", 9.80665), ("acc_unit", "acc_norm"), about="unit"),
        Fault("acc: gravity removed", _without_gravity, ("no_gravity",), about="unit"),
        Fault("acc: exactly zero", _zero, ("no_gravity",), about="unit"),
    ]


def _of_magnetometer() -> list[Fault]:
    def fault(name: str, matrix: np.ndarray) -> Fault:
        return Fault(
            f"mag: {name}",
            _axes("mag", matrix),
            ("mag_axes",),
            names_of(matrix.T),
            ("mag",),
            "magnetometer",
        )

    units = {"nT": 1e3, "mT": 1e-3, "G": 1e-2, "mG": 10.0}
    return [
        *(fault(f"sign of {axis}", m) for axis, m in SIGNS.items()),
        *(fault(f"{axes} swapped", m) for axes, m in SWAPS.items()),
        fault("axes of the AK8963", AK8963),
        *(
            Fault(f"mag: {unit} as uT", _scaled("mag", factor), ("mag_unit",), unit, ("mag",))
            for unit, factor in units.items()
        ),
    ]


def _of_time() -> list[Fault]:
    codes = ("time_unit", "rate", "gyr_or_time_unit")
    factors = {
        "ms as s": 1e3,
        "us as s": 1e6,
        "us as ms": 1e3,
        "ns as s": 1e6,
        "s as ms": 1e-3,
        "ms as us": 1e-3,
        "us as counts of 100 us": 100.0,
        "counts of 100 us as ms": 10.0,
        "counts of 10 us as us": 0.1,
        "counts of 100 us as us": 0.01,
    }
    return [Fault(f"time: {name}", _clock(factor), codes) for name, factor in factors.items()] + [
        Fault("time: rate 2", _clock(0.5), SCALES, "2"),
        Fault("time: rate 0.5", _clock(2.0), SCALES, "0.5"),
    ]


def _of_orientation() -> list[Fault]:
    conjugate = np.array([1.0, -1, -1, -1])
    order, way = "order: xyzw", "direction: sensor_from_earth"

    def fault(name: str, change: Callable[[np.ndarray], np.ndarray], code: str, says: str) -> Fault:
        codes = tuple(code.split())
        return Fault(
            f"q: {name}", _quaternion(change), codes, says, ("device_q",), about="orientation"
        )

    return [
        fault("x y z w as w x y z", lambda q: np.roll(q, -1, axis=1), "orientation_reading", order),
        fault(
            "w x y z as x y z w",
            lambda q: np.roll(q, 1, axis=1),
            "orientation_reading",
            "order: wxyz",
        ),
        fault("conjugated", lambda q: q * conjugate, "orientation_reading", way),
        fault(
            "x y z w and conjugated",
            lambda q: np.roll(q * conjugate, -1, axis=1),
            "orientation_reading",
            order,
        ),
        fault("NED", _ned, "orientation_ned orientation_down", ""),
    ]


FAULTS = [
    *_of_gyroscope(),
    *_of_accelerometer(),
    *_of_magnetometer(),
    *_of_time(),
    *_of_orientation(),
]


def outcome(fault: Fault, findings: list[Finding], expected: set[str]) -> str:
    """What findings make of a fault.

    Args:
        fault: That was put in.
        findings: On the recording with it.
        expected: Codes of warnings that the recording raises without it.
    """
    told = {
        one.code.removeprefix("consistency."): one
        for one in findings
        if one.severity is Severity.WARNING
    }
    for code in fault.codes:
        if code in told:
            values = [
                text
                for value in told[code].values.values()
                for text in (value if isinstance(value, list) else [str(value)])
            ]
            within = GAIN_WITHIN if code == "gain_or_rate" else 1e-6
            if not fault.says or any(_same(fault.says, value, within) for value in values):
                return NAMED
    if set(told) - expected:
        return OTHER
    unchecked = [
        text for one in findings if one.code.endswith("unchecked") for text in one.values["what"]
    ]
    return UNCHECKED if any(fault.about in text for text in unchecked) else MISSED


def _same(wanted: str, value: str, within: float) -> bool:
    if wanted == value:
        return True
    try:
        return abs(float(value) - float(wanted)) < within * float(wanted)
    except ValueError:
        return False


def tried(known: Known) -> dict[str, Any]:
    """What is found in a recording as it is, and with each fault: outcome by its name."""
    clean = warnings(known.samples)
    return {
        "name": known.name,
        "clean": [str(one) for one in check_samples([known.samples]) if _warns(one)],
        "faults": {
            fault.name: outcome(fault, check_samples([fault.put(known.samples)]), clean)
            for fault in FAULTS
            if all(getattr(known.samples, quantity) is not None for quantity in fault.needs)
        },
    }


def warnings(samples: ImuSamples) -> set[str]:
    """Codes of the warnings on samples."""
    return {
        one.code.removeprefix("consistency.") for one in check_samples([samples]) if _warns(one)
    }


def _warns(one: Finding) -> bool:
    return one.severity is Severity.WARNING


def _trials(numbers: range) -> Iterator[dict[str, Any]]:
    """Simulated recordings first, then the real ones."""
    for number in numbers:
        yield tried(simulated(number))


def _real_trials(numbers: range) -> Iterator[dict[str, Any]]:
    for known in islice(real(), numbers.start, numbers.stop):
        yield tried(known)


def bench_faults(count: int = COUNT) -> bool:
    """Put every fault into so many simulated recordings and the real ones, and print what was made
    of it; whether the checks are as good as they must be.
    """
    found = resumed("faults", count, _trials)
    number = sum(1 for _ in real())
    theirs = resumed("faults_real", number, _real_trials)
    good = _table("simulated", found)
    good &= _table("real", theirs) if theirs else True
    alarmed = [f"{one['name']}: {text}" for one in [*found, *theirs] for text in one["clean"]]
    print(f"warnings on recordings without a fault: {len(alarmed)}", *alarmed, sep="\n   ")
    return good


def _table(kind: str, found: list[dict[str, Any]]) -> bool:
    rows: list[list[str | Text]] = []
    total = dict.fromkeys((NAMED, UNCHECKED, OTHER, MISSED), 0)
    for fault in FAULTS:
        own = [one["faults"][fault.name] for one in found if fault.name in one["faults"]]
        if not own:
            continue
        counts = {key: own.count(key) for key in total}
        total = {key: total[key] + counts[key] for key in total}
        rows.append([Text(fault.name), str(len(own)), *_shares(counts)])
    rows.append([Text("all"), str(sum(total.values())), *_shares(total)])
    show(
        f"Faults put into {len(found)} {kind} recordings",
        ["fault", "recordings", "named of checked [%]", "unchecked [%]", OTHER, MISSED],
        rows,
        f"target: {LEAST_NAMED:g} % of the checked named, {MOST_UNCHECKED:g} % unchecked",
    )
    checked = sum(total.values()) - total[UNCHECKED]
    return 100 * total[NAMED] >= LEAST_NAMED * checked and 100 * total[
        UNCHECKED
    ] <= MOST_UNCHECKED * sum(total.values())


def _shares(counts: dict[str, int]) -> list[str]:
    whole = sum(counts.values())
    checked = whole - counts[UNCHECKED]
    return [
        f"{100 * counts[NAMED] / checked:.1f}" if checked else "-",
        f"{100 * counts[UNCHECKED] / whole:.1f}",
        str(counts[OTHER]),
        str(counts[MISSED]),
    ]


if __name__ == "__main__":
    sys.exit(not bench_faults(count_of(COUNT, __doc__)))
