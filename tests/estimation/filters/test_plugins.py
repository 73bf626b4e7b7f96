"""Filters of the user's own: from a file, from an installed package, ranked beside the others,
refused where they are wrong.
"""

from __future__ import annotations

import json
import shutil
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.estimation import estimate
from testbench.estimation.filters import plugins
from testbench.estimation.filters.plugins import find_filter
from testbench.estimation.filters.self_test import self_test
from testbench.exceptions import InputError, NotFoundError
from testbench.pipeline import exports
from testbench.pipeline.kept_estimate import is_as_asked, load_or_estimate
from testbench.pipeline.loaded_analysis import load_analysis, sound_filters
from testbench.pipeline.request import ExportRequest
from testbench.records.session.session import Session
from tests.asking import analysis

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "03_a_filter_of_your_own.py"
HEAD = (
    "from testbench.estimation.filters import OrientationFilter, get_filter\nfrom "
    "testbench.model import rotation\n"
)
CLASS = HEAD + "class Mine(OrientationFilter):\n    "
BODY = "    def run(self, samples):\n        return get_filter('vqf_6d').run(samples)\n"


@pytest.fixture
def written(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "mine.py"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_the_example_passes_the_self_test_and_is_ranked_beside_the_others(quick, tmp_path):
    kind = find_filter(f"{EXAMPLE}:SteadyHand")
    assert self_test(kind).passed
    result = estimate(quick.session, ["vqf_6d", kind])
    assert list(result.sensors["arm"].orientation) == ["vqf_6d", "steady_hand"]
    assert result.filter_parameters["steady_hand"] == {"still_deg_s": 3.0, "share": 0.02}
    run = CliRunner().invoke(
        app,
        [
            "run",
            "quick",
            "--filters",
            f"{EXAMPLE}:SteadyHand,vqf_6d",
            "--logs",
            str(tmp_path),
            "--json",
        ],
    )
    (session,) = tmp_path.iterdir()
    assert run.exit_code in (0, 1), run.output
    evaluation = json.loads((session / "evaluation.json").read_text())
    assert {row["filter"] for row in evaluation["orientation"]} == {"steady_hand", "vqf_6d"}
    assert "steady_hand" in (session / "report.html").read_text(encoding="utf-8")
    again = CliRunner().invoke(
        app, ["evaluate", str(session), "--filters", f"{EXAMPLE}:SteadyHand", "--json"]
    )
    assert again.exit_code in (0, 1), again.output


def test_an_estimate_by_a_filter_from_a_file_is_never_taken_from_disk(quick, tmp_path):
    session = Session(shutil.copytree(quick.session.path, tmp_path / "quick"))
    own = analysis(f"{EXAMPLE}:SteadyHand")
    stored = load_or_estimate(session, analysis("vqf_6d"))
    assert list(stored.sensors["arm"].orientation) == ["vqf_6d"]
    made = load_or_estimate(session, own)
    assert "steady_hand" in made.sensors["arm"].orientation
    assert not is_as_asked(made, session, load_analysis(own))


def test_a_filter_with_a_wrong_unit_is_refused_before_anything_moves(written, tmp_path):
    path = written(
        HEAD
        + "import numpy as np\nfrom dataclasses import replace\nclass Mine(OrientationFilter):\n"
        "    name, needs, source = 'mine', ('gyr', 'acc'), 'me'\n    def run(self, samples):\n"
        "        return get_filter('vqf_6d').run(replace(samples, gyr=np.radians(samples.gyr)))\n"
    )
    with pytest.raises(
        InputError,
        match="the filter mine fails the self-test: rates look like they were taken as deg/s",
    ):
        CliRunner().invoke(
            app,
            ["run", "quick", "--filters", f"{path}:Mine", "--logs", str(tmp_path / "logs")],
            catch_exceptions=False,
        )
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("class Mine:\n    pass\n", "Mine", "it must be a class derived from OrientationFilter"),
        (CLASS + "name, needs, source = 'mine', (), ''\n", "Mine", "that has `run`"),
        (CLASS + "name = 'mine'\n" + BODY, "Mine", "lacks needs, source"),
        (CLASS + "name, needs, source = 'My filter', (), ''\n" + BODY, "Mine", "small letters"),
        (CLASS + "name, needs, source = 'vqf_6d', (), ''\n" + BODY, "Mine", "choose another"),
        (
            CLASS + "name, needs, source = 'm', ('gps',), ''\n" + BODY,
            "Mine",
            "needs gps; known: gyr",
        ),
        (CLASS + "name, needs, source = 'm', ('acc',), ''\n" + BODY, "Yours", "known: Mine"),
        ("def broken(:\n", "Mine", "cannot be imported: SyntaxError"),
        ("import a_package_nobody_has\n", "Mine", "cannot be imported: ModuleNotFoundError"),
        (
            CLASS + "name, needs, source = 'm', ('acc',), ''\n    def __init__(self):\n"
            "        raise ValueError('no')\n" + BODY,
            "Mine",
            "cannot be made: ValueError",
        ),
    ],
)
def test_a_file_without_a_filter_is_refused_in_a_sentence(written, text, name, words):
    with pytest.raises(InputError) as caught:
        find_filter(f"{written(text)}:{name}")
    assert words in str(caught.value)


