"""The self-test: right filters pass, and every usual mistake is caught and called by its name."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.estimation.filters import FILTERS, UniformSamples, get_filter
from testbench.estimation.filters.base import OrientationFilter, RecursiveFilter
from testbench.estimation.filters.known_motions import BIASED, axis_aligned, recordings
from testbench.estimation.filters.self_test import self_test
from testbench.model import rotation
from testbench.model.earths import to_earth_frame

pytestmark = pytest.mark.slow

SOUND = [name for name, kind in FILTERS.items() if name != "device" and not kind.known_faults]
AS_PRINTED = [name for name, kind in FILTERS.items() if kind.known_faults]


@pytest.mark.parametrize("name", SOUND)
def test_every_filter_of_the_bench_passes_with_half_of_every_limit_to_spare(name):
    result = self_test(get_filter(name))
    assert result.passed and not result.reason
    assert (
        max(check.worst_deg / check.limit_deg for check in result.checks if check.name != BIASED)
        < 0.5
    )
    heading = [check.name for check in result.checks if check.name == "known heading"]
    assert bool(heading) == ("mag" in FILTERS[name].needs)


@pytest.mark.parametrize("name", AS_PRINTED)
def test_a_filter_with_the_errors_of_its_publication_fails_and_says_which(name):
    result = self_test(get_filter(name))
    assert not result.passed and result.known
    assert result.reason == FILTERS[name].known_faults


def test_the_device_passes_on_a_right_orientation_of_its_own():
    assert self_test(get_filter("device")).passed


def test_the_recordings_hold_what_an_ideal_sensor_gives():
    assert len(axis_aligned()) == 24
    for cases in recordings(("gyr", "device_q")).values():
        for case in cases:
            up = rotation.rotate(case.q_true, case.samples.acc)
            np.testing.assert_allclose(up, np.tile([0, 0, 9.80665], (len(up), 1)), atol=1e-9)
            step = rotation.multiply(rotation.conjugate(case.q_true[:-1]), case.q_true[1:])
            rate = rotation.to_rotation_vector(step) / case.samples.steps()[1:, None]
            at_rest = rate[0] if case.begin is None else rate[case.begin - 1]
            bias = case.samples.gyr[0]
            np.testing.assert_allclose(at_rest, 0, atol=1e-9)
            np.testing.assert_allclose(rate + bias, case.samples.gyr[1:], atol=1e-9)
            vertical = rotation.rotate(case.samples.device_q, case.samples.acc)
            np.testing.assert_allclose(vertical, up, atol=1e-9)
            assert bias == pytest.approx(0) or np.degrees(np.linalg.norm(bias)) == pytest.approx(1)
    assert all(
        case.samples.device_q is None
        for cases in recordings(("gyr", "acc")).values()
        for case in cases
    )


def mistaken(name: str, before=lambda samples: samples, after=lambda q: q) -> OrientationFilter:
    """A filter of the bench with a mistake before or after it."""
    kind = FILTERS[name]

    class Mistaken(OrientationFilter):
        needs, source = kind.needs, "a mistake"

        def run(self, samples: UniformSamples) -> np.ndarray:
            return after(kind().run(before(samples)))

    Mistaken.name = "mistaken"
    return Mistaken()


def scale(quantity: str, factor: float):
    return lambda s: replace(s, **{quantity: factor * getattr(s, quantity)})


def map_axes(quantities: list[str], rows: list[list[int]]):
    return lambda s: replace(s, **{key: getattr(s, key) @ np.array(rows).T for key in quantities})


def ned(q: np.ndarray) -> np.ndarray:
    return to_earth_frame(q, "NED")


SWAP_XY, FLIP_Z, CYCLE = (
    [[0, 1, 0], [1, 0, 0], [0, 0, 1]],
    [[1, 0, 0], [0, 1, 0], [0, 0, -1]],
    [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
)
MISTAKES = [
    ("rates look like they were taken as deg/s", scale("gyr", np.pi / 180), None, "imu marg"),
    ("turned into deg/s and then used as rad/s", scale("gyr", 180 / np.pi), None, "imu marg"),
    ("the sign of the rates is reversed", scale("gyr", -1), None, "imu marg"),
    ("takes the accelerometer for gravity", scale("acc", -1), None, "imu marg tilt ecompass"),
    ("the sign of the magnetometer is reversed", scale("mag", -1), None, "marg ecompass"),
    ("axis z has the wrong sign of the gyroscope", map_axes(["gyr"], FLIP_Z), None, "imu marg"),
    ("axes x and y are swapped of the gyroscope", map_axes(["gyr"], SWAP_XY), None, "imu marg"),
    (
        "axes x and y are swapped of the accelerometer",
        map_axes(["acc"], SWAP_XY),
        None,
        "imu marg tilt ecompass",
    ),
    (
        "axis z has the wrong sign of the accelerometer",
        map_axes(["acc"], FLIP_Z),
        None,
        "imu marg tilt ecompass",
    ),
    (
        "axis z has the wrong sign of the magnetometer",
        map_axes(["mag"], FLIP_Z),
        None,
        "marg ecompass",
    ),
    (
        "axes are taken as z, x, y of the sensor",
        map_axes(["gyr", "acc", "mag"], CYCLE),
        None,
        "imu marg",
    ),
    ("its quaternion is conjugated", None, rotation.conjugate, "imu marg tilt ecompass"),
    (
        "in the order x, y, z, w: it",
        None,
        lambda q: np.roll(q, -1, axis=1),
        "imu marg tilt ecompass",
    ),
    (
        "in the order x, y, z, w, and conjugated",
        None,
        lambda q: np.roll(rotation.conjugate(q), -1, axis=1),
        "imu marg",
    ),
    ("its earth frame is NED", None, ned, "marg ecompass"),
    (
        "or its earth has z down",
        None,
        ned,
        "imu",
    ),  # heading being free, the two cannot be told apart
    (
        "its earth frame is NWU",
        None,
        lambda q: rotation.multiply([np.sqrt(0.5), 0, 0, -np.sqrt(0.5)], q),
        "marg ecompass",
    ),
]


def late(count: int):
    return lambda q: np.vstack([np.repeat(q[:1], count, axis=0), q[:-count]])


def every(interval: float):
    return lambda s: replace(s, interval=interval, intervals=None)


MISTAKES += [
    ("takes every interval for 10 ms", every(0.01), None, "imu marg"),
    ("takes every interval for 20 ms", every(0.02), None, "imu marg"),
    (
        "takes every interval for the mean one",
        lambda s: replace(s, intervals=None),
        None,
        "imu marg",
    ),
    ("its output comes 1 sample late", None, late(1), "imu marg ecompass"),
    ("its output comes 4 samples late", None, late(4), "imu marg ecompass"),
    (
        "adds the bias of the gyroscope instead of taking it away",
        lambda s: replace(s, gyr=s.gyr + s.gyr[0]),
        None,
        "free",
    ),
]
STANDS_FOR = {
    "imu": ("madgwick_imu", "vqf_6d"),
    "marg": ("mahony_marg", "ekf"),
    "tilt": ("tilt",),
    "ecompass": ("ecompass",),
    "free": ("gyro", "complementary"),
}


@pytest.mark.parametrize(
    ("words", "before", "after", "kinds"), MISTAKES, ids=[words for words, *_ in MISTAKES]
)
def test_a_mistake_is_caught_and_named(words, before, after, kinds):
    for name in (name for kind in kinds.split() for name in STANDS_FOR[kind]):
        result = self_test(mistaken(name, before or (lambda s: s), after or (lambda q: q)))
        assert not result.passed, name
        assert words in result.reason, (name, result.reason)


def test_a_filter_that_doubts_the_gyroscope_wrongly_is_told_how_far_it_is_off():
    result = self_test(mistaken("gyro", lambda s: replace(s, gyr=s.gyr + 4 * s.gyr[0])))
    assert [check.name for check in result.checks if not check.passed] == [BIASED]
    assert (
        "makes more of the bias of the gyroscope than there is: it is 10.0 deg off" in result.reason
    )


def test_a_filter_that_takes_the_bias_away_stays_far_below_the_gyroscope_alone():
    result = self_test(mistaken("gyro", lambda s: replace(s, gyr=s.gyr - s.gyr[0])))
    assert result.passed
    assert next(
        check for check in result.checks if check.name == BIASED
    ).worst_deg == pytest.approx(0, abs=1e-6)


class Corrected(OrientationFilter):
    """The device's orientation, its heading by the magnetometer."""

    name, needs, source = "corrected", ("device_q", "mag"), "a test"
    turned = staticmethod(lambda q: q)

    def run(self, samples: UniformSamples) -> np.ndarray:
        q = self.turned(samples.device_q)
        field = rotation.rotate(q, samples.mag)
        return rotation.multiply(rotation.from_heading(np.arctan2(field[:, 0], field[:, 1])), q)


