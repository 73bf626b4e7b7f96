"""`run` and `evaluate` write summaries where they are asked for, or refuse before they begin."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from testbench.pipeline.kept_analysis import kept_analysis
from testbench.pipeline.request import AnalysisRequest
from tests.command_line import command

LIMIT = "accept: [{metric: hand.total_rmse_deg, filter: vqf_6d, min: 90}]\n"


@pytest.fixture(scope="module")
def limited(tiny: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A protocol with a limit that no filter keeps."""
    path = tmp_path_factory.mktemp("limited") / "tiny.yaml"
    path.write_text(tiny.read_text(encoding="utf-8") + LIMIT, encoding="utf-8")
    return path


def test_a_run_and_an_evaluation_write_the_same_summaries(limited, tmp_path) -> None:
    logs = tmp_path / "logs"
    files = [tmp_path / name for name in ("run.md", "run.xml", "again.md", "again.xml")]
    options = [["--markdown", str(files[i]), "--junit", str(files[i + 1])] for i in (0, 2)]
    assert command("run", limited, "--logs", logs, "--no-report", *options[0]) == 1
    (session,) = logs.iterdir()
    assert command("evaluate", session, *options[1]) == 1
    run_md, run_xml, again_md, again_xml = (file.read_text(encoding="utf-8") for file in files)
    assert run_md == again_md
    assert run_xml == again_xml
    assert run_md.startswith("### tiny: fail")
    (failure,) = ElementTree.fromstring(run_xml).iter("failure")
    assert "limit at least 90 deg: fail" in failure.get("message", "")


def test_a_summary_without_a_folder_is_refused_before_anything_moves(tiny, tmp_path) -> None:
    logs, file = tmp_path / "logs", tmp_path / "no" / "summary.md"
    assert command("run", tiny, "--logs", logs, "--markdown", file) == 2
    assert not logs.exists()


def test_a_session_does_not_keep_where_summaries_were_written() -> None:
    asked = AnalysisRequest(markdown="summary.md", junit="junit.xml", compare="device")
    assert kept_analysis(asked) == {"compare": "device"}
