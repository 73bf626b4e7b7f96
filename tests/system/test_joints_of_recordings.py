"""Joints between the sensors of a recording: from files to angles, figure and export."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbench import estimate, evaluate
from testbench.clock import SystemClock
from testbench.exceptions import InputError, NotFoundError, SessionError
from testbench.formats import import_recording
from testbench.formats.exporters import ExportSource, write_export
from testbench.formats.options import Options
from testbench.model import rotation
from testbench.pipeline.bring_in import bring_in
from testbench.pipeline.request import BodyRequest, ImportRequest
from testbench.records.findings.catalogue import finding
from testbench.records.results.estimate import Estimate
from testbench.records.session.session import Session
from testbench.reporting.report import render
from tests.system import two_segments, walking_limb

JOINTS = """\
joints:
  hip_r: {proximal: pelvis, distal: thigh, definition: hip}
  knee_r: {proximal: thigh, distal: shank, definition: knee}
  ankle_r: {proximal: shank, distal: foot, definition: ankle}
  knee_axis_r: {proximal: thigh, distal: shank, definition: knee, alignment: functional}
alignment: {method: standing}
estimate: {filters: [vqf_6d, vqf_9d], align: none, calibrate: none, align_clock: false}
"""
CHAINED = {
    "hip": {0: "hip_r_flexion"},
    "knee": {0: "knee_r_flexion"},
    "ankle": {0: "ankle_r_flexion"},
}
"""Of the model, angles that are those of the ISB near the neutral pose."""


@pytest.fixture(scope="module")
def walked(tmp_path_factory) -> tuple[Session, Estimate]:
    """A person who stands and walks, with the truth of every segment."""
    folder = tmp_path_factory.mktemp("walk")
    mapping, files = walking_limb.export(walking_limb.walk(0, 10.0), folder / "files", JOINTS)
    options = Options(str(mapping))
    session = import_recording("generic", files, folder / "walk", SystemClock(), options)
    return session, estimate(session)


@pytest.mark.parametrize("joint", ["hip_r", "knee_r", "ankle_r", "knee_axis_r"])
@pytest.mark.parametrize("key", ["vqf_6d", "vqf_9d"])
def test_a_person_who_stands_and_walks_has_joint_angles_with_their_uncertainty(walked, joint, key):
    session, estimated = walked
    own, label = estimated.joints[joint], session.analysis.joints[joint].label
    true = ExportSource(session, estimated).true_angles(joint, own.host_time_ns)[label]
    error = np.degrees(rotation.wrap(own.angles[key, label] - true))
    sd = np.degrees(own.sd[key, label])
    assert np.nanmax(np.sqrt(np.nanmean(error**2, axis=0))) < 7
    assert np.nanmean(np.abs(error) < 3 * sd) > 0.95
    # across the axis of a hinge nothing but the filters is wrong while it is straight
    assert np.abs(np.nanmean(error[:100, 0])) < 7
    assert sd.min() > (0.05 if joint == "knee_axis_r" else 0.2)


def test_what_told_the_axes_and_the_headings_is_said(walked):
    _, estimated = walked
    told = {own.code: str(own) for own in estimated.joints["knee_r"].findings}
    assert "taken for standing upright" in told["joint.standing_found"]
    assert "standing_s" in told["joint.standing_found"]
    assert "the joint's centre" in told["joint.facing"]
    placed = estimated.joints["knee_axis_r"].placements["vqf_6d"]
    assert placed["thigh"].startswith("the axis of its hinge")
    assert "joint.hinge_found" in {own.code for own in estimated.joints["knee_axis_r"].findings}


def test_angles_and_uncertainties_are_kept_and_judged(walked):
    session, estimated = walked
    estimated.save(session.path)
    kept = Estimate.load(session.path).joints["knee_r"]
    own = estimated.joints["knee_r"]
    for key in own.sd:
        np.testing.assert_allclose(kept.sd[key], own.sd[key], atol=1e-6)
    assert kept.placements == own.placements
    evaluation = evaluate(session, estimated)
    assert {row.joint for row in evaluation.joint_angle} == set(session.analysis.joints)
    assert any(own.code == "judged.joint_covered" for own in evaluation.findings)
    page = render(session, estimated, evaluation)
    assert "Angles over time: knee_r" in page
    assert "How well the angles of hip_r are known" in page


def test_an_export_by_a_filter_without_angles_names_those_that_have_some(walked, tmp_path):
    session, estimated = walked
    lost = finding("joint.not_placed", filter="vqf_6d", why="it fell", add="a rest")
    joints = {
        name: replace(
            own,
            angles={key: of for key, of in own.angles.items() if key[0] != "vqf_6d"},
            findings=[*own.findings, lost],
        )
        for name, own in estimated.joints.items()
    }
    source = ExportSource(session, replace(estimated, joints=joints), "vqf_6d")
    with pytest.raises(InputError, match=r"by 'vqf_6d': .*it fell.*; there are angles by vqf_9d"):
        write_export("mot", source, tmp_path / "a.mot")


@pytest.fixture(scope="module")
def modelled(tmp_path_factory) -> tuple[Session, Estimate]:
    """The same on a treadmill, by the chain filter."""
    folder, scene = tmp_path_factory.mktemp("treadmill"), walking_limb.walk(0, 10.0, 0.0)
    text = JOINTS.replace(
        "estimate: {filters: [vqf_6d, vqf_9d], ", "estimate: {filters: [vqf_6d], "
    )
    head, settings = text.split("estimate: {")
    lines = "".join(f"  {item}\n" for item in settings.strip().strip("}").split(", "))
    wanted = head + "estimate:\n" + lines + walking_limb.chain_text(scene)
    mapping, files = walking_limb.export(scene, folder / "files", wanted)
    options = Options(str(mapping))
    session = import_recording("generic", files, folder / "walk", SystemClock(), options)
    return session, estimate(session)


def test_a_chain_of_a_person_whose_sensors_sit_askew_says_how_well_it_knows_each_angle(modelled):
    session, estimated = modelled
    (chain,) = estimated.chain
    assert chain.facts["lost"] is False and chain.facts["placement"]["settled"]
    source = ExportSource(session, estimated)
    held = []
    for joint, names in CHAINED.items():
        true = source.true_angles(f"{joint}_r", chain.host_time_ns)[f"isb_{joint}"]
        for i, name in names.items():
            column = chain.joints.index(name)
            error = np.degrees(rotation.wrap(chain.mean[:, 0, column] - true[:, i]))
            sd = np.degrees(chain.sd[:, 0, column])
            known = np.isfinite(error)
            held.append(np.mean(np.abs(error[known]) < 2.5 * sd[known]))
            assert np.sqrt(np.mean(error[known] ** 2)) < 6
            assert sd.min() > (0.2 if joint == "knee" else 1.0)
    assert np.mean(held) > 0.85
    turned = chain.sd[:, 0, chain.joints.index("hip_r_rotation")]
    assert np.degrees(turned.min()) > walking_limb.POSTURE_DEG  # no sensor tells it from standing


def test_where_sensors_have_truths_the_joint_is_that_of_the_truths_bodies(tmp_path, clock):
    """World, clock and mounting unknown: the mapping's key `joints` alone."""
    scene = two_segments.pendulum(2, 110.0)
    upper, lower = (scene.segments[name].level_from_body for name in ("upper", "lower"))
    turns = (upper.inv() * lower).as_rotvec()
    hinge = np.linalg.svd(turns[::50], full_matrices=False)[2][0]
    mapping, files = two_segments.export(scene, tmp_path / "files", 1)
    axis = ", ".join(f"{part:.6f}" for part in hinge)
    mapping.write_text(
        mapping.read_text() + "joints: {elbow: {proximal: upper, distal: lower, definition: "
        f"{{hinge: [{axis}]}}, compare: [{{definition: rotation_vector}}]}}}}\n"
    )
    session = import_recording("generic", files, tmp_path / "s", clock, Options(str(mapping)))
    estimated = estimate(session, ["vqf_6d"])
    joint = estimated.joints["elbow"]
    time = joint.host_time_ns * 1e-9 + scene.apart
    rows = np.round(time * two_segments.FINE).astype(int)
    inside = (rows > scene.apart * two_segments.FINE) & (rows < len(turns))
    found = joint.angles["vqf_6d", "rotation_vector"][inside]
    error = np.degrees(np.linalg.norm(found - turns[rows[inside]], axis=1))
    assert np.sqrt(np.mean(error**2)) < 1.5
    own = joint.angles["vqf_6d", session.analysis.joints["elbow"].label][inside, 0]
    about = np.degrees(own - turns[rows[inside]] @ hinge)
    assert np.sqrt(np.mean(about**2)) < 0.5
    judged = evaluate(session, estimated).joint_summary
    (row,) = (own for own in judged if own.sequence.startswith("hinge"))
    assert row.errors.rmse_deg < 0.5


