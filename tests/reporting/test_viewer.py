"""What the viewer is given can be read back; what it draws is not blank; nothing of it stays."""

from __future__ import annotations

import errno
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from PIL import Image

from testbench.model.kinematics import Kinematics, Pose
from testbench.records.results.evaluation import ChainRow
from testbench.records.specs.robot import load_robot
from testbench.reporting.viewer import (
    Picture,
    Where,
    process,
    save_recording,
    screenshot,
    timeline,
    view,
)
from testbench.reporting.viewer.process import ViewerError
from testbench.reporting.viewer.recording import drained
from testbench.reporting.viewer.scene import (
    COLUMN,
    MOST_ROWS,
    ROW,
    WIDE,
    Cells,
    axes_each,
    column_width,
    viewable_urdf,
)
from testbench.reporting.viewer.signals import chain_joints
from testbench.reporting.viewer.timeline import (
    TIMELINE,
    departing,
    every,
    extremes,
)
from tests.reporting.conftest import Judged

VULKAN = list(Path("/usr/share/vulkan/icd.d").glob("*.json"))


def chunks_of(path: Path) -> list:
    from rerun.chunk import RrdReader

    reader = RrdReader(path)
    return [
        chunk for entry in reader.recordings() for chunk in reader.stream(store=entry).to_chunks()
    ]


@pytest.fixture(scope="module")
def chunks(quick: Judged, tmp_path_factory: pytest.TempPathFactory) -> list:
    path = tmp_path_factory.mktemp("recording") / "session.rrd"
    return chunks_of(save_recording(quick.session, path, quick.estimate, quick.evaluation))


def rows_of(chunks: list, path: str) -> int:
    return sum(
        chunk.num_rows for chunk in chunks if chunk.entity_path == path and not chunk.is_static
    )


def column(chunks: list, path: str, name: str) -> list:
    values: list = []
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if chunk.entity_path == path and not chunk.is_static and name in batch.schema.names:
            values += batch.column(name).to_pylist()
    return values


def test_the_recording_holds_arm_sensors_signals_errors_and_steps(
    chunks: list, quick: Judged
) -> None:
    paths = {chunk.entity_path for chunk in chunks}
    assert {f"/arm/joints/{joint}" for joint in load_robot("ur3e").joint_names} <= paths
    for sensor in ("arm", "forearm"):
        assert {
            f"/sensors/{sensor}/true",
            f"/errors/{sensor}/total",
            f"/imu/{sensor}/rate_deg_s",
            f"/orientations/{sensor}/true",
        } <= paths
        for name in quick.estimate.sensors[sensor].orientation:
            assert {
                f"/sensors/{sensor}/estimated/{name}",
                f"/orientations/{sensor}/{name}",
            } <= paths
    assert {
        "/joints/elbow/ZXZ/flexion",
        "/joints/elbow/YXZ/error",
        "/events",
        "/state/section",
    } <= paths


def test_everything_that_changes_is_on_the_host_timeline(chunks: list) -> None:
    assert {tuple(chunk.timeline_names) for chunk in chunks if not chunk.is_static} == {(TIMELINE,)}


def test_every_raw_sample_is_there(chunks: list, quick: Judged) -> None:
    samples = quick.session.imu("arm")
    shown = column(chunks, "/imu/arm/rate_deg_s", "Scalars:scalars")
    assert np.allclose(shown, np.degrees(samples.gyr))
    assert rows_of(chunks, "/imu/arm/specific_force_m_s2") == len(samples)


def test_every_started_step_is_a_line_of_text(chunks: list, quick: Judged) -> None:
    lines = [text for (text,) in column(chunks, "/events", "TextLog:text")]
    assert sum(line.startswith("step ") for line in lines) == len(quick.session.steps)
    assert "step 4: static, misalignment_deg 20, flexion_deg 0" in lines


def test_estimated_axes_stand_where_the_arm_carries_the_sensor(chunks: list, quick: Judged) -> None:
    path = "/sensors/forearm/estimated/device/pose"
    times = np.array(
        [t.value if hasattr(t, "value") else t for t in column(chunks, path, TIMELINE)]
    ).astype("timedelta64[ns]")
    places = np.array(column(chunks, path, "Transform3D:translation"))[:, 0]
    arm, sensor = quick.session.arm(), quick.session.analysis.sensors["forearm"]
    assert arm is not None
    assert quick.session.robot is not None
    q = np.column_stack(
        [
            np.interp(times.astype(np.int64), arm.host_time_ns, arm.q_measured[:, i])
            for i in range(6)
        ]
    )
    motion = Kinematics(quick.session.robot).frame_motion(
        sensor.link, q, offset=Pose.from_placement(sensor.mounting)
    )
    assert np.abs(places - motion.position).max() < 1e-6


