"""Importing BROAD trials: numbers of the package called directly, and files that are no trials."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.spatial.transform import Rotation
from vqf import VQF

from testbench.exceptions import FileProblems, InputError, NotFoundError
from testbench.formats import FORMATS, import_recording
from testbench.pipeline.analyse import analyse
from testbench.records.session.session import RunStatus
from tests.asking import analysis

# Published by the dataset's authors for the vqf package with its defaults [deg]; data/README.md of
# the recordings.
VQF_TOTAL_DEG = {"02": 1.38, "16": 0.74}


def trial_file(data: Path, number: str, suffix: str = "mat") -> Path:
    (file,) = (data / "broad").glob(f"{number}_*.{suffix}")
    return file


def vqf_called_directly(file: Path) -> float:
    """RMSE of the total error during movement [deg], as the dataset defines it, without any code of
    ours.
    """
    content = loadmat(file)
    arrays = [
        np.ascontiguousarray(content[key], dtype=float) for key in ("imu_gyr", "imu_acc", "imu_mag")
    ]
    q = VQF(1 / float(content["sampling_rate"].squeeze())).updateBatch(*arrays)["quat9D"]
    counted = content["movement"].squeeze().astype(bool) & np.isfinite(content["opt_quat"]).all(
        axis=1
    )
    estimated = Rotation.from_quat(q[counted], scalar_first=True)
    true = Rotation.from_quat(content["opt_quat"][counted], scalar_first=True)
    return float(np.degrees(np.sqrt(np.mean((estimated * true.inv()).magnitude() ** 2))))


@pytest.mark.data
@pytest.mark.parametrize("number", VQF_TOTAL_DEG)
def test_a_trial_through_import_and_evaluation_gives_the_error_of_the_package_called_directly(
    data, number, tmp_path, clock
):
    file = trial_file(data, number)
    session = import_recording("broad", [file], tmp_path / number, clock)
    evaluation = analyse(session, analysis("vqf_9d")).evaluation
    (row,) = evaluation.orientation
    assert row.total_rmse_deg == pytest.approx(vqf_called_directly(file), abs=0.02)
    assert row.total_rmse_deg == pytest.approx(VQF_TOTAL_DEG[number], abs=0.02)


@pytest.mark.data
def test_the_two_forms_of_a_trial_give_the_same_session(data, tmp_path, clock):
    sessions = [
        import_recording("broad", [trial_file(data, "02", suffix)], tmp_path / suffix, clock)
        for suffix in ("mat", "hdf5")
    ]
    tables = [{**s.imu("imu").to_columns(), **s.truth("imu").to_columns()} for s in sessions]
    assert list(tables[0]) == list(tables[1])
    for name, column in tables[0].items():
        np.testing.assert_array_equal(column, tables[1][name], err_msg=name)
    assert tables[0]["judged"].dtype == np.bool_
    assert 0.1 < tables[0]["judged"].mean() < 0.99


@pytest.mark.data
def test_an_imported_trial_is_a_session_like_any_other(data, tmp_path, clock):
    session = import_recording("broad", [trial_file(data, "05")], tmp_path / "trial", clock)
    assert session.status is RunStatus.COMPLETED
    assert (
        session.sensor_names == ["imu"]
        and session.steps == []
        and session.arm() is None
        and session.robot is None
    )
    samples = session.imu("imu")
    assert samples.device_q is None and samples.mag is not None
    assert (len(samples) - 1) / (samples.device_time_ns[-1] / 1e9) == pytest.approx(
        285.714, rel=1e-4
    )
    result = analyse(session, analysis())
    assert {row.filter for row in result.evaluation.orientation} == {
        "vqf_6d",
        "vqf_9d",
        "fusion",
        "madgwick_imu",
    }
    assert result.evaluation.joint_angle == []
    assert result.estimate.sensors["imu"].clock.method == "none"


def made_up(n: int = 1000) -> dict[str, object]:
    """A trial that was never recorded: at rest, level, its readings noisy as a sensor's are."""
    noise = np.random.default_rng(0).standard_normal((3, n, 3))
    return {
        "imu_gyr": 1e-5 * noise[0],
        "imu_acc": np.array([0, 0, 9.81]) + 1e-4 * noise[1],
        "imu_mag": np.array([0, 24.0, -39]) + 1e-3 * noise[2],
        "opt_quat": np.tile([1.0, 0, 0, 0], (n, 1)),
        "movement": np.ones((n, 1)),
        "sampling_rate": 100.0,
    }


def test_a_trial_at_rest_has_no_error(tmp_path, clock):
    savemat(tmp_path / "rest.mat", made_up())
    session = import_recording("broad", [tmp_path / "rest.mat"], tmp_path / "session", clock)
    (row,) = analyse(session, analysis("vqf_9d")).evaluation.orientation
    assert row.n == 1000
    assert row.total_rmse_deg < 0.01