# --- three DOTs on a person who squats


@pytest.fixture(scope="module")
def squats(tmp_path_factory, data) -> Session:
    files = tuple(str(own) for own in sorted((data / "xsens_dot").glob("*.csv")))
    body = BodyRequest(joints=("knee=RFemur:RTibia", "hip=Pelvis:RFemur"), sequences=("ZXY",))
    out = tmp_path_factory.mktemp("dots") / "squats"
    return bring_in(ImportRequest(format="xsens_dot", files=files, out=str(out), body=body))


@pytest.fixture(scope="module")
def squatted(squats) -> Estimate:
    return estimate(squats)


def test_three_dots_show_knee_and_hip_of_a_squat(squats, squatted):
    knee, hip = (
        np.degrees(squatted.joints[name].angles["device", "ZXY"]) for name in ("knee", "hip")
    )
    assert np.abs(knee[:90]).max() < 3 and np.abs(hip[:90]).max() < 3  # standing
    assert -75 < knee[:, 0].min() < -50 and 80 < hip[:, 0].max() < 110
    assert np.abs(knee[:, 1:]).max() < 8  # a knee is nearly a hinge
    page = render(squats, squatted, evaluate(squats, squatted))
    assert "angles of knee over time" in page and "angles of hip over time" in page


def test_opensim_opens_their_motion_by_names_of_its_own_models(squats, squatted, tmp_path):
    opensim = pytest.importorskip("opensim", reason="opensim has wheels for Linux x86-64 only")
    opensim.Logger.setLevelString("Error")
    for model, sign in (("rajagopal", 1), ("gait2392", -1)):
        source = ExportSource(squats, squatted, model=model)
        path = write_export("mot", source, tmp_path / f"{model}.mot").path
        table = opensim.TimeSeriesTable(str(path))
        labels = set(table.getColumnLabels())
        assert {"knee_angle_r", "hip_flexion_r", "hip_adduction_r", "hip_rotation_r"} <= labels
        knee = sign * table.getDependentColumn("knee_angle_r").to_numpy()
        assert 50 < knee.max() < 75 and knee.min() > -8
        assert 80 < table.getDependentColumn("hip_flexion_r").to_numpy().max() < 110
        assert 0 <= table.getIndependentColumn()[0] < 0.1
    header = path.read_text().split("endheader")[0]
    assert "coordinates=gait2392_simbody" in header and "filter=device" in header
    sto = write_export("sto", ExportSource(squats, squatted), tmp_path / "a.sto").path
    quaternions = opensim.TimeSeriesTableQuaternion(str(sto))
    assert list(quaternions.getColumnLabels()) == ["pelvis_imu", "femur_r_imu", "tibia_r_imu"]


