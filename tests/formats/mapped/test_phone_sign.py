"""The sign of a phone's accelerometer: an iPhone writes the opposite of the force, which gravity
against the gyroscope does not show. A file beside the samples tells it, or a magnetometer, or
it is said that nothing does.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from testbench.formats import import_recording
from testbench.formats.options import Options
from tests.told import codes

METADATA = {
    "version": 3,
    "device name": "a phone",
    "recording epoch time": 1_700_000_000_000,
    "platform": "ios",
    "appVersion": "1.50",
    "device id": "ABC",
    "sampleRateMs": "10|10|10",
    "standardisation": "false",
}


@pytest.fixture
def folder(motion, tmp_path):
    """Writes a folder as the app does, by pandas: what is read, the sign, the metadata."""

    def write(sign: float, mag: bool = False, **metadata) -> tuple[Path, object]:
        m, where = motion(2400), tmp_path / "recording"
        where.mkdir()
        time = 1_700_000_000_000_000_000 + (m.t * 1e9).round().astype(np.int64)
        # the field of a place in the north: 45 uT, 60 deg down
        field = sign_of_field(m.q) if mag else None
        for kind, values in (
            ("TotalAcceleration", sign * m.acc),
            ("Gravity", sign * m.acc),
            ("Gyroscope", m.gyr),
            ("Magnetometer", field),
        ):
            if values is not None:
                table = pd.DataFrame({"time": time, "seconds_elapsed": m.t})
                for axis, column in zip("zyx", values.T[::-1], strict=True):
                    table[axis] = column
                table.to_csv(where / f"{kind}.csv", index=False)
        if metadata:
            pd.DataFrame([METADATA | metadata]).to_csv(where / "Metadata.csv", index=False)
        return where, m

    return write


def sign_of_field(q: np.ndarray) -> np.ndarray:
    """By scipy: the field in the sensor's axes, shape (n, 3) [uT]."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_quat(q, scalar_first=True)
    field = 45.0 * np.array([0.0, np.cos(np.pi / 3), -np.sin(np.pi / 3)])
    return turned.inv().apply(field) + 0.2 * np.random.default_rng(0).standard_normal((len(q), 3))


def brought_in(where: Path, tmp_path: Path, clock, **answers):
    asked = Options("sensor_logger", **answers)
    return import_recording("generic", [where], tmp_path / "s", clock, asked)


@pytest.mark.parametrize("told", ["false", "False", "FALSE"])
def test_the_opposite_sign_of_an_iphone_is_mended_by_its_metadata(folder, tmp_path, clock, told):
    where, m = folder(-1.0, platform="ios", standardisation=told)
    session = brought_in(where, tmp_path, clock)
    np.testing.assert_allclose(session.imu("phone").acc[2:-2], m.acc[2:-2], atol=0.02)
    assert "structure.negated" in codes(session)
    assert "structure.sign_open" not in codes(session)


@pytest.mark.parametrize(
    "said", [{"platform": "android"}, {"platform": "ios", "standardisation": "true"}]
)
def test_other_phones_are_left_as_they_are(folder, tmp_path, clock, said):
    where, m = folder(1.0, **said)
    session = brought_in(where, tmp_path, clock)
    np.testing.assert_allclose(session.imu("phone").acc[2:-2], m.acc[2:-2], atol=0.02)
    assert not {"structure.negated", "structure.sign_open"} & codes(session)


def test_where_nothing_tells_the_sign_that_is_said_with_what_would(folder, tmp_path, clock):
    where, _ = folder(-1.0)
    (told,) = (
        own
        for own in brought_in(where, tmp_path, clock).manifest.findings
        if own.code == "structure.sign_open"
    )
    assert "--hemisphere" in told.remedy and "acc.scale: -1" in told.remedy


@pytest.mark.parametrize(
    ("hemisphere", "sign", "named"),
    [
        ("north", -1.0, True),
        ("north", 1.0, False),
        ("south", 1.0, True),
    ],
)
def test_a_magnetometer_tells_the_sign_by_the_hemisphere(
    folder, tmp_path, clock, hemisphere, sign, named
):
    where, _ = folder(sign, mag=True)
    session = brought_in(where, tmp_path, clock, hemisphere=hemisphere)
    assert ("consistency.acc_or_mag_negated" in codes(session)) is named
    assert session.manifest.sensors["phone"].hemisphere == hemisphere
    assert "structure.sign_open" not in codes(session)
