"""What becomes of every command and snippet of the documents: the one place that says so.

Pages of docs/how_to are run whole, as scripts, and are not listed line by line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

How = Literal["quick", "long", "data", "serves", "arm", "elsewhere"]
"""quick: run by `make test`. long: run by `make long`. data: the same, where the public recordings
are there. serves: started by `make long`, until the block ends. arm: run by `make long` against
what serves. elsewhere: not run; that its command and its options exist is tested like that of all
others.
"""

EXIT_CODES = {"compare_two_firmwares": 1}
"""Of pages of docs/how_to that do not end with 0."""
LONG_PAGES = (
    "compare_two_firmwares",
    "noise_of_a_sensor",
    "phone_against_cameras",
    "tune_a_filter",
)
"""Pages of docs/how_to that take more than some seconds of a processor: `make long` runs them."""
WITH_AN_ARM = ("rehearse_a_ur",)
"""Pages of docs/how_to that drive an emulated arm by the machine's time."""


@dataclass(frozen=True)
class Kind:
    """What becomes of a command.

    Attributes:
        how: See `How`.
        code: Exit code that it ends with.
        why: Of what is not run.
    """

    how: How
    code: int = 0
    why: str = ""


@dataclass(frozen=True)
class Page:
    """Commands of a document, which are run in its order in one folder.

    Attributes:
        kinds: By how a command begins; the longest that fits counts.
        before: Script that makes what the quick ones take for granted.
        before_long: Script that makes what the others take for granted beside it.
        words: What stands for something of the reader's own, and what is put in its place.
    """

    kinds: Mapping[str, Kind]
    before: str = ""
    before_long: str = ""
    words: Mapping[str, str] = field(default_factory=dict)


QUICK, LONG, DATA = Kind("quick"), Kind("long"), Kind("data")
SERVES, ARM = Kind("serves"), Kind("arm")
REFUSED = Kind("long", 2)
SCREEN = Kind("elsewhere", why="opens a window")
HARDWARE = Kind("elsewhere", why="needs a device or an arm")
INSTALLS = Kind("elsewhere", why="changes the environment that the tests run in")
OTHERS = Kind("elsewhere", why="a program of others that is not installed")


def _run(protocol: str, name: str, options: str = "") -> str:
    """Script for a run whose session has the name that a document gives it."""
    return (
        f"mkdir -p $(dirname {name}) made; testbench run {protocol} --logs made --no-report "
        f"{options}; mv made/* {name}\n"
    )


def _broad(*trials: str) -> str:
    """Script that imports trials of BROAD, where the public recordings are there."""
    return "".join(
        f'[ -z "$TESTBENCH_DATA" ] || testbench import broad $TESTBENCH_DATA/broad/{trial}_*.mat '
        f"--out logs/broad_{trial}\n"
        for trial in trials
    )


def _each(*names: str) -> str:
    """Script for runs of the protocol quick, by the names of their sessions."""
    return "".join(_run("quick", name, f"--seed {i}") for i, name in enumerate(names, start=1))


QUICK_RUN = "logs/20261121T223000Z_quick"
ONE_RUN = _run("quick", QUICK_RUN)
ESTIMATED = f"testbench evaluate {QUICK_RUN}\n"
DOTS = "testbench example squat --out .dots\n"
DATED_DOTS = (
    DOTS + "for f in .dots/*.csv; do mv $f $(basename $f .csv)_20261121_223000_1.csv; done\n"
)
FOOT = "testbench example walk --out .walk; cp .walk/foot.csv walk.csv\n"
SIDES = "".join(
    f"testbench example sides --out .sides{n}; testbench simulate .sides{n}/board.csv --preset "
    f"xsens_dot --seed {n} --out logs/sides_{n}\n"
    for n in (1, 2)
)
MINE = "sed s/SteadyHand/MyFilter/ examples/03_a_filter_of_your_own.py > mine.py\n"
LEG = """\
python -c '
import csv, numpy as np
rows = [[float(x) for x in row] for row in list(csv.reader(open("walk.csv")))[1:]]
t, q, place = np.split(np.array(rows), [1, 5], axis=1)
poses = {f"{body}.{key}": own for body in ("thigh", "foot") for key, own in
         (("q", q), ("position_m", place))}
np.savez("leg.npz", time_s=t[:, 0], **poses)'
"""
BAND = """\
python -c '
from tests.documents.blocks import ROOT, blocks
(band,) = [own.text for own in blocks(ROOT / "docs/reports.md") if own.language == "yaml"]
open("our_patients.yaml", "w").write(band)'
"""
LABORATORY = "printf 'name: A\\naddress: B\\n' > laboratory.yaml\n"
ISSUED_BY = {
    "--pdf": "--pdf --laboratory laboratory.yaml",
    "pdf=True": 'pdf=True, laboratory="laboratory.yaml"',
}
"""Nobody has stated a laboratory where tests run."""
CUT_OFF = Kind("elsewhere", why="goes on with a run that broke off, as tests/system do")