# --- what is not shown, and what is wrong


@pytest.mark.parametrize(
    ("joint", "told"),
    [
        ("knee_r=RFemur:RTibia", set()),
        ("hip_r=Pelvis:RFemur", set()),
        ("knee_r=RTibia:RFemur", {"structure.joint_turned", "joint.sensors_exchanged"}),
        ("hip_r=RFemur:Pelvis", {"structure.joint_turned", "joint.sensors_exchanged"}),
        ("knee_r=Pelvis:RTibia", {"structure.joint_elsewhere", "joint.centre_apart"}),
        ("knee_r=Pelvis:RFemur", {"structure.joint_elsewhere"}),  # its motion is a joint's, too
        ("knee_l=RFemur:RTibia", {"structure.joint_of_both_sides"}),
    ],
)
def test_sensors_that_are_not_those_of_the_joint_are_named(data, tmp_path, joint, told):
    files = tuple(str(own) for own in sorted((data / "xsens_dot").glob("*.csv")))
    body, out = BodyRequest(joints=(joint,)), str(tmp_path / "s")
    asked = ImportRequest(format="xsens_dot", files=files, out=out, body=body)
    session = bring_in(asked, SystemClock())
    found = [*session.manifest.findings, *estimate(session).joints[joint.split("=")[0]].findings]
    warned = {own.code for own in found if own.severity == "warning"}
    assert {code for code in warned if code.startswith(("joint", "structure.joint"))} == told


