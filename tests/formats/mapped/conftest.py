"""Files and mappings, and how they become a session."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.records.session.session import Session


@pytest.fixture
def load(tmp_path, clock):
    def read(mapping: str, *files, **options) -> Session:
        (tmp_path / "map.yaml").write_text(mapping, encoding="utf-8")
        out = tmp_path / f"session{len(list(tmp_path.glob('session*')))}"
        asked = Options(str(tmp_path / "map.yaml"), **options)
        return import_recording("generic", list(files), out, clock, asked)

    return read


@pytest.fixture
def plain(table, xyz):
    """A file with the columns that PLAIN names, in any units and layout."""

    def write(
        m, name: str = "data.csv", acc: float = 1.0, gyr: float = 1.0, more=None, **layout
    ) -> Path:
        columns = (
            {"t": m.t}
            | xyz("a{}", m.acc / acc, "xyz")
            | xyz("w{}", m.gyr / gyr, "xyz")
            | (more or {})
        )
        return table(name, columns, **layout)

    return write


@pytest.fixture
def phone(table, xyz):
    """The files of a phone: accelerometer, and a gyroscope some milliseconds off."""

    def write(m, folder="", late=0.004, acc_every=1, gyr_every=1):
        shifted = np.stack([np.interp(m.t + late, m.t, column) for column in m.gyr.T], axis=1)
        acc = {"t": m.t[::acc_every]} | xyz("{}", m.acc[::acc_every], "xyz")
        gyr = {"t": (m.t + late)[::gyr_every]} | xyz("{}", shifted[::gyr_every], "xyz")
        return [table(f"{folder}Acc.csv", acc), table(f"{folder}Gyr.csv", gyr)]

    return write
