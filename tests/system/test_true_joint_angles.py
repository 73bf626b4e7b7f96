"""Joint angles of another system as the truth of a recording, from files to errors."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from testbench import estimate, evaluate
from testbench.clock import SystemClock
from testbench.exceptions import InputError, SessionError
from testbench.formats import import_recording
from testbench.formats.exporters import ExportSource, write_export
from testbench.formats.options import Options
from testbench.formats.truth.attach import TruthOptions
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import Session
from testbench.reporting.report import render
from tests.command_line import command
from tests.formats import angle_files
from tests.reporting.test_viewer import chunks_of, column
from tests.system import walking_limb

JOINTS = """\
joints:
  knee_r: {proximal: thigh, distal: shank, definition: knee}
  ankle_r: {proximal: shank, distal: foot, definition: ankle}
alignment: {method: standing}
estimate: {filters: [vqf_6d], align: none, calibrate: none, align_clock: false}
"""
AHEAD_S = 4.25
SAME_DEG = 0.05
"""The errors against true angles are those against the true orientations, to so much."""


class Walked(NamedTuple):
    """A walk with the truth of its segments, and the same without."""

    folder: Path
    files: list[Path]
    blind: Path
    evaluation: Evaluation
    time: np.ndarray
    angles: dict[str, np.ndarray]
    mot: Path


@pytest.fixture(scope="module")
def walked(tmp_path_factory) -> Walked:
    folder = tmp_path_factory.mktemp("walk")
    mapping, files = walking_limb.export(walking_limb.walk(0, 12.0), folder / "files", JOINTS)
    session = import_recording(
        "generic", files, folder / "judged", SystemClock(), Options(str(mapping))
    )
    estimated = estimate(session)
    source = ExportSource(session, estimated, "truth")
    lines = mapping.read_text().splitlines(keepends=True)
    blind = mapping.with_name("blind.yaml")
    blind.write_text("".join(line for line in lines if not line.startswith("    truth:")))
    time = session.truth("thigh").host_time_ns
    angles = {}
    for name in ("knee_r", "ankle_r"):
        (own,) = source.true_angles(name, time).values()
        angles[name] = np.degrees(own)
    mot = write_export("mot", source, folder / "truth.mot").path
    return Walked(folder, files, blind, evaluate(session, estimated), time * 1e-9, angles, mot)


def imported(walked: Walked, name: str, truth: Path | None, more: str = "", **options) -> Session:
    """The session of the walk with a truth of angles."""
    mapping = walked.blind.with_name(f"{name}.yaml")
    mapping.write_text(walked.blind.read_text() + more)
    given = None if truth is None else TruthOptions(truth, **options)
    out, asked = walked.folder / name, Options(str(mapping))
    return import_recording("generic", walked.files, out, SystemClock(), asked, given)


def judged(
    walked: Walked, name: str, truth: Path | None, more: str = "", **options
) -> tuple[Session, Evaluation]:
    """The same with its estimate, as it is kept, and its evaluation."""
    session = imported(walked, name, truth, more, **options)
    estimate(session).save(session.path)
    return session, evaluate(session, Estimate.load(session.path))


def check(walked: Walked, found: Evaluation, angles: int = 3) -> None:
    """Errors are those against the true orientations."""
    rows = {(row.joint, row.angle): row for row in found.angle_errors}
    known = [row for row in walked.evaluation.angle_errors if (row.joint, row.angle) in rows]
    assert len(rows) == len(known) == 2 * angles
    for row in known:
        own = rows[row.joint, row.angle]
        assert own.n > 0.99 * row.n
        assert own.rmse_deg == pytest.approx(row.rmse_deg, abs=SAME_DEG)
        assert own.mean_error_deg == pytest.approx(row.mean_error_deg, abs=SAME_DEG)
        assert own.rmse_without_mean_deg == pytest.approx(row.rmse_without_mean_deg, abs=SAME_DEG)
    flexions = {row.joint: row.flexion_rmse_deg for row in walked.evaluation.joint_angle}
    assert {row.joint for row in found.joint_angle} == flexions.keys()
    for row in found.joint_angle:
        assert row.flexion_rmse_deg == pytest.approx(flexions[row.joint], abs=SAME_DEG)


@pytest.fixture(scope="module")
def told(walked) -> tuple[Session, Evaluation]:
    """Judged by true angles that began earlier."""
    return judged(walked, "told", walked.mot, offset=AHEAD_S)


def test_a_motion_file_that_began_earlier_judges_as_the_true_orientations_do(walked, told):
    session, found = told
    check(walked, found)
    clock = Estimate.load(session.path).joints["knee_r"].true_clock
    assert clock.offset_s == pytest.approx(-AHEAD_S, abs=2e-3)
    report = render(session, Estimate.load(session.path), found)
    assert "Errors of knee_r by angle" in report and "RMS e - mean" in report
    content = json.loads(json.dumps(found.to_dict()))
    assert {"mean_error_deg", "rmse_without_mean_deg"} <= content["angle_errors"][0].keys()


def test_angles_in_a_c3d_judge_likewise(walked):
    pytest.importorskip("ezc3d")
    points = {"RKneeAngles": walked.angles["knee_r"], "Foot": walked.angles["ankle_r"]}
    file = angle_files.write_c3d(walked.folder / "walk.c3d", walking_limb.RATE, points)
    stated = {"knee_r": "RKneeAngles", "ankle_r": "Foot"}
    check(walked, judged(walked, "c3d", file, angles=stated)[1])


def write_angles(walked: Walked, name: str, lost: slice | None = None) -> None:
    """A table of both flexions on the clock of the samples' files, some rows of it empty."""
    rows = np.column_stack(
        [
            walking_limb.BEGAN_S + walked.time + 1 / walking_limb.RATE,
            walked.angles["knee_r"][:, 0],
            -walked.angles["ankle_r"][:, 0],
        ]
    )
    text = [",".join(f"{value:.6f}" for value in row) for row in rows]
    for i in range(*lost.indices(len(text))) if lost else ():
        text[i] = text[i].split(",")[0] + ",,"
    path = walked.blind.with_name(name)
    path.write_text("\n".join(["t,knee bend,foot drop", *text]) + "\n")


