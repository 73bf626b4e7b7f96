"""A session is looked at while it is recorded, after it was killed, and once it is over; whoever
records it notices nothing.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import typer

from testbench import Session, execute, plan
from testbench.cli.app import app
from testbench.cli.once import values_left_away, with_defaults
from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.execution import RunOptions
from testbench.pipeline import beside
from testbench.pipeline.follow import follow
from testbench.pipeline.live_session import LiveSession
from testbench.pipeline.request import FollowRequest, ViewRequest
from testbench.records.session.layout import orientation_table
from testbench.records.session.session_tail import SessionTail
from testbench.reporting.viewer import saved_live
from tests.conftest import FakeClock

KILLED_S = 12.0
LOOKS = 4
"""Cycles of the journals from one look to the next."""


@dataclass
class Watched:
    """A run of `quick` in steps of 100 ms, and what was drawn of it meanwhile.

    Attributes:
        session: Once it is over.
        live: What drew it, until the last reading before it was closed.
        file: What was drawn.
        cut_off: What was on the disk after `KILLED_S`.
        late_ns: After each reading, how much of the arm's recording was not drawn yet.
    """

    session: Session
    live: LiveSession
    file: Path
    cut_off: Path
    late_ns: list[int] = field(default_factory=list)


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Watched:
    logs = tmp_path_factory.mktemp("logs")
    name, file, cut_off = "watched", logs / "live.rrd", logs / "cut_off"
    late: list[int] = []
    with saved_live(name, file) as shown:
        looking: list[tuple[SessionTail, LiveSession]] = []

        def opened(path: Path) -> None:
            session = Session(path)
            looking.append((SessionTail(session), LiveSession(session, shown.recording)))

        def look(progress) -> None:
            if round(progress.time, 1) * 10 % LOOKS:
                return
            tail, live = looking[0]
            assert not tail.is_over
            live.take(tail.read())
            late.append(round(progress.time * 1e9) - live.last_ns)
            if progress.time >= KILLED_S and not cut_off.exists():
                shutil.copytree(logs / name, cut_off)

        options = RunOptions(
            clock=FakeClock(), speed="realtime", session_name=name, opened=opened, progress=look
        )
        session = execute(plan("quick"), logs, 3, options)
        tail, live = looking[0]
        assert tail.is_over
        while news := tail.read():
            live.take(news)
        live.ended(Session(session.path))
        tail.close()
    return Watched(session, live, file, cut_off, late)


@pytest.fixture(scope="module")
def drawn(watched: Watched) -> dict[str, list]:
    """Chunks of what was drawn, by entity."""
    return chunks_by_entity(watched.file)


def chunks_by_entity(file: Path) -> dict[str, list]:
    from rerun.chunk import RrdReader

    reader, found = RrdReader(file), {}
    for entry in reader.recordings():
        for chunk in reader.stream(store=entry).to_chunks():
            found.setdefault(chunk.entity_path, []).append(chunk)
    return found


def values(drawn: dict[str, list], path: str, name: str) -> list:
    batches = [chunk.to_record_batch() for chunk in drawn[path] if not chunk.is_static]
    return [value for own in batches if name in own.schema.names for value in own[name].to_pylist()]


def test_every_sample_is_read_once_while_it_is_recorded(watched: Watched) -> None:
    session = watched.session
    assert watched.live.counts == {n: session.sample_count(n) for n in session.sensor_names}
    assert max(watched.late_ns) <= 0, "what the arm reported is drawn in the same cycle"


def test_a_run_that_is_watched_has_the_same_bytes_as_one_that_is_not(
    watched: Watched, tmp_path: Path
) -> None:
    options = RunOptions(clock=FakeClock(), speed="realtime", session_name="watched")
    alone = execute(plan("quick"), tmp_path, 3, options)
    assert alone.manifest.files == watched.session.manifest.files


def test_arm_sensors_errors_margins_steps_and_state_are_drawn(drawn: dict[str, list]) -> None:
    assert {
        "/arm/joints/wrist_3_joint",
        "/sensors/forearm/estimated/vqf_6d/pose",
        "/imu/arm/rate_deg_s",
        "/errors/forearm/total",
        "/joints/elbow/ZXZ/flexion",
        "/joints/elbow/ZXZ/error",
        "/margins/position",
        "/margins/speed",
        "/link/rate_hz",
        "/link/lost",
        "/path/planned",
        "/path/ahead",
        "/state/section",
        "/state/phase",
        "/events",
    } <= set(drawn)
    (text,) = values(drawn, "/live/state", "TextDocument:text")[-1]
    assert text.startswith("# 24.") and text.splitlines()[0].endswith(": completed")
    states = [state for (state,) in values(drawn, "/state/section", "StateChange:state")]
    assert states == ["reference", "static", "centre", "sweep"]
    (text,) = values(drawn, "/live/state", "TextDocument:text")[20]
    assert "**step " in text and "s left of the step" in text


def test_running_errors_are_near_to_what_the_evaluation_finds_without_calibration(
    watched: Watched,
) -> None:
    session = watched.session
    evaluation = evaluate(session, estimate(session))
    begin = next(step.start_ns for step in session.steps if step.role == "evaluation")
    for sensor in session.sensor_names:
        series = evaluation.series[orientation_table(sensor)]
        rows = series["host_time_ns"] >= begin
        # filters that have settled when their headings are held: the field turns vqf_9d for long
        for name in ("device", "vqf_6d"):
            errors = series[f"{name}_total_rad"][rows]
            live = watched.live.sensors[sensor].running.rms(name)
            assert live is not None
            later = np.degrees(np.sqrt(np.nanmean(errors**2)))
            assert np.degrees(live) == pytest.approx(later, abs=1.0)


def test_a_killed_run_is_shown_to_its_last_sample(watched: Watched, tmp_path: Path) -> None:
    before = {path.name: path.read_bytes() for path in watched.cut_off.iterdir()}
    file = tmp_path / "cut_off.rrd"
    found = follow(FollowRequest(session=watched.cut_off, view=ViewRequest(save=file)))
    assert found.end == "cut off" and found.written == file
    assert found.last_s == pytest.approx(KILLED_S, abs=0.2)
    times = values(chunks_by_entity(file), "/imu/arm/rate_deg_s", "host_time")
    assert found.last_s - max(t.value for t in times) * 1e-9 < 0.1
    assert {path.name: path.read_bytes() for path in watched.cut_off.iterdir()} == before


def test_a_session_that_is_over_is_shown_whole_and_a_screen_is_not_waited_for(
    watched: Watched, tmp_path: Path
) -> None:
    told: list[int] = []
    asked = FollowRequest(session=watched.session.path, view=ViewRequest(save=tmp_path / "a.rrd"))
    found = follow(asked, told=told.append)
    assert found.end == "over" and found.samples == watched.live.counts
    assert told[-1] * 1e-9 == pytest.approx(found.last_s)


def test_the_viewer_is_started_in_a_process_of_its_own_and_what_it_says_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "python"
    program.write_text('#!/bin/sh\necho "open $@"\nps -o sid= -p $$\n', encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr(beside.sys, "executable", str(program))
    told: list[str] = []
    beside.start_viewer(Path("logs/a"), True, told.append).join(60.0)
    words, own = told
    assert words == "viewer: open -m testbench view logs/a --follow --with-run --web"
    assert int(own.removeprefix("viewer: ")) not in {0, os.getsid(0)}


def test_a_view_without_a_word_is_a_window() -> None:
    bare = {"--view": ("native", "web")}
    assert with_defaults(["--view", "quick"], bare) == ["--view", "native", "quick"]
    assert with_defaults(["quick", "--view"], bare) == ["quick", "--view", "native"]
    assert with_defaults(["--view", "web", "quick"], bare) == ["--view", "web", "quick"]
    commands = typer.main.get_command(app).commands
    assert values_left_away(commands["run"]) == bare == values_left_away(commands["record"])
    assert values_left_away(commands["view"]) == {}