def test_a_filter_of_the_devices_orientation_is_tested_with_one():
    assert self_test(Corrected()).passed

    class Conjugated(Corrected):
        turned = staticmethod(rotation.conjugate)

        def run(self, samples: UniformSamples) -> np.ndarray:
            return self.turned(samples.device_q)

    result = self_test(Conjugated())
    assert not result.passed and "conjugated" in result.reason


def test_only_a_filter_that_asks_for_it_is_given_the_devices_orientation():
    class Peeps(OrientationFilter):
        name, needs, source = "peeps", ("gyr", "acc"), "a test"

        def run(self, samples: UniformSamples) -> np.ndarray:
            return samples.device_q

    assert not self_test(Peeps()).passed


def test_irregular_samples_of_a_device_reach_a_filter_for_regular_ones():
    class Smooth(RecursiveFilter):
        name, needs, source = "smooth", ("device_q",), "a test"

        def advance(self, samples, state=None):
            return samples.device_q, {"filter": self.name}

    assert self_test(Smooth()).passed


def test_a_filter_that_starts_from_anywhere_else_is_told_so():
    slow = mistaken(
        "madgwick_imu", lambda s: replace(s, acc=np.vstack([[0.0, 0.0, 9.8], s.acc[1:]]))
    )
    result = self_test(slow)
    assert not result.passed
    assert (
        "does not find its start within 6 s" in result.reason or "cannot be told" in result.reason
    )


