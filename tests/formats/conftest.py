"""A sensor that was turned by hand, as every format would have written it down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

G = 9.80665


@dataclass(frozen=True)
class Motion:
    """Rest, then turns about all axes, then rest; in SI units, with hardly any noise.

    Attributes:
        t: [s].
        q: q_earth_from_sensor, w first.
        gyr: In the sensor frame; mag in uT.
        acc: In the sensor frame; mag in uT.
        mag: In the sensor frame; mag in uT.
    """

    t: np.ndarray
    q: np.ndarray
    gyr: np.ndarray
    acc: np.ndarray
    mag: np.ndarray


@cache
def turned(n: int = 600, rate: float = 100.0) -> Motion:
    t = np.arange(n) / rate
    moving = np.clip((t - 1.5) / 0.5, 0, 1) * np.clip((t[-1] - 1.5 - t) / 0.5, 0, 1)
    gyr = moving[:, None] * np.stack(
        [1.1 * np.sin(2.1 * t), 0.8 * np.sin(1.3 * t + 1), 0.9 * np.cos(1.7 * t)], axis=1
    )
    rotation = Rotation.from_euler("ZYX", [40, 10, -15], degrees=True)
    orientations = []
    for rate_now in gyr:
        orientations.append(rotation)
        rotation = rotation * Rotation.from_rotvec(rate_now / rate)
    whole = Rotation.concatenate(orientations)
    down = whole.inv()
    rng = np.random.default_rng(1)  # a sensor that lives never reads the same twice
    columns = (
        t,
        whole.as_quat(scalar_first=True),
        gyr + rng.normal(0, 1e-7, gyr.shape),
        down.apply([0, 0, G]) + rng.normal(0, 1e-6, gyr.shape),
        down.apply([0.0, 24.0, -39.0]),
    )
    for column in columns:
        column.setflags(write=False)  # all tests have the same
    return Motion(*columns)


@pytest.fixture(scope="session")
def motion() -> Callable[..., Motion]:
    return turned


Writer = Callable[..., Path]


def table_in(folder: Path) -> Writer:
    """Writes titles and columns as text in a folder, and gives the path."""

    def text_of(value: object, form: str) -> str:
        return str(value) if isinstance(value, str | int | np.integer) else form % value

    def write(
        name: str,
        columns: dict[str, np.ndarray],
        above: str = "",
        separator: str = ",",
        below: str = "",
        form: str = "%.9g",
        decimal: str = ".",
    ) -> Path:
        texts = [[text_of(value, form) for value in values] for values in columns.values()]
        lines = [separator.join(row) for row in zip(*texts, strict=True)]
        text = (
            above
            + separator.join(columns)
            + "\n"
            + below
            + "\n".join(lines).replace(".", decimal)
            + "\n"
        )
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def table(tmp_path: Path) -> Writer:
    """Writes titles and columns as text, and gives the path."""
    return table_in(tmp_path)


def split_axes(pattern: str, array: np.ndarray, axes: str = "XYZ") -> dict[str, np.ndarray]:
    """Columns of vectors: split_axes("Acc_{}", array, "XYZ")."""
    return {pattern.format(axis): array[:, i] for i, axis in enumerate(axes)}


@pytest.fixture
def xyz() -> Callable[..., dict[str, np.ndarray]]:
    """Columns of vectors: xyz("Acc_{}", array, "XYZ")."""
    return split_axes
