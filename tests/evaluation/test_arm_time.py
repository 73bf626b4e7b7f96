"""A recording whose arm moves before it was commanded, or of which much did not come, is told
of.
"""

from __future__ import annotations

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest

from testbench.evaluation.arm_time import arm_findings
from testbench.evaluation.left_out import left_out
from testbench.evaluation.time_lines import TimeDoubt
from testbench.pipeline.analyse import analyse
from testbench.records.results.evaluation import Outcome
from testbench.records.session.plan import PlannedStep
from testbench.records.session.session import Session
from tests.asking import analysis
from tests.told import told

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def recorded(run_protocol, tiny):
    return run_protocol(tiny, seed=4).session


@pytest.fixture
def copied(recorded, tmp_path):
    """A copy, as if of a real arm, that may be changed."""
    path = tmp_path / "copy"
    shutil.copytree(recorded.path, path)
    changed_manifest(path, driver="ur", commanded=True)
    return path


def shifted(path, by_ns: int) -> None:
    table = pq.read_table(path / "arm.parquet")
    times = table.column("host_time_ns").to_numpy() + by_ns
    pq.write_table(table.set_column(0, table.schema.field(0), [times]), path / "arm.parquet")


def changed_manifest(path, **arm) -> None:
    manifest = json.loads((path / "manifest.json").read_text())
    manifest["arm"] = {**manifest.get("arm", {}), **arm}
    (path / "manifest.json").write_text(json.dumps(manifest))


def test_of_a_sound_recording_nothing_is_said(copied):
    assert told(arm_findings(Session(copied))) == []


@pytest.mark.parametrize("lead_s", [0.1, 0.25])
def test_motion_before_its_command_is_told_with_its_size(copied, lead_s):
    shifted(copied, -round(lead_s * SECOND))
    (note,) = told(arm_findings(Session(copied)))
    found = float(note.removeprefix("arm time is doubtful by ").partition(" s:")[0])
    assert lead_s - 0.07 < found <= lead_s
    assert "moves before it was commanded" in note


def test_an_arm_that_lags_its_commands_is_none_of_this(copied):
    shifted(copied, SECOND // 5)
    assert told(arm_findings(Session(copied))) == []


def test_a_log_is_not_asked_for_its_commands(copied):
    shifted(copied, -SECOND // 4)
    changed_manifest(copied, driver="replay", commanded=False)
    assert told(arm_findings(Session(copied))) == []


def test_samples_that_did_not_come_are_told_with_share_and_longest_gap(copied):
    table = pq.read_table(copied / "arm.parquet")
    time = table.column("host_time_ns").to_numpy()
    kept = (time < SECOND) | (time > SECOND * 13 // 10)
    pq.write_table(table.filter(kept), copied / "arm.parquet")
    changed_manifest(copied, timing={"samples_missed": int((~kept).sum())})
    (note,) = told(arm_findings(Session(copied)))
    share = 100 * (~kept).mean()
    assert f"{(~kept).sum()} ({share:.2g} %) did not come, the longest gap is 0.3" in note


def test_what_the_driver_found_of_the_clocks_is_told(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["files"].pop("events.jsonl", None)
    (copied / "manifest.json").write_text(json.dumps(manifest))
    with (copied / "events.jsonl").open("a") as file:
        for event in (
            {"host_time_ns": 3 * SECOND, "event": "arm_time_step", "by_s": 0.4},
            {"host_time_ns": 4 * SECOND, "event": "arm_time_doubtful", "lead_s": 0.03},
        ):
            file.write(json.dumps(event) + "\n")
    first, second = told(arm_findings(Session(copied)))
    assert "parted by 0.4 s before 3.0 s" in first
    assert "doubtful by 0.03 s at 4.0 s" in second


def test_times_that_may_be_off_are_told_and_are_a_line_of_the_budget(copied):
    changed_manifest(copied, timing={"clock_unsure_s": 0.0019})
    assert told(arm_findings(Session(copied))) == []
    changed_manifest(copied, timing={"clock_unsure_s": 0.013})
    (note,) = told(arm_findings(Session(copied)))
    assert note.startswith("arm time may be off by 13 ms")
    estimate = SimpleNamespace(sensors={})
    assert TimeDoubt.of(Session(copied), estimate).arm_s == 0.013


def test_where_arm_time_is_doubtful_nothing_is_passed(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["analysis"]["accept"] = [{"metric": "hand.total_rmse_deg", "max": 90}]
    (copied / "manifest.json").write_text(json.dumps(manifest))
    assert analyse(Session(copied), analysis("device")).evaluation.outcome is Outcome.PASS
    changed_manifest(copied, timing={"clock_unsure_s": 0.003})
    assert analyse(Session(copied), analysis("device")).evaluation.outcome is Outcome.MARGINAL


def step(index: int, kind: str = "move", section: str = "static") -> PlannedStep:
    start = index * 2 * SECOND
    return PlannedStep(
        index=index,
        section=section,
        role="evaluation",
        name="a",
        kind=kind,
        variables={},
        start_ns=start,
        settled_ns=start + SECOND,
        end_ns=start + 2 * SECOND,
    )


TIME = np.arange(0, 12 * SECOND, SECOND // 100)
YES = np.ones(len(TIME), dtype=bool)


def within(begin_s: float, end_s: float) -> np.ndarray:
    return (begin_s * SECOND <= TIME) & (end_s * SECOND >= TIME)


def test_nothing_is_said_where_everything_counts():
    assert told(left_out("hand", [step(k) for k in range(6)], TIME, YES, YES, YES)) == []


def test_every_step_that_does_not_count_is_told_with_its_reason():
    steps = [step(k) for k in range(6)]
    static, known, sound = ~within(3, 4), ~within(5, 6), ~within(7, 8)
    (note,) = told(left_out("hand", steps, TIME, static, known, sound))
    assert note.startswith("hand, section static: 3 of 6 poses not evaluated: ")
    for reason in ("at rest in 1", "not known in 1", "samples of 1 are flagged"):
        assert reason in note
    (note,) = told(left_out("hand", steps, TIME, ~within(3, 4), YES, YES))
    assert (
        note
        == "hand, section static: 1 of 6 poses not evaluated: the sensors were not at rest in them"
    )


def test_a_section_that_vanishes_wholly_is_told_and_one_of_which_little_is_left():
    steps = [step(0), step(1), step(2, "sweep", "sweep")]
    assert told(left_out("hand", steps, TIME, ~YES, YES, ~within(4, 5))) == [
        "hand, section static: 2 of 2 poses not evaluated: the sensors were not at rest in them",
        "hand, section sweep: 1 of 1 sweeps not evaluated: the samples of them are flagged",
    ]
    little = within(1.9, 2) | within(3.9, 4)
    (note,) = told(left_out("hand", steps[:2], TIME, little, YES, YES))
    assert (
        note
        == "hand, section static: only 22 of 152 samples evaluated: the sensors were not at rest "
        "in them"
    )


def test_a_step_without_samples_is_told():
    (note,) = told(left_out("hand", [step(0), step(9)], TIME, YES, YES, YES))
    assert note == "hand, section static: 1 of 2 poses not evaluated: there are no samples in them"