def test_a_file_that_is_given_twice_is_refused_and_a_copy_is_named(data, tmp_path):
    femur = next((data / "xsens_dot").glob("RFemur*.csv"))
    copy = tmp_path / femur.name.replace("RFemur", "RTibia")
    shutil.copy(femur, copy)

    def asked(*files):
        return ImportRequest(
            format="xsens_dot", files=tuple(map(str, files)), out=str(tmp_path / "s")
        )

    with pytest.raises(InputError, match=r"RFemur\S+ is given twice"):
        bring_in(asked(femur, femur.parent / ".." / femur.parent.name / femur.name))
    found = bring_in(asked(femur, copy)).manifest.findings
    (said,) = [own for own in found if own.code == "structure.copies"]
    assert said.values == {"first": femur.name, "second": copy.name}


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ({"standing": "0:9"}, "joint.standing_moves"),
        ({"place_by": "stated"}, "joint.axes_unstated"),
    ],
)
def test_what_a_person_says_of_the_pose_and_the_recording_denies_is_told(
    data, tmp_path, body, code
):
    files = tuple(str(own) for own in sorted((data / "xsens_dot").glob("*.csv")))
    asked = BodyRequest(joints=("knee_r=RFemur:RTibia",), **body)
    out = str(tmp_path / "s")
    session = bring_in(ImportRequest(format="xsens_dot", files=files, out=out, body=asked))
    assert code in {own.code for own in estimate(session).joints["knee_r"].findings}


def test_a_body_that_does_not_move_has_no_angles_and_says_what_to_add(tmp_path, clock):
    scene = walking_limb.walk(1, 2.5)  # stands
    mapping, files = walking_limb.export(scene, tmp_path / "files", JOINTS)
    session = import_recording("generic", files, tmp_path / "s", clock, Options(str(mapping)))
    estimated = estimate(session)
    for joint in estimated.joints.values():
        assert not joint.angles
        told = [str(own) for own in joint.findings]
        assert any("alignment.forward" in own for own in told), told
    evaluation = evaluate(session, estimated)
    assert "which way the body faces" in render(session, estimated, evaluation)
    with pytest.raises(InputError, match=r"has no angles of hip_r.*what tells it"):
        write_export("mot", ExportSource(session, estimated), tmp_path / "a.mot")


def test_a_joint_whose_sensors_have_no_orientation_says_so(tmp_path, clock):
    mapping, files = walking_limb.export(walking_limb.walk(1, 4.0), tmp_path / "files", JOINTS)
    mapping.write_text(re.sub(r"    (gyr|sampling): .*\n", "", mapping.read_text()))
    session = import_recording("generic", files, tmp_path / "s", clock, Options(str(mapping)))
    for joint in estimate(session).joints.values():
        assert not joint.angles and [own.code for own in joint.findings] == ["joint.no_filter"]