PAGES: dict[str, Page] = {
    "README.md": Page(
        {
            "make ": INSTALLS,
            "source ": INSTALLS,
            "testbench protocols": QUICK,
            "testbench check": QUICK,
            "testbench run quick --seed 3": LONG,
            "testbench run quick --robot": LONG,
            "testbench run quick --speed realtime --view": SCREEN,
            "testbench certificate": LONG,
            "testbench sessions": QUICK,
            "testbench example": QUICK,
            "testbench compare": LONG,
            "testbench verify": QUICK,
            "testbench run --resume": Kind("quick", 2),
            "testbench emulate": SERVES,
            "testbench view": SCREEN,
            "testbench report": LONG,
            "testbench import broad": DATA,
            "testbench import xsens_dot": LONG,
            "testbench evaluate logs/broad": DATA,
            "testbench evaluate logs/walk": LONG,
            "testbench calibrate": LONG,
            "testbench noise": LONG,
            "testbench simulate": LONG,
            "testbench audit": LONG,
            "testbench design": LONG,
            "testbench gait": LONG,
            "testbench study": LONG,
            "testbench tune": DATA,
            "testbench export": DATA,
            "from testbench import estimate, evaluate": QUICK,
        },
        before=ONE_RUN,
        before_long=DATED_DOTS
        + FOOT
        + "testbench simulate walk.csv --out logs/walk\n"
        + "for n in 1 2 3; do testbench run quick --seed $n --logs logs/before --no-report; done\n"
        + "for n in 4 5 6; do testbench run quick --seed $n --logs logs/after --no-report; done\n"
        + _run("calibration_optimal", "logs/20261121T230000Z_calibration_optimal")
        + _run("static_noise", "logs/20261121T231500Z_static_noise")
        + _run("timing_audit", "logs/20261121T231500Z_timing_audit")
        + LABORATORY
        + _broad("02", "16")
        + '[ -z "$TESTBENCH_DATA" ] || ln -s $TESTBENCH_DATA/broad/05_*.mat 05_trial.mat\n',
        words=ISSUED_BY,
    ),
    "docs/calibration.md": Page(
        {"testbench ": LONG, "testbench calibrate SESSION --method ferraris": HARDWARE},
        before_long=SIDES,
        words={"SESSION": "logs/sides_1", "OTHER": "logs/sides_2"},
    ),
    "docs/certificates.md": Page(
        {
            "pip install": INSTALLS,
            "testbench certificate laboratory": Kind(
                "elsewhere", why="asks questions, which tests/records/test_laboratory.py answers"
            ),
            "testbench run static_noise": LONG,
            "testbench certificate": LONG,
            "from testbench.pipeline.certificate import": LONG,
        },
        before_long=ONE_RUN
        + _run("calibration_optimal", "logs/20261121T230000Z_calibration_optimal")
        + _run("static_noise", "logs/20261121T231500Z_static_noise")
        + LABORATORY,
        words=ISSUED_BY,
    ),
    "docs/comparing.md": Page(
        {"testbench compare": LONG},
        before_long="".join(
            f"for n in {seeds}; do testbench run quick --seed $n --logs {logs} --no-report; done\n"
            for seeds, logs in (
                ("1 2 3", "logs/firmware_1.6"),
                ("4 5 6", "logs/firmware_1.7"),
                ("7 8 9", "logs/baselines"),
            )
        )
        + _run("quick", "logs/20261201T021500Z_quick", "--seed 10")
        + "GITHUB_STEP_SUMMARY=summary.md\n",
        words={"BASE": "logs/firmware_1.6", "NEW": "logs/firmware_1.7"},
    ),
    "docs/devices.md": Page({"testbench ": HARDWARE}),
    "docs/emulator.md": Page(
        {
            "testbench emulate": SERVES,
            "testbench run": ARM,
            "echo ": Kind("elsewhere", why="a fault for the run above it; tests/emulation send it"),
        }
    ),
    "docs/exports.md": Page(
        {
            "testbench export": LONG,
            "rerun ": SCREEN,
            "ros2 ": OTHERS,
            "import pandas as pd": LONG,
        },
        before_long=ONE_RUN + ESTIMATED,
    ),
    "docs/filters.md": Page(
        {
            "testbench evaluate logs/broad": DATA,
            "testbench export logs/broad": DATA,
            "testbench filters": LONG,
            "testbench run": LONG,
            "from testbench.estimation.filters import": LONG,
        },
        before_long=MINE + _broad("05"),
    ),
    "docs/formats.md": Page(
        {
            "testbench import FORMAT": Kind("elsewhere", why="shows what an import looks like"),
            "testbench formats": QUICK,
            "testbench import xsens_dot": Kind(
                "elsewhere", why="takes files of a reference system, as tests/formats do"
            ),
            "testbench report": Kind("elsewhere", why="of the recording before it"),
            "testbench simulate": LONG,
        },
        before_long=FOOT + LEG,
    ),
    "docs/gait.md": Page(
        {"testbench ": DATA, "from testbench import GaitSettings": DATA},
        before_long='[ -z "$TESTBENCH_DATA" ] || ln -s $TESTBENCH_DATA/xio_walk/short_walk.csv .\n',
    ),
    "docs/joint_angles.md": Page({"testbench ": LONG}, before_long=DATED_DOTS),
    "docs/real_arm.md": Page(
        {
            "pip install": INSTALLS,
            "testbench run quick --arm ur --host 192.168.0.10": Kind("long", 2),
            "testbench run quick --arm ur --host 192.168.0.10 --confirm-motion": HARDWARE,
            "testbench run quick_xarm6 --arm xarm --host 192.168.1.210": Kind("long", 2),
            "testbench run quick_xarm6 --arm xarm --host 192.168.1.210 --confirm-motion": HARDWARE,
            "testbench sessions": LONG,
            "testbench recover": CUT_OFF,
            "testbench run --resume": CUT_OFF,
        },
        before_long="mkdir logs\n",
    ),
    "docs/reports.md": Page(
        {"testbench report": LONG, "from testbench import plot": LONG},
        before_long=DOTS
        + "testbench import xsens_dot .dots/*.csv --out logs/knee --joint knee=RFemur:RTibia\n"
        + ONE_RUN
        + ESTIMATED
        + BAND,
        words={"SESSION": "logs/knee"},
    ),
    "docs/session_format.md": Page(
        {
            "testbench verify": LONG,
            "testbench seal": LONG,
            "testbench recover": CUT_OFF,
            "import pandas as pd": LONG,
            "from testbench import Session": LONG,
        },
        before_long=ONE_RUN + "HOME=$PWD; mkdir ~/keys\n",
        words={"SESSION": QUICK_RUN},
    ),
    "docs/studies.md": Page(
        {
            "testbench study --list": QUICK,
            "testbench study": Kind(
                "elsewhere", why="minutes each; tests/studies and `make reproduce` run the studies"
            ),
        }
    ),
    "docs/tuning.md": Page(
        {"testbench ": LONG}, before_long=_each("logs/a", "logs/b", "logs/c", "logs/d")
    ),
    "docs/uncertainty.md": Page(
        {"testbench evaluate": LONG},
        before_long=_each("logs/20261201T013942Z_quick", "logs/a_quick"),
    ),
    "docs/viewer.md": Page(
        {
            "testbench run elbow_flexion --arm": HARDWARE,
            "testbench record": HARDWARE,
            "testbench run": SCREEN,
            "testbench view": SCREEN,
            "testbench view logs/20261121T223000Z_quick --save": LONG,
            "testbench view logs/20261121T223000Z_quick --screenshot": Kind(
                "elsewhere", why="needs a Vulkan driver; tests/reporting draw such pictures"
            ),
        },
        before_long=ONE_RUN + ESTIMATED,
    ),
    "docs/without_truth.md": Page({"testbench ": LONG}, before_long=DOTS + "mv .dots/R*.csv .\n"),
}
"""By document."""

OTHER_LANGUAGES: dict[str, str] = {
    "": "output and formulas, which nobody runs (what begins with `testbench` is a command)",
    "text": "the same, and parts of files",
    "mermaid": "a drawing",
    "yaml": "read by tests/documents/test_snippets.py",
    "sql": "for DuckDB, which is not installed",
    "matlab": "for MATLAB, which is not installed",
}
"""Languages of blocks that are no commands, and what becomes of them."""
