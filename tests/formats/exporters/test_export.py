"""What an export may write over, what it leaves behind when it fails, and what the command says."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from scipy.io import loadmat

from testbench.estimation import estimate
from testbench.exceptions import InputError, NotFoundError, StorageError
from testbench.formats.exporters import EXPORTS, ExportSource, prepare_export, write_export
from testbench.formats.exporters.settings import doubtful_notes
from testbench.pipeline.exports import export
from testbench.pipeline.request import ExportRequest
from testbench.records.session.session import Session
from testbench.reporting.viewer import save_recording
from tests.processes import bench
from tests.reporting.test_viewer import chunks_of

FILES = [name for name, kind in EXPORTS.items() if kind.suffix]


def everything(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.mark.parametrize("name", EXPORTS)
def test_every_format_is_written_into_the_session_and_nothing_else_changes(name, own_session):
    before = everything(own_session.path)
    result = export(own_session, ExportRequest(format=name))
    assert result.path.exists()
    assert result.path.parent == own_session.path / "export"
    new = [path for path in everything(own_session.path) if path not in before]
    assert [
        path for path in new if not path.startswith(str(result.path.relative_to(own_session.path)))
    ] == ["export"]
    with pytest.raises(InputError, match=r"exists; --force replaces it"):
        export(own_session, ExportRequest(format=name))
    export(own_session, ExportRequest(format=name, force=True))
    assert [path for path in everything(own_session.path) if path not in before] == new


def ran_with(path: Path) -> str:
    """What an export says of the parameters of `madgwick_imu`."""
    if path.is_dir():
        return json.loads((path / "export.json").read_text())["parameters"]["madgwick_imu"]
    if path.suffix == ".mcap":
        with path.open("rb") as file:
            (found,) = make_reader(file).iter_metadata()
        return found.metadata["parameters"]
    if path.suffix == ".mat":
        return str(loadmat(path, simplify_cells=True)["session"]["parameters"])
    header = path.read_text().split("endheader")[0].splitlines()
    return next(line for line in header if line.startswith("parameters="))


@pytest.mark.parametrize("name", [name for name in EXPORTS if name != "rrd"])
def test_an_export_names_the_parameters_that_its_filters_ran_with(name, source, tmp_path):
    """Also those of a stored estimate that was made with others than the protocol's."""
    made = estimate(source.session, ["madgwick_imu"], parameters={"madgwick_imu": {"beta": 0.125}})
    own = ExportSource(source.session, made, "madgwick_imu")
    path = prepare_export(name, source.session, tmp_path / f"x{EXPORTS[name].suffix}", False)
    result = write_export(name, own, path)
    assert "beta: 0.125 (set)" in ran_with(result.path)
    assert "filter 'madgwick_imu' ran with parameters that were set: beta = 0.125" in result.notes


def test_an_export_of_the_protocols_own_parameters_has_no_note_on_them(source, tmp_path):
    result = write_export("csv", source, tmp_path / "csv")
    assert not [note for note in result.notes if "parameters" in note]


def test_missing_folders_above_an_export_are_made(own_session, tmp_path):
    assert export(
        own_session, ExportRequest(format="mot", out=tmp_path / "thesis" / "figures" / "elbow.mot")
    ).path.is_file()
    (tmp_path / "taken").write_text("")
    with pytest.raises(
        InputError, match=r"elbow\.mot cannot be written: (Not a directory|File exists)"
    ):
        export(own_session, ExportRequest(format="mot", out=tmp_path / "taken" / "elbow.mot"))


@pytest.mark.parametrize(
    "name", [name for name in EXPORTS if name not in {"mat", "rrd"}]
)  # these hold the date of writing
def test_the_same_session_gives_the_same_bytes(name, source, tmp_path):
    paths = [
        prepare_export(name, source.session, tmp_path / f"{i}{EXPORTS[name].suffix}", False)
        for i in range(2)
    ]
    for path in paths:
        write_export(name, source, path)
    first, second = [sorted(path.iterdir()) if path.is_dir() else [path] for path in paths]
    assert [file.read_bytes() for file in first] == [file.read_bytes() for file in second]


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_that_fails_half_way_leaves_nothing(name, source, tmp_path):
    kind = EXPORTS[name]
    path = tmp_path / f"out{kind.suffix}"

    def failing(own: ExportSource, partial: Path) -> list[str]:
        (partial / "table" if kind.is_folder else partial).write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(StorageError, match=r"out.* cannot be written: there is no room left"):
        write_export(name, source, path, failing)
    assert everything(tmp_path) == []


@pytest.mark.parametrize("name", ["sto", "csv"])
def test_an_export_that_fails_leaves_the_earlier_one(name, source, tmp_path):
    path = tmp_path / f"out{EXPORTS[name].suffix}"
    write_export(name, source, path)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}

    def failing(own: ExportSource, partial: Path) -> list[str]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_export(name, source, path, failing)
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