def edited(session: Session, folder: Path, **analysis) -> Session:
    """A copy whose manifest a person changed."""
    shutil.copytree(session.path, folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["analysis"] |= analysis
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return Session(folder)


KNEE = {"proximal": "RFemur", "distal": "RTibia", "sequence": "ZXY"}


def test_a_joint_that_is_written_into_a_manifest_is_computed(squats, squatted, tmp_path):
    session = edited(squats, tmp_path / "a", body=None, joints={"bend": KNEE})
    found = estimate(session).joints["bend"].angles["device", "ZXY"]
    most = np.degrees(np.ptp(found[:, 0]))
    assert most == pytest.approx(
        np.degrees(np.ptp(squatted.joints["knee"].angles["device", "ZXY"][:, 0])), abs=5
    )


@pytest.mark.parametrize(
    ("analysis", "words"),
    [
        ({"joints": {"k": {**KNEE, "distal": "Tibia"}}}, "joints.k.distal is 'Tibia'; the sensors"),
        ({"joints": {"k": {**KNEE, "distal": "RFemur"}}}, "the same sensor"),
        ({"joints": {"k": {**KNEE, "sequence": "ZZZ"}}}, "sequence"),
        ({"body": {"joints": {"k": {**KNEE, "alignment": "magic"}}}}, "alignment"),
        ({"body": {"alignment": {"forward": {"Hand": "x"}}}}, "forward is of 'Hand'"),
        ({"body": {"alignment": {"standing_s": [3, 2]}}}, "from before to"),
    ],
)
def test_an_edited_manifest_is_refused_with_what_is_allowed(squats, tmp_path, analysis, words):
    session = edited(squats, tmp_path / "a", **analysis)
    with pytest.raises(SessionError, match="analysis is damaged") as refused:
        estimate(session)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"joints": ("k=RFemur:Tibia",)}, "known: Pelvis, RFemur, RTibia"),
        ({"joints": ("k=RFemur:RFemur",)}, "--joint k: proximal and distal are the same sensor"),
        ({"joints": ("k=RFemur",)}, "NAME=PROXIMAL:DISTAL"),
        ({"joints": ("1=RFemur:RTibia",)}, "must be a name"),
        ({"joints": ("k=RFemur:RTibia", "k=Pelvis:RTibia")}, "twice for k"),
        ({"joints": ("k=RFemur:RTibia",), "sequences": ("ZZX",)}, "XYZ, XZY"),
        ({"joints": ("k=RFemur:RTibia",), "sequences": ("h=ZXY",)}, "the joints are k"),
        ({"joints": ("k=RFemur:RTibia",), "sequences": ("ZXY", "ZYX")}, "twice for all"),
        ({"joints": ("k=RFemur:RTibia",), "sequences": ("{hinge: [0]}",)}, "at least 3"),
        ({"joints": ("k=RFemur:RTibia",), "sequences": ("=ZXY",)}, "JOINT=DEFINITION"),
        ({"joints": ("k=RFemur:RTibia",), "standing": "now"}, "FROM:TO"),
        ({"joints": ("k=RFemur:RTibia",), "standing": "2:1"}, "--standing: [2.0, 1.0]"),
        ({"joints": ("k=RFemur:RTibia",), "forward": ("Pelvis=z",)}, "no joint is of that sensor"),
        (
            {"joints": ("k=RFemur:RTibia",), "place_by": "stated", "standing": "0:1"},
            "has an effect",
        ),
        (
            {"joints": ("k=RFemur:RTibia",), "segments": ("RFemur=leg", "RTibia=leg")},
            "two sensors of one segment, 'leg'",
        ),
        ({"joints": ("k=RFemur:RTibia",), "forward": ("RFemur=q",)}, "'x', 'y', 'z'"),
        ({"sequences": ("ZXY",)}, "there is none"),
        ({"forward": ("Pelvis=x",)}, "there is none"),
    ],
)
def test_a_joint_that_cannot_be_is_refused_before_anything_is_written(
    data, tmp_path, options, words
):
    files = tuple(str(own) for own in sorted((data / "xsens_dot").glob("*.csv")))
    asked = ImportRequest(
        format="xsens_dot", files=files, out=str(tmp_path / "s"), body=BodyRequest(**options)
    )
    with pytest.raises((InputError, NotFoundError)) as refused:
        bring_in(asked)
    assert words in str(refused.value)
    assert not (tmp_path / "s").exists()