def test_a_missing_file_and_an_unknown_name_are_refused():
    with pytest.raises(InputError, match=r"nowhere\.py: the file does not exist"):
        find_filter("nowhere.py:Mine")
    with pytest.raises(NotFoundError, match="unknown filter 'mine'; known: device"):
        find_filter("mine")


def test_an_installed_package_offers_filters_by_its_entry_point(written, monkeypatch):
    path = written(CLASS + "name, needs, source = 'mine', ('gyr', 'acc'), 'me'\n" + BODY)
    monkeypatch.syspath_prepend(str(path.parent))
    point = EntryPoint("mine", "mine:Mine", plugins.GROUP)
    missing = EntryPoint("gone", "nowhere_at_all:Gone", plugins.GROUP)
    monkeypatch.setattr(
        plugins,
        "entry_points",
        lambda group: [point, missing] if group == "testbench.filters" else [],
    )
    assert find_filter("mine").name == "mine"
    (named, own) = sound_filters(["vqf_6d", "mine"])
    assert named == "vqf_6d" and own.name == "mine"
    with pytest.raises(InputError, match="the installed filter 'gone' cannot be imported"):
        find_filter("gone")
    with pytest.raises(NotFoundError, match=r"known: .*, mine, gone"):
        find_filter("theirs")
    listed = CliRunner().invoke(app, ["filters", "--json"])
    assert json.loads(listed.stdout)["installed"] == ["gone", "mine"]
    del sys.modules["mine"]


def test_a_protocol_cannot_name_code(altered_protocol):
    from testbench import plan
    from testbench.exceptions import FileProblems

    path = altered_protocol(
        "quick",
        lambda content: content.update(estimate={"filters": [f"{EXAMPLE}:SteadyHand"]}, accept=[]),
    )
    with pytest.raises(FileProblems):
        plan(path)


def test_a_filter_of_the_users_own_can_be_exported(quick, tmp_path, monkeypatch):
    """By its file, by the name it is installed under, and by its name alone once the session's
    estimate holds it.
    """
    tested = []
    monkeypatch.setattr(
        exports, "sound", lambda kind: tested.append(kind.name) or kind
    )  # the self-test takes seconds
    session = Session(shutil.copytree(quick.session.path, tmp_path / "quick"))
    before = sorted(path.name for path in (session.path / "estimate").iterdir())

    def exported(out: str, wanted: str) -> np.ndarray:
        command = [
            "export",
            str(session.path),
            "--to",
            "parquet",
            "--out",
            str(tmp_path / out),
            "--filter",
            wanted,
        ]
        result = CliRunner().invoke(app, command, catch_exceptions=False)
        assert "orientation by: steady_hand" in result.output
        columns = [f"steady_hand_q_world_from_sensor_{axis}" for axis in "wxyz"]
        return (
            pq.read_table(tmp_path / out / "imu_arm.parquet").select(columns).to_pandas().to_numpy()
        )

    q = exported("by_file", f"{EXAMPLE}:SteadyHand")
    assert (
        sorted(path.name for path in (session.path / "estimate").iterdir()) == before
    )  # the session's own stays as it is
    alone = estimate(session, [find_filter(f"{EXAMPLE}:SteadyHand")])
    np.testing.assert_allclose(q, alone.sensors["arm"].orientation["steady_hand"], atol=1e-12)
    monkeypatch.setattr(
        plugins,
        "installed_filters",
        lambda: {"hand": EntryPoint("hand", "unused:X", plugins.GROUP)},
    )
    monkeypatch.setattr(
        EntryPoint, "load", lambda point: type(find_filter(f"{EXAMPLE}:SteadyHand"))
    )
    np.testing.assert_array_equal(exported("installed", "hand"), q)
    assert tested == ["steady_hand"] * 2
    with pytest.raises(
        NotFoundError, match=r"unknown filter 'steady_hand'; known: truth, device, .*vqf_6d"
    ):
        exports.export(
            session, ExportRequest(format="csv", out=tmp_path / "unknown", filter="steady_hand")
        )
    alone.save(session.path)
    np.testing.assert_array_equal(exported("by_name", "steady_hand"), q)