def test_samples_of_which_the_optical_system_saw_nothing_are_not_judged(tmp_path, clock):
    trial = made_up()
    trial["opt_quat"][300:600] = np.nan  # type: ignore[index]
    savemat(tmp_path / "lost.mat", trial)
    session = import_recording("broad", [tmp_path / "lost.mat"], tmp_path / "session", clock)
    (row,) = analyse(session, analysis("vqf_6d")).evaluation.orientation
    assert 690 <= row.n <= 700


def test_orientations_of_no_length_are_lost(tmp_path, clock):
    trial = made_up()
    trial["opt_quat"][300:600] = 0.0  # type: ignore[index]
    trial["opt_quat"][700] *= 1e200  # type: ignore[index]
    savemat(tmp_path / "zeros.mat", trial)
    session = import_recording("broad", [tmp_path / "zeros.mat"], tmp_path / "session", clock)
    assert np.isnan(session.truth("imu").q_world_from_sensor[[*range(300, 600), 700]]).all()
    assert analyse(session, analysis("vqf_6d")).evaluation.orientation[0].n < 710


def drop(key: str) -> dict[str, object]:
    return {name: value for name, value in made_up().items() if name != key}


def write(folder: Path, name: str, content: object) -> Path:
    file = folder / name
    if isinstance(content, dict):
        savemat(file, content)
    else:
        file.write_bytes(content)  # type: ignore[arg-type]
    return file


def truncated(folder: Path) -> bytes:
    savemat(folder / "whole.mat", made_up())
    return (folder / "whole.mat").read_bytes()[:5000]


MALFORMED = {
    "empty.mat": b"",
    "text.mat": b"this is not a MATLAB file, only some text that somebody renamed\n" * 20,
    "zeros.mat": bytes(4096),
    "text.hdf5": b"nor is this HDF5",
    "nothing.mat": {},
    "other_keys.mat": {"gyr": np.zeros((10, 3)), "acc": np.zeros((10, 3))},
    "no_truth.mat": drop("opt_quat"),
    "no_rate.mat": drop("sampling_rate"),
    "no_marks.mat": drop("movement"),
    "short_truth.mat": made_up() | {"opt_quat": np.zeros((999, 4))},
    "flat.mat": made_up() | {"imu_gyr": np.zeros((1000, 2))},
    "few.mat": made_up(5),
    "no_samples.mat": made_up(0),
    "words.mat": made_up() | {"imu_gyr": "not numbers"},
    "marks.mat": made_up() | {"movement": np.ones(17)},
    "rate_zero.mat": made_up() | {"sampling_rate": 0.0},
    "rate_nan.mat": made_up() | {"sampling_rate": np.nan},
    "rate_words.mat": made_up() | {"sampling_rate": "fast"},
    "rate_empty.mat": made_up() | {"sampling_rate": np.zeros((0, 0))},
    "scalar.mat": made_up() | {"imu_gyr": 3.0},
}


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("name", MALFORMED)
def test_a_file_that_is_no_trial_is_refused_by_name_and_nothing_is_written(name, tmp_path, clock):
    file = write(tmp_path, name, MALFORMED[name])
    with pytest.raises(FileProblems) as caught:
        import_recording("broad", [file], tmp_path / "session", clock)
    message = str(caught.value)
    assert message.startswith(str(file))
    assert "Traceback" not in message and len(message) < 1000
    assert caught.value.exit_code == 2
    assert not (tmp_path / "session").exists()


def test_a_truncated_file_is_refused_and_nothing_is_written(tmp_path, clock):
    file = write(tmp_path, "cut.mat", truncated(tmp_path))
    with pytest.raises(FileProblems, match="not a readable"):
        import_recording("broad", [file], tmp_path / "session", clock)
    assert not (tmp_path / "session").exists()


def test_a_missing_file_a_folder_and_two_files_are_refused(tmp_path, clock):
    for missing in (tmp_path / "nowhere.mat", tmp_path):
        with pytest.raises(FileProblems, match="does not exist"):
            import_recording("broad", [missing], tmp_path / "session", clock)
    with pytest.raises(InputError, match="is one file, 2 were given"):
        import_recording(
            "broad", [tmp_path / "a.mat", tmp_path / "b.mat"], tmp_path / "session", clock
        )


def test_an_existing_folder_is_never_written_over(tmp_path, clock):
    savemat(tmp_path / "rest.mat", made_up())
    (tmp_path / "session").mkdir()
    with pytest.raises(InputError, match="cannot be made"):
        import_recording("broad", [tmp_path / "rest.mat"], tmp_path / "session", clock)
    assert not list((tmp_path / "session").iterdir())


def test_an_unknown_format_is_refused_with_those_that_exist(tmp_path, clock):
    with pytest.raises(NotFoundError, match=f"unknown format 'tape'; known: {', '.join(FORMATS)}"):
        import_recording("tape", [tmp_path / "a.mat"], tmp_path / "session", clock)