ANGLES = """\
truth_angles:
  file: {file}
  time: {{column: t, unit: s}}
  unit: deg
  same_clock: {same}
  joints:
    knee_r: {{flexion: knee bend}}
    ankle_r: {{dorsiflexion: -foot drop}}
"""


def test_columns_of_a_mapping_judge_the_angle_that_they_are(walked):
    write_angles(walked, "angles.csv")
    more = ANGLES.format(file="angles.csv", same="false")
    session, found = judged(walked, "csv", None, more)
    check(walked, found, angles=1)
    assert not session.manifest.true_angles["knee_r"].same_clock
    assert not [row for row in found.ranking if row.sequence is None]  # of one angle: no total
    assert "Errors of ankle_r by angle" in render(session, Estimate.load(session.path), found)


def test_empty_rows_on_the_clock_of_the_samples_are_not_judged(walked):
    write_angles(walked, "gappy.csv", slice(300, 420))
    more = ANGLES.format(file="gappy.csv", same="true")
    session, found = judged(walked, "gappy", None, more)
    assert session.manifest.true_angles["knee_r"].same_clock
    whole = {(row.joint, row.angle): row for row in walked.evaluation.angle_errors}
    assert len(found.angle_errors) == 2
    for row in found.angle_errors:
        known = whole[row.joint, row.angle]
        assert 120 <= known.n - row.n <= 122
        assert row.mean_error_deg == pytest.approx(known.mean_error_deg, abs=0.3)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("unit: deg", "unit: gon"), "unit"),
        (("foot drop", "foot dropped"), "unknown column of the truth"),
        (("ankle_r:", "hip_r:"), "unknown joint of this recording"),
        (("angles.csv", "angels.csv"), "does not exist"),
        (("  time: {column: t, unit: s}\n", ""), "either time or rate_hz"),
    ],
)
def test_a_mapping_that_does_not_fit_ends_in_a_sentence_and_exit_code_2(
    walked, tmp_path, capsys, more, message
):
    write_angles(walked, "angles.csv")
    mapping = walked.blind.with_name("odd.yaml")
    text = ANGLES.format(file="angles.csv", same="true").replace(*more)
    mapping.write_text(walked.blind.read_text() + text)
    arguments = ["import", "generic", *walked.files, "--mapping", mapping]
    assert command(*arguments, "--out", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert message in said and "Traceback" not in said and not (tmp_path / "out").exists()


def test_the_command_line_names_the_columns_and_says_what_is_wrong(walked, tmp_path, capsys):
    arguments = ["import", "generic", *walked.files, "--mapping", walked.blind]
    arguments += ["--out", tmp_path / "out", "--truth", walked.mot]
    for wrong, message in (
        ("knee_r.flexion", "write it as JOINT.ANGLE=COLUMN"),
        ("knee_r.flexion=knee_angle", "known: hip"),
        ("knee.flexion=knee_angle_r", "known: knee_r, ankle_r"),
    ):
        assert command(*arguments, "--truth-angle", wrong) == 2
        said = capsys.readouterr().err
        assert "Traceback" not in said
        assert message.replace("hip", "knee_angle_r") in said
    assert command(*arguments, "--truth-angle", "knee_r.flexion=-knee_angle_r") == 0
    assert "its truth is" in capsys.readouterr().out
    assert command("evaluate", tmp_path / "out") == 0
    said = capsys.readouterr().out
    assert "runs against the estimate" in said and "Errors by angle" in said
    shutil.rmtree(tmp_path / "out")


def test_a_truth_of_another_person_judges_nothing(walked):
    other = walking_limb.walk(7, 12.0)
    shank = np.random.default_rng(1).standard_normal(len(other.time)).cumsum()
    file = angle_files.write_mot(
        walked.folder / "other.mot", other.time, {"knee_angle_r": 40 * np.sin(shank / 10)}
    )
    session, found = judged(walked, "other", file)
    assert not found.joint_angle and not found.angle_errors
    codes = {own.code for own in found.findings}
    assert {"clock.no_common_motion", "judged.angles_not_aligned", "judged.nothing"} <= codes
    assert isinstance(render(session, Estimate.load(session.path), found), str)


def test_radians_where_the_file_says_degrees_are_named_beside_their_errors(walked):
    radians = {"knee_angle_r": np.radians(walked.angles["knee_r"][:, 0])}
    file = angle_files.write_mot(walked.folder / "radians.mot", walked.time, radians)
    _, found = judged(walked, "radians", file)
    (said,) = [own for own in found.findings if own.code == "truth.angle_unit"]
    assert said.values["factor"] == pytest.approx(57.3, abs=0.1)
    assert "clock.no_common_motion" not in {own.code for own in found.findings}


def test_exports_hold_the_true_angles_beside_the_estimated_ones(walked, told, tmp_path):
    session, _ = told
    source = ExportSource(session, Estimate.load(session.path))
    time = source.estimate.joints["knee_r"].host_time_ns
    write_export("csv", source, tmp_path / "csv")
    table = np.genfromtxt(tmp_path / "csv" / "joint_knee_r.csv", delimiter=",", names=True)
    found = np.degrees(table["true_isb_knee_flexion_rad"])
    known = np.isfinite(found)
    assert known.mean() > 0.95
    wanted = np.interp(1e-9 * time, walked.time, walked.angles["knee_r"][:, 0])
    np.testing.assert_allclose(found[known], wanted[known], atol=0.3)
    true = ExportSource(session, source.estimate, "truth")
    write_export("mot", true, tmp_path / "true.mot")
    again = np.genfromtxt(tmp_path / "true.mot", skip_header=9, names=True)
    knee = np.interp(again["time"] + 1e-9 * time[0], walked.time, walked.angles["knee_r"][:, 0])
    np.testing.assert_allclose(again["knee_angle_r"], knee, atol=0.3)
    with pytest.raises(InputError, match="nobody knows the true orientation of sensor"):
        write_export("sto", true, tmp_path / "true.sto")


def test_the_viewer_draws_the_true_flexion(walked, told, tmp_path):
    session, found = told
    found.save(session.path)
    assert command("view", session.path, "--save", tmp_path / "walk.rrd") == 0
    chunks = chunks_of(tmp_path / "walk.rrd")
    drawn = column(chunks, "/joints/knee_r/isb_knee/flexion", "Scalars:scalars")
    true = np.array([row[0] for row in drawn])  # before the filters
    known = true[np.isfinite(true)]
    assert len(known) > 0.9 * len(drawn) > 100  # a line is thinned
    flexion = walked.angles["knee_r"][:, 0]
    assert known.max() == pytest.approx(flexion.max(), abs=2.0)
    assert known.min() == pytest.approx(flexion.min(), abs=2.0)


def test_a_filter_is_tuned_by_true_angles_of_joints(told, tmp_path, capsys):
    session, evaluation = told
    words = ["tune", session.path, "--filter", "vqf_6d", "--parameters", "tau_acc_s", "--points", 3]
    words += ["--values", 3, "--no-refinement", "--out", tmp_path / "best.json"]
    assert command(*words) == 2
    assert "--objective flexion_rmse_deg" in capsys.readouterr().err
    assert command(*words, "--objective", "knee_r.flexion_rmse_deg") == 0
    found = json.loads((tmp_path / "best.json").read_text())
    rows = evaluation.joint_angle
    (untuned,) = (row.flexion_rmse_deg for row in rows if row.joint == "knee_r")
    assert 0 < found["value"] < untuned + 1e-3


def test_a_session_that_lost_its_true_angles_is_damaged(walked):
    session = imported(walked, "lost", walked.mot)
    (session.path / "angles_knee_r.parquet").unlink()
    with pytest.raises(SessionError, match=r"angles_knee_r\.parquet is missing"):
        Session(session.path).true_angles("knee_r")