def test_a_recording_without_an_arm_shows_its_sensors(imported: Judged, tmp_path: Path) -> None:
    chunks = chunks_of(
        save_recording(imported.session, tmp_path / "a.rrd", imported.estimate, imported.evaluation)
    )
    paths = {chunk.entity_path for chunk in chunks}
    assert {"/orientations/imu/true", "/orientations/imu/vqf_6d", "/errors/imu/total"} <= paths
    assert not [path for path in paths if path.startswith(("/arm", "/sensors", "/joints"))]


@pytest.mark.parametrize("robot", ["ur3e", "panda", "so101"])
def test_meshes_are_found_and_collision_bodies_left_out(robot: str) -> None:
    text = viewable_urdf(load_robot(robot))
    assert "package://" not in text
    assert "<collision" not in text
    files = [Path(part.split('"')[0]) for part in text.split('filename="')[1:]]
    assert len(files) >= 6
    assert all(file.is_absolute() and file.is_file() for file in files)


def test_what_is_held_until_the_next_row_is_never_off_by_more_than_the_tolerance() -> None:
    values = np.array([[0.0], [0.4], [0.9], [1.1], [1.1], [1.2], [3.0], [3.0]])
    assert departing(values, 1.0).tolist() == [0, 3, 6, 7]
    noisy = np.random.default_rng(1).normal(size=(1000, 2)).cumsum(axis=0)
    rows = departing(noisy, 2.0)
    held = noisy[rows[np.searchsorted(rows, np.arange(1000), side="right") - 1]]
    assert np.abs(held - noisy).max() <= 2.0
    assert 50 < len(rows) < 800


def test_rates_are_brought_down_and_the_rows_of_long_recordings_bounded() -> None:
    assert every(np.arange(100) * 8_000_000, 25.0) == slice(None, None, 5)
    assert every(np.arange(100) * 80_000_000, 25.0) == slice(None, None, 1)
    assert every(np.arange(100) * 80_000_000, 25.0, most=30) == slice(None, None, 4)


def test_lines_of_long_plots_keep_their_extremes() -> None:
    time = np.arange(10 * timeline.MOST_ROWS) * 10_000_000
    lines = np.zeros((len(time), 3))
    lines[123_456, 1], lines[222_222, 2] = 7.0, -3.0
    times, fewer = extremes(time, lines)
    assert len(times) == len(fewer) == timeline.MOST_ROWS
    assert fewer[:, 1].max() == 7.0
    assert fewer[:, 2].min() == -3.0
    assert abs(times[np.argmax(fewer[:, 1])] - time[123_456]) < 200_000_000
    np.testing.assert_array_equal(extremes(time[:100], lines[:100])[1], lines[:100])


@pytest.mark.viewer
@pytest.mark.skipif(
    not VULKAN, reason="no Vulkan driver (Debian: libvulkan1 and mesa-vulkan-drivers)"
)
def test_a_picture_is_drawn_without_a_screen_and_nothing_stays(
    quick: Judged, tmp_path: Path
) -> None:
    before = psutil.Process().children()
    path = screenshot(
        quick.session,
        tmp_path / "view.png",
        quick.estimate,
        quick.evaluation,
        Picture(time_s=12.0, size=(1200, 800)),
    )
    pixels = np.asarray(Image.open(path).convert("RGB"))
    assert pixels.shape == (800, 1200, 3)
    left = pixels[80:450, 20:460].reshape(-1, 3)
    assert (left.min(axis=1) > 150).mean() > 0.02, "the arm, which is nearly white, is missing"
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 200
    assert psutil.Process().children() == before


def test_a_viewer_that_dies_is_reported(
    quick: Judged, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "viewer_program", lambda: Path(str(shutil.which("false"))))
    with pytest.raises(ViewerError, match="mesa-vulkan-drivers"):
        screenshot(quick.session, tmp_path / "view.png", quick.estimate, quick.evaluation)
    with pytest.raises(ViewerError, match="ended with code 1"):
        view(quick.session, estimate=quick.estimate, evaluation=quick.evaluation)
    assert not (tmp_path / "view.png").exists()


