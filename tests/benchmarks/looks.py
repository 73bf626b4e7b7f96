"""How pages of shipped protocols and studies, and of recordings of DOTs and BROAD, look: at 1300
and 420 px, in the dark and on paper. Pictures are left in build/looks/.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from testbench.clock import SystemClock
from testbench.pipeline.analyse import analyse
from testbench.pipeline.bring_in import bring_in
from testbench.pipeline.calibrate import calibrate
from testbench.pipeline.request import (
    AnalysisRequest,
    BodyRequest,
    CalibrationRequest,
    ImportRequest,
    Request,
    RunRequest,
    StudyRequest,
)
from testbench.pipeline.run import run
from testbench.records.specs.shipped import shipped_folder, shipped_names
from testbench.studies import STUDIES, get_study
from testbench.studies.bench import StudyBench
from tests.benchmarks.resuming import ROOT, count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.reporting.looking import DARK, axe_source, is_blank, look, picture, printed_pages

PICTURES = ROOT / "build" / "looks"
FIRST_FIGURE = 900
LARGEST_MB = 6.0
MOST_SHEETS = {"protocol quick": 6}


def _of_protocol(name: str, folder: Path) -> Path:
    asked = Request(run=RunRequest(protocol=name, logs=str(folder), seed=1))
    return _there(run(asked).report)


def _of_calibration(folder: Path) -> Path:
    asked = Request(
        run=RunRequest(protocol="calibration_optimal", logs=str(folder)),
        analysis=AnalysisRequest(report=False),
    )
    return _there(calibrate(run(asked).session, CalibrationRequest(out=str(folder))).report)


def _of_study(name: str, folder: Path) -> Path:
    asked = StudyRequest(name=name, parts=1, logs=str(folder))
    return get_study(name).keep(StudyBench.of(asked, SystemClock())).report


def _of_dots(data: Path, folder: Path) -> Path:
    files = tuple(map(str, sorted(data.glob("xsens_dot/*.csv"))))
    joints = BodyRequest(joints=("knee=RFemur:RTibia", "hip=Pelvis:RFemur"))
    asked = ImportRequest(format="xsens_dot", files=files, out=str(folder / "dots"), body=joints)
    return _there(analyse(bring_in(asked), AnalysisRequest(band="gait_boys")).report)


def _of_broad(data: Path, folder: Path) -> Path:
    file = str(next(data.glob("broad/05_*.mat")))
    asked = ImportRequest(format="broad", files=(file,), out=str(folder / "broad"))
    return _there(analyse(bring_in(asked)).report)


def _there(page: Path | None) -> Path:
    assert page is not None
    return page


def pages() -> dict[str, Callable[[Path], Path]]:
    """What makes each page, by what it is of; those of recordings where these are there."""
    protocols = shipped_names(shipped_folder("protocols"))
    first = ["quick", "elbow_dynamic", "gait", "elbow_flexion"]
    ordered = [*first, *(name for name in protocols if name not in first)]
    made: dict[str, Callable[[Path], Path]] = {
        f"protocol {name}": partial(_of_protocol, name) for name in ordered
    }
    data = os.environ.get("TESTBENCH_DATA")
    if data:
        made["recording of DOTs"] = partial(_of_dots, Path(data))
        made["recording of BROAD"] = partial(_of_broad, Path(data))
    made["calibration"] = _of_calibration
    same = {"reference-2": "beta_zeta", "reference-3": "gimvebo"}
    return made | {f"study {n}": partial(_of_study, n) for n in STUDIES if n not in same.values()}


def bench_looks(count: int | None = None) -> bool:
    """Print what is wrong with each page; whether nothing is."""
    names = list(pages())[:count]
    found = resumed("looks", len(names), _trials)
    rows: list[list[str | Text]] = [
        [
            Text(one["page"]),
            f"{one['mb']:.1f}",
            "-" if one["first_figure"] is None else f"{one['first_figure']:.0f}",
            f"{one['sheets']}",
            Text("; ".join(one["faults"])[:200] or "none"),
        ]
        for one in found
    ]
    faulty = sum(bool(one["faults"]) for one in found)
    show(
        "Pages in a window, on a phone, in the dark and on paper",
        ["page", "MB", "first figure [px]", "sheets", "faults"],
        rows,
        f"{faulty} of {len(found)} have faults; pictures in {PICTURES.relative_to(ROOT)}",
    )
    return not faulty


def _trials(numbers: range) -> Iterator[dict[str, Any]]:
    made = list(pages().items())
    PICTURES.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        name, make = made[number]
        with tempfile.TemporaryDirectory() as folder:
            yield examined(name, make(Path(folder) / "logs"), Path(folder), PICTURES)


def examined(name: str, page: Path, folder: Path, pictures: Path) -> dict[str, Any]:
    """What is wrong with a page, and its numbers.

    Args:
        name: Of what it is.
        page: The file.
        folder: For what a browser needs.
        pictures: Where its screenshots are left.
    """
    file = name.replace(" ", "_")
    faults: list[str] = []
    first: float | None = None
    axe = axe_source()
    for words, width, flags in (("wide", 1300, ()), ("phone", 420, ()), ("dark", 1300, (DARK,))):
        looked = look(page, folder, width, *flags, axe=axe if width > 500 else None)
        faults += [f"{words}: {fault}" for fault in looked.faults]
        if words == "wide":
            first = looked.first_figure
        pixels = picture(page, pictures / f"{file}_{words}.png", folder, (width, 2400), *flags)
        faults += [f"{words}: blank"] if is_blank(pixels) else []
    sheets = printed_pages(page, pictures / f"{file}.pdf", folder)
    size = page.stat().st_size / 1e6
    faults += ["the first figure is too far down"] if (first or 0.0) > FIRST_FIGURE else []
    faults += [f"{size:.1f} MB"] if size >= LARGEST_MB else []
    faults += [f"{sheets} sheets"] if sheets > MOST_SHEETS.get(name, sheets) else []
    return {"page": name, "mb": size, "first_figure": first, "sheets": sheets, "faults": faults}


if __name__ == "__main__":
    sys.exit(not bench_looks(count_of(len(pages()), __doc__)))
