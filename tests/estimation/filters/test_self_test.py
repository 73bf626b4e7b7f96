"""The self-test: right filters pass, and every usual mistake is caught and called by its name."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.estimation.filters import FILTERS, UniformSamples, get_filter
from testbench.estimation.filters.base import OrientationFilter
from testbench.estimation.filters.known_motions import axis_aligned, recordings
from testbench.estimation.filters.self_test import self_test
from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.earths import to_ned

SOUND = [name for name, kind in FILTERS.items() if name != "device" and not kind.known_faults]
AS_PRINTED = [name for name, kind in FILTERS.items() if kind.known_faults]


@pytest.mark.parametrize("name", SOUND)
def test_every_filter_of_the_bench_passes_with_half_of_every_limit_to_spare(name):
    result = self_test(get_filter(name))
    assert result.passed and not result.reason
    assert max(check.worst_deg / check.limit_deg for check in result.checks) < 0.5
    heading = [check.name for check in result.checks if check.name == "known heading"]
    assert bool(heading) == ("mag" in FILTERS[name].needs)


@pytest.mark.parametrize("name", AS_PRINTED)
def test_a_filter_with_the_errors_of_its_publication_fails_and_says_which(name):
    result = self_test(get_filter(name))
    assert not result.passed and result.known
    assert result.reason == FILTERS[name].known_faults


def test_the_device_has_no_self_test():
    with pytest.raises(InputError, match="has no device"):
        self_test(get_filter("device"))


def test_the_recordings_hold_what_an_ideal_sensor_gives():
    assert len(axis_aligned()) == 24
    for cases in recordings().values():
        for case in cases:
            up = rotation.rotate(case.q_true, case.samples.acc)
            np.testing.assert_allclose(up, np.tile([0, 0, 9.80665], (len(up), 1)), atol=1e-9)
            step = rotation.multiply(rotation.conjugate(case.q_true[:-1]), case.q_true[1:])
            np.testing.assert_allclose(rotation.to_rotation_vector(step) * 100, case.samples.gyr[1:], atol=1e-9)


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
    ("axes x and y are swapped of the accelerometer", map_axes(["acc"], SWAP_XY), None, "imu marg tilt ecompass"),
    ("axis z has the wrong sign of the accelerometer", map_axes(["acc"], FLIP_Z), None, "imu marg tilt ecompass"),
    ("axis z has the wrong sign of the magnetometer", map_axes(["mag"], FLIP_Z), None, "marg ecompass"),
    ("axes are taken as z, x, y of the sensor", map_axes(["gyr", "acc", "mag"], CYCLE), None, "imu marg"),
    ("its quaternion is conjugated", None, rotation.conjugate, "imu marg tilt ecompass"),
    ("in the order x, y, z, w: it", None, lambda q: np.roll(q, -1, axis=1), "imu marg tilt ecompass"),
    ("in the order x, y, z, w, and conjugated", None, lambda q: np.roll(rotation.conjugate(q), -1, axis=1), "imu marg"),
    ("its earth frame is NED", None, to_ned, "marg ecompass"),
    ("or its earth has z down", None, to_ned, "imu"), # heading being free, the two cannot be told apart
    ("its earth frame is NWU", None, lambda q: rotation.multiply([np.sqrt(0.5), 0, 0, -np.sqrt(0.5)], q), "marg ecompass"),
]  # fmt: skip
STANDS_FOR = {"imu": ("madgwick_imu", "vqf_6d", "mekf_imu"), "marg": ("mahony_marg", "vqf_9d", "ekf"), "tilt": ("tilt",),
              "ecompass": ("ecompass",)}  # fmt: skip


@pytest.mark.parametrize(("words", "before", "after", "kinds"), MISTAKES, ids=[words for words, *_ in MISTAKES])
def test_a_mistake_is_caught_and_named(words, before, after, kinds):
    for name in (name for kind in kinds.split() for name in STANDS_FOR[kind]):
        result = self_test(mistaken(name, before or (lambda s: s), after or (lambda q: q)))
        assert not result.passed, name
        assert words in result.reason, (name, result.reason)


def test_a_filter_that_starts_from_anywhere_else_is_told_so():
    slow = mistaken("madgwick_imu", lambda s: replace(s, acc=np.vstack([[0.0, 0.0, 9.8], s.acc[1:]])))
    result = self_test(slow)
    assert not result.passed
    assert "does not find its start within 6 s" in result.reason or "cannot be told" in result.reason


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
        "        return get_filter('madgwick_imu').run(replace(samples, gyr=np.radians(samples.gyr)))\n"
    )
    runner = CliRunner()
    good = runner.invoke(app, ["filters", "--self-test", "--json", "vqf_6d", "tilt"])
    assert good.exit_code == 0
    assert json.loads(good.stdout)["passed"] is True
    bad = runner.invoke(app, ["filters", "--self-test", "--json", f"{file}:Mine"])
    assert bad.exit_code == 1
    (report,) = json.loads(bad.stdout)["filters"]
    assert "taken as deg/s" in report["reason"] and not report["passed"]
    table = runner.invoke(app, ["filters", "--self-test", f"{file}:Mine"])
    assert table.exit_code == 1 and "turn about +z" in table.stdout
    everything = runner.invoke(app, ["filters", "--self-test", "--json"])
    assert everything.exit_code == 0
    assert len(json.loads(everything.stdout)["filters"]) >= len(FILTERS) - 1