def test_a_picture_that_is_not_drawn_leaves_what_was_there(
    quick: Judged, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "viewer_program", lambda: Path(str(shutil.which("false"))))
    (tmp_path / "kept.png").write_bytes(b"a picture")
    (tmp_path / "view.png").symlink_to("kept.png")
    with pytest.raises(ViewerError):
        screenshot(quick.session, tmp_path / "view.png", quick.estimate, quick.evaluation)
    assert (tmp_path / "view.png").is_symlink()
    assert (tmp_path / "kept.png").read_bytes() == b"a picture"


def test_the_viewer_listens_on_this_machine_only_and_reports_no_usage(
    quick: Judged, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    note = tmp_path / "note"
    program = tmp_path / "viewer"
    program.write_text(
        f'#!/bin/sh\necho "$@" > {note}\ncat "$XDG_CONFIG_HOME/rerun/analytics.json" >> {note}\n',
        encoding="utf-8",
    )
    program.chmod(0o755)
    monkeypatch.setattr(process, "viewer_program", lambda: program)
    told: list[str] = []
    where = Where(web=True, port=9999)
    view(quick.session, where, quick.estimate, quick.evaluation, told.append)
    arguments, settings = note.read_text(encoding="utf-8").split("\n", 1)
    assert arguments.startswith("--bind 127.0.0.1 ")
    assert "--web-viewer-port 9999" in arguments
    assert '"analytics_enabled": false' in settings
    assert told[0].startswith("http://127.0.0.1:9999/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1")


METADATA = """
- metadata: {content-type: application/grpc, date: Sun, 29 Nov 2026 21:11:43 GMT}"""


class Loading:
    """A viewer that takes a while to know its timelines, or that refuses: rerun-sdk 0.41 raises
    ConnectionError for both, with the transport's own lines.
    """

    def __init__(self, answers: list[str]):
        self.answers, self.time = answers, None

    def set_time(self, timeline: str, duration: float, play_state: str) -> None:
        if self.answers:
            raise ConnectionError(self.answers.pop(0) + METADATA)
        self.time = (timeline, duration, play_state)


class Pause:
    """Waits that take no time and are counted."""

    def __init__(self) -> None:
        self.waited = 0.0

    def wait(self, seconds: float) -> None:
        self.waited += seconds


def test_a_recording_that_is_still_being_loaded_is_waited_for() -> None:
    client, pause = Loading(["recording r has no timelines yet (InvalidArgument)"] * 7), Pause()
    process._go_to(client, 12.5, pause)
    assert client.time == (TIMELINE, 12.5, "paused")
    assert pause.waited == pytest.approx(1.4)


@pytest.mark.parametrize(
    ("answers", "waited", "said"),
    [
        (["no such recording (NotFound)"], 0.0, r"could not draw: no such recording \(NotFound\)$"),
        (["no timelines yet"] * 1000, process.TIMELINE_TIMEOUT, "not loaded .* within 30 s"),
    ],
)
def test_a_viewer_that_refuses_is_not_waited_for_for_ever(
    answers: list[str], waited: float, said: str
) -> None:
    pause = Pause()
    with pytest.raises(ViewerError, match=said):
        process._go_to(Loading(answers), 1.0, pause)
    assert pause.waited == pytest.approx(waited, abs=0.5)


def test_a_viewer_that_starts_and_loads_slowly_draws_at_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loading = SimpleNamespace(recordings=["recording"], loading=["session.rrd"])
    loaded = SimpleNamespace(recordings=["recording"], loading=[])
    nothing = SimpleNamespace(recordings=[], loading=[])
    states = [ConnectionError("not yet" + METADATA), nothing, loading, loading, loaded]

    class Slow(Loading):
        def __init__(self) -> None:
            super().__init__(["recording r has no timelines yet (InvalidArgument)"] * 3)

        @classmethod
        def connect(cls, address: str) -> Slow:
            assert address.endswith(":1234/proxy")
            return cls()

        def get_state(self) -> SimpleNamespace:
            state = states.pop(0) if len(states) > 1 else states[0]
            if isinstance(state, Exception):
                raise state
            return state

        def save_screenshot(self, path: str) -> None:
            assert self.time is not None
            assert states == [loaded]
            Path(path).write_bytes(b"PNG")

    monkeypatch.setattr("rerun.experimental.ViewerClient", Slow)
    monkeypatch.setattr(process, "threading", SimpleNamespace(Event=Pause))
    running = SimpleNamespace(poll=lambda: None)
    process._draw(running, 1234, tmp_path / "view.png", 1.0)
    assert (tmp_path / "view.png").is_file()


class Painting:
    """A viewer that is too slow for so many pictures, as rerun-sdk 0.41 on a busy machine."""

    def __init__(self, late: int):
        self.late, self.asked = late, []

    def save_screenshot(self, path: str) -> None:
        assert path not in self.asked  # one that was given up may still be written
        self.asked.append(path)
        if len(self.asked) <= self.late:
            Path(path).write_bytes(b"PN")
            raise TimeoutError("Deadline expired before operation could complete")
        Path(path).write_bytes(b"PNG")


def test_a_picture_that_is_not_painted_in_time_is_asked_for_again(tmp_path: Path) -> None:
    process._paint(Painting(process.ASKS - 1), tmp_path / "view.png")
    assert (tmp_path / "view.png").read_bytes() == b"PNG"


def test_a_viewer_that_never_paints_is_not_asked_for_ever(tmp_path: Path) -> None:
    with pytest.raises(ViewerError, match="no picture in 8 attempts"):
        process._paint(Painting(process.ASKS), tmp_path / "view.png")
    assert not (tmp_path / "view.png").exists()


def test_columns_move_apart_where_many_rows_make_the_axes_small() -> None:
    assert column_width(2, 11) == COLUMN
    assert column_width(7, 2) > 2.5 * COLUMN
    for rows in range(1, 20):
        for columns in range(1, 12):
            width = column_width(rows, columns)
            assert COLUMN <= width <= 3 * COLUMN
            assert width == COLUMN or width * columns <= WIDE * ROW * rows + 1e-9


def test_names_stand_apart_from_axes_and_from_one_another() -> None:
    for sensors, axes in ((2, 12), (1, 5), (7, 3), (40, 2)):
        cells = Cells(sensors, axes_each(sensors, axes))
        found = [cells.places(s, a) for s in range(sensors) for a in range(cells.axes)]
        for points in zip(*found, strict=True):
            apart = np.abs(np.array(points)[:, None] - np.array(points)[None]).max(axis=-1)
            assert apart[~np.eye(len(apart), dtype=bool)].min() > 0.2
        assert all(np.abs(place - name).max() > 0.1 for place, name in found)
        assert cells.rows <= MOST_ROWS and cells.rows * cells.columns >= sensors


def test_of_many_filters_and_sensors_there_is_room_for_some_axes() -> None:
    assert (axes_each(2, 12), axes_each(2, 3), axes_each(9, 12), axes_each(40, 12)) == (5, 3, 2, 1)
    forty = Cells(40, 1)
    assert (forty.rows, forty.columns) == (8, 5)


def test_the_joints_of_a_chain_are_drawn_with_their_truth_the_worst_first(
    quick: Judged, tmp_path: Path
) -> None:
    time = np.arange(0, 2_000_000_000, 50_000_000)
    row = ChainRow("waves", "fourier", "", *([0] * 16))  # type: ignore[arg-type]
    joints = {"hip": 1.0, "knee": 3.0, "ankle": 2.0, "toe": 0.5, "list": 0.1}
    rows = [replace(row, joint=joint, rmse_deg=rmse) for joint, rmse in joints.items()]
    one = {"host_time_ns": time, "judged": (time >= 500_000_000) & (time < 1_800_000_000)}
    for joint in joints:
        one |= {
            f"{joint}_rad": np.full(len(time), 0.3),
            f"{joint}_error_rad": np.full(len(time), 0.1),
        }
    evaluation = replace(
        quick.evaluation, chain=rows, series=quick.evaluation.series | {"chain_waves_fourier": one}
    )
    assert chain_joints(evaluation) == {"waves": ["knee", "ankle", "hip", "toe"]}
    chunks = chunks_of(
        save_recording(quick.session, tmp_path / "chain.rrd", quick.estimate, evaluation)
    )
    angles = column(chunks, "/chain/waves/knee/angle", "Scalars:scalars")
    assert np.allclose(angles, np.degrees([0.2, 0.3]))
    assert len(angles) == len(time)
    assert rows_of(chunks, "/chain/waves/knee/error") == int(one["judged"].sum())
    assert rows_of(chunks, "/chain/waves/list/error") == 0


def test_a_recorder_that_a_full_disk_stops_is_not_waited_for():
    def recorded() -> None:
        with drained(Path("/dev/full")) as pipe, pipe.open("wb") as recorder:
            for _ in range(40):
                recorder.write(bytes(100_000))

    with pytest.raises(OSError, match="No space left") as told:
        recorded()
    assert told.value.errno == errno.ENOSPC