def test_a_place_that_cannot_be_written_to_is_one_message(source, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(
        InputError, match=r"out.sto cannot be written: (Not a directory|File exists)"
    ):
        write_export("sto", source, tmp_path / "file" / "out.sto")


def test_a_folder_that_is_no_export_is_never_replaced(own_session, tmp_path):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.txt").write_text("years of work")
    with pytest.raises(InputError, match="is not an earlier export"):
        export(own_session, ExportRequest(format="csv", out=tmp_path / "thesis", force=True))
    assert (tmp_path / "thesis" / "chapter.txt").read_text() == "years of work"


@pytest.mark.parametrize(
    "name", ["manifest.json", "imu_arm.parquet", "estimate", "evaluation.json", ".", ".."]
)
@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_the_recording_is_never_written_over(name, to, own_session):
    before = everything(own_session.path)
    with pytest.raises(InputError):
        export(own_session, ExportRequest(format=to, out=own_session.path / name, force=True))
    assert everything(own_session.path) == before


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_another_ending_is_refused(name, own_session, tmp_path):
    with pytest.raises(InputError, match=rf"must end in {EXPORTS[name].suffix}"):
        export(own_session, ExportRequest(format=name, out=tmp_path / "out.txt"))


def test_a_folder_of_tables_does_not_take_the_name_of_a_file(own_session, tmp_path):
    with pytest.raises(InputError, match="a folder of several tables"):
        export(own_session, ExportRequest(format="csv", out=tmp_path / "out.csv"))
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="is a file"):
        export(own_session, ExportRequest(format="csv", out=tmp_path / "taken", force=True))
    (tmp_path / "taken.sto").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        export(own_session, ExportRequest(format="sto", out=tmp_path / "taken.sto", force=True))


def test_unknown_formats_and_filters_are_answered_with_those_that_exist(own_session):
    with pytest.raises(
        NotFoundError, match="unknown export format 'xlsx'; known: csv, parquet, mcap"
    ):
        export(own_session, ExportRequest(format="xlsx"))
    with pytest.raises(NotFoundError, match="vqf_6d"):
        export(own_session, ExportRequest(format="sto", filter="kalman9000"))
    assert not (own_session.path / "export").exists()


def test_options_that_a_format_has_no_use_for_are_refused(own_session):
    with pytest.raises(InputError, match="shows every filter"):
        export(own_session, ExportRequest(format="rrd", filter="vqf_6d"))
    for name in [name for name in EXPORTS if name != "sto"]:
        with pytest.raises(InputError, match="--frame is for exports to sto"):
            export(own_session, ExportRequest(format=name, frame="world"))


def test_a_filter_that_the_session_did_not_run_is_run_beside_what_it_keeps(own_session, tmp_path):
    before = (own_session.path / "estimate" / "estimate.json").read_bytes()
    result = export(
        own_session, ExportRequest(format="sto", out=tmp_path / "out.sto", filter="madgwick_imu")
    )
    assert result.filters == ["madgwick_imu"]
    assert "filter=madgwick_imu" in result.path.read_text()
    assert (own_session.path / "estimate" / "estimate.json").read_bytes() == before


def test_a_filter_that_could_not_run_says_why(imported, tmp_path):
    with pytest.raises(
        InputError,
        match=r"no orientation of sensor 'imu' by filter 'vqf_9d': the sensor gives no mag",
    ):
        export(imported, ExportRequest(format="sto", out=tmp_path / "out.sto", filter="vqf_9d"))
    assert everything(tmp_path) == []


def test_without_mcap_the_message_names_the_extra(own_session, monkeypatch):
    for name in ("mcap", "mcap.writer"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "testbench.formats.exporters.mcap_file", raising=False)
    with pytest.raises(
        InputError,
        match=r"extra 'mcap', which is not installed: .* pip install 'imu-testbench\[mcap\]'",
    ):
        export(own_session, ExportRequest(format="mcap"))


def test_rrd_is_what_the_viewer_saves(quick, own_session, tmp_path):
    path = export(own_session, ExportRequest(format="rrd", out=tmp_path / "out.rrd")).path
    saved = save_recording(own_session, tmp_path / "saved.rrd", quick.estimate, quick.evaluation)
    entities = [sorted({chunk.entity_path for chunk in chunks_of(file)}) for file in (path, saved)]
    assert entities[0] == entities[1]


def test_the_command_prints_one_json_object_and_refuses_with_exit_code_2(own_session, tmp_path):
    out = tmp_path / "out.mot"
    done = bench(
        "export", own_session.path, "--to", "mot", "--out", out, "--filter", "vqf_6d", "--json"
    )
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    assert printed == {
        "session": str(own_session.path),
        "format": "mot",
        "file": str(out),
        "filters": ["vqf_6d"],
        "notes": [],
    }
    refused = bench("export", own_session.path, "--to", "mot", "--out", out)
    assert refused.returncode == 2
    assert (
        refused.stderr.startswith("error: ")
        and "--force" in refused.stderr
        and "Traceback" not in refused.stderr
    )


def test_a_session_that_was_cut_off_is_refused(own_session):
    (own_session.path / "arm.arrows").write_bytes(b"")
    with pytest.raises(InputError, match="cut off"):
        export(Session(own_session.path), ExportRequest(format="csv", filter="madgwick_imu"))


def test_orientations_of_refused_samples_are_told(quick):
    """They are in the file as the filter gave them, and may be far off after a gap."""
    name, own = next(iter(quick.estimate.sensors.items()))
    flagged = np.arange(len(own.flagged)) >= 100
    lost = replace(own, flagged=flagged, quality={"after a gap": int(flagged.sum())})
    sensors = quick.estimate.sensors | {name: lost}
    source = SimpleNamespace(
        sensor_names=list(sensors), estimate=replace(quick.estimate, sensors=sensors)
    )
    (note,) = doubtful_notes(source)
    assert note.startswith(f"{name}: {int(flagged.sum())} of {len(flagged)} orientations")
    assert "after a gap" in note