@pytest.mark.parametrize(
    ("after", "words"),
    [
        (lambda q: q[:, :3], "(800, 3)"),
        (lambda q: q * 2, "unit length"),
        (lambda q: q * np.nan, "not finite"),
        (lambda q: list(q), "list"),
        (lambda q: q[1:], "(799, 4)"),
    ],
)
def test_output_of_the_wrong_form_is_named(after, words):
    assert words in self_test(mistaken("gyro", after=after)).reason


def test_a_filter_that_remembers_or_writes_into_its_input_is_caught():
    class Remembers(OrientationFilter):
        name, needs, source = "remembers", ("gyr",), "a mistake"
        runs = 0

        def run(self, samples):
            self.runs += 1
            return get_filter("gyro").run(replace(samples, gyr=samples.gyr * self.runs))

    class Writes(OrientationFilter):
        name, needs, source = "writes", ("gyr",), "a mistake"

        def run(self, samples):
            q = get_filter("gyro").run(samples)
            samples.acc[:] = 0.0
            return q

    class Raises(OrientationFilter):
        name, needs, source = "raises", ("gyr",), "a mistake"

        def run(self, samples):
            raise ZeroDivisionError("no")

    assert "must not remember" in self_test(Remembers()).reason
    assert "writes into the samples" in self_test(Writes()).reason
    assert "ZeroDivisionError" in self_test(Raises()).reason


def test_the_command_judges_the_filters_and_a_file_and_its_exit_code_tells(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "from testbench.estimation.filters import OrientationFilter, get_filter\n"
        "from dataclasses import replace\n"
        "import numpy as np\n"
        "class Mine(OrientationFilter):\n"
        "    name, needs, source = 'mine', ('gyr', 'acc'), 'me'\n"
        "    def run(self, samples):\n"
        "        return get_filter('madgwick_imu').run(replace(samples, "
        "gyr=np.radians(samples.gyr)))\n"
    )
    runner = CliRunner()
    good = runner.invoke(app, ["filters", "--self-test", "--json", "vqf_6d", "tilt"])
    assert good.exit_code == 0
    assert json.loads(good.stdout)["passed"] is True
    bad = runner.invoke(app, ["filters", "--self-test", "--json", f"{file}:Mine"])
    assert bad.exit_code == 2
    (report,) = json.loads(bad.stdout)["filters"]
    assert "taken as deg/s" in report["reason"] and not report["passed"]
    table = runner.invoke(app, ["filters", "--self-test", f"{file}:Mine"])
    assert table.exit_code == 2 and "turn about +z" in table.stdout
    everything = runner.invoke(app, ["filters", "--self-test", "--json"])
    assert everything.exit_code == 0
    assert len(json.loads(everything.stdout)["filters"]) >= len(FILTERS) - 1
