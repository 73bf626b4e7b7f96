"""Guards, states, hazards and the operator's requests."""

from __future__ import annotations

import itertools
import os
import signal
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench import execute, plan
from testbench.exceptions import ArmRefused, BenchError
from testbench.execution import RunOptions
from testbench.execution.checklist import HAZARDS, confirm_hazards
from testbench.execution.device_words import DeviceWords
from testbench.execution.guards import GuardWatch, Trip
from testbench.execution.operator import Operator
from testbench.execution.state_machine import FOLLOWING, RunState, StateMachine
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.session.session import Event, RunStatus
from testbench.records.specs.protocol_arm import Guard, Guards

SECOND = 1_000_000_000


def imu(times_s, field=(0.0, 24.0, -39.0)) -> ImuSamples:
    times = np.round(np.asarray(times_s) * SECOND).astype(np.int64)
    zero = np.zeros((len(times), 3))
    mag = np.tile(np.asarray(field, float), (len(times), 1))
    return ImuSamples(
        times, times, zero, zero, mag, None, np.arange(len(times)), np.zeros(len(times), bool)
    )


def arm(**extras: float) -> ArmSamples:
    zero = np.zeros((1, 1))
    return ArmSamples(
        ["elbow"],
        np.zeros(1, np.int64),
        zero,
        zero,
        zero,
        {key: np.array([value]) for key, value in extras.items()},
    )


NOTHING = imu([])


def test_a_silent_sensor_trips_once_and_again_after_it_was_heard():
    watch = GuardWatch(Guards(imu_silence_s=Guard(limit=1.0, action="stop")), ["hand"])
    assert watch.look(SECOND, arm(), {"hand": imu([0.9, 1.0])}) == []
    assert watch.look(int(1.9 * SECOND), arm(), {"hand": NOTHING}) == []
    (trip,) = watch.look(int(2.1 * SECOND), arm(), {"hand": NOTHING})
    assert (trip.guard, trip.subject, trip.action) == ("imu_silence_s", "hand", "stop")
    assert trip.sentence == "imu silence of hand: 1.1 s, the limit is 1 s"
    assert watch.look(int(2.5 * SECOND), arm(), {"hand": NOTHING}) == []
    watch.look(3 * SECOND, arm(), {"hand": imu([1.1])})
    assert len(watch.look(5 * SECOND, arm(), {"hand": NOTHING})) == 1


def test_a_gap_is_seen_within_a_piece_and_between_two():
    guards = Guards(sample_gap_s=Guard(limit=0.3, action="warn"))
    within = GuardWatch(guards, ["hand"])
    assert [trip.guard for trip in within.look(SECOND, arm(), {"hand": imu([0.0, 0.1, 0.6])})] == [
        "sample_gap_s"
    ]
    between = GuardWatch(guards, ["hand"])
    assert between.look(SECOND, arm(), {"hand": imu([0.0, 0.1])}) == []
    (trip,) = between.look(SECOND, arm(), {"hand": imu([0.5, 0.6])})
    assert trip.value == pytest.approx(0.4)


def test_a_disturbed_field_is_seen_against_the_sensors_own_beginning():
    no_gaps = Guard(limit=1, action="off")
    field = Guard(limit=20, action="pause")
    watch = GuardWatch(Guards(magnetic_disturbance_percent=field, sample_gap_s=no_gaps), ["hand"])
    usual = np.linspace(0, 1, 61)
    assert watch.look(SECOND, arm(), {"hand": imu(usual)}) == []
    assert watch.look(2 * SECOND, arm(), {"hand": imu(1.01 + usual / 61, (0, 26, -42))}) == []
    (trip,) = watch.look(3 * SECOND, arm(), {"hand": imu(2.02 + usual / 61, (0, 34, -55))})
    assert trip.value == pytest.approx(100 * (np.hypot(34, 55) / np.hypot(24, 39) - 1), rel=1e-6)


def test_heat_and_batteries_are_watched_where_they_are_reported():
    watch = GuardWatch(Guards(), ["hand"])
    (hot,) = watch.look(0, arm(temperature_elbow_degC=71.0), {})
    assert (hot.guard, hot.subject, hot.action) == ("temperature_degC", "elbow", "warn")
    (low,) = watch.look(0, arm(), {}, {"hand": [Event(0, "connected", {"battery_percent": 8})]})
    assert low.guard == "battery_percent"
    assert (
        watch.look(0, arm(), {}, {"hand": [Event(0, "connected", {"battery_percent": 80})]}) == []
    )


def test_a_guard_that_is_off_says_nothing():
    watch = GuardWatch(Guards(imu_silence_s=Guard(limit=0.1, action="off")), ["hand"])
    assert watch.look(100 * SECOND, arm(), {"hand": NOTHING}) == []


@given(st.lists(st.sampled_from(list(RunState)), max_size=12))
def test_only_allowed_changes_happen_and_each_is_told(wanted):
    told: list[tuple[RunState, RunState]] = []
    machine = StateMachine(lambda at_ns, old, new, why: told.append((old, new)))
    for state in wanted:
        before = machine.state
        if state in FOLLOWING[before]:
            machine.to(state)
            assert told[-1] == (before, state)
        else:
            with pytest.raises(BenchError, match="cannot become"):
                machine.to(state)
            assert machine.state is before
    ended = {RunState.DONE, RunState.FAULTED}
    assert all(old not in ended for old, _ in told)


def test_every_run_can_end_from_every_state_that_is_no_end():
    for state, following in FOLLOWING.items():
        assert not following or RunState.FAULTED in following
        if state in {RunState.PREPARED, RunState.APPROACHING, RunState.RUNNING, RunState.PAUSED}:
            assert RunState.STOPPING in following


def test_every_hazard_must_be_confirmed():
    asked: list[str] = []
    found = confirm_hazards(lambda sentence: asked.append(sentence) is None)
    assert found["confirmed"] == list(HAZARDS) and asked == list(HAZARDS.values())
    answers = iter([True, True, False])
    with pytest.raises(ArmRefused, match="mounting"):
        confirm_hazards(lambda sentence: next(answers))


def test_keys_pause_resume_and_stop():
    operator = Operator()
    for key, paused, stopped in (
        ("x", False, False),
        ("p", True, False),
        ("r", False, False),
        ("q", False, True),
    ):
        operator.key(key)
        assert (operator.pause_asked, operator.stop_asked) == (paused, stopped)


def test_a_simulated_run_says_what_a_guard_found_and_that_it_waits(tiny, tmp_path, clock):
    rule = "guards: {sample_gap_s: {limit: 0.001, action: pause}}\n"
    (tmp_path / "tiny.yaml").write_text(tiny.read_text(encoding="utf-8") + rule, encoding="utf-8")
    said: list[str] = []

    def hear(line: str) -> None:
        said.append(line)
        if line.startswith("PAUSED"):
            os.kill(os.getpid(), signal.SIGUSR2)

    session = execute(
        plan(tmp_path / "tiny.yaml"),
        tmp_path / "logs",
        options=RunOptions(speed="realtime", clock=clock, say=hear),
    )
    assert session.status is RunStatus.COMPLETED
    assert said[0].startswith("warning: sample gap of hand: ") and said[0].endswith(
        "the limit is 0.001 s"
    )
    assert said[1:] == [
        f"PAUSED (guard: {said[0].removeprefix('warning: ')}): SIGUSR2 goes on, SIGINT stops",
        "going on",
    ]


FIELD = Guards(
    magnetic_disturbance_percent=Guard(limit=20, action="warn"),
    sample_gap_s=Guard(limit=9, action="off"),
)


def disturbances(percents, seconds: float = 0.1) -> tuple[GuardWatch, list]:
    """What is told of a field that differs by so much from one look to the next."""
    watch, told, begin = GuardWatch(FIELD, ["hand"]), [], 1.0
    watch.look(SECOND, arm(), {"hand": imu(np.linspace(0, 1, 60), (0, 0, 50))})
    for percent in percents:
        begin += seconds
        trips = watch.look(
            round(begin * SECOND), arm(), {"hand": imu([begin], (0, 0, 50 * (1 + percent / 100)))}
        )
        told += [(round(begin, 3), trip) for trip in trips]
    return watch, told


def test_a_field_about_its_limit_is_told_once_and_counted():
    watch, told = disturbances([19.9, 20.1] * 50)
    assert [time for time, _ in told] == [1.2]
    assert watch.counts == {"magnetic_disturbance_percent of hand": 50}


def test_it_is_told_again_once_it_was_clearly_below_for_some_seconds():
    clearly, barely = [10.0] * 32, [17.0] * 100
    assert len(disturbances([21, *barely, 21])[1]) == 1
    assert len(disturbances([21, *clearly, 21])[1]) == 2
    assert len(disturbances([21, *clearly[:20], 18, *clearly[:20], 21])[1]) == 1, (
        "not for long enough at a time"
    )


@given(st.lists(st.floats(0, 40), min_size=1, max_size=60))
def test_between_two_warnings_the_field_was_clearly_below_for_three_seconds(percents):
    _, told = disturbances(percents, 0.5)
    for (before, _), (after, _) in itertools.pairwise(told):
        times = 1 + 0.5 * np.arange(1, len(percents) + 1)
        between = (times > before) & (times < after)
        assert (np.array(percents)[between] < 16.0001).sum() >= 7


@pytest.mark.parametrize(
    ("value", "shown"), [(20.0253, "20.03"), (20.1, "20.1"), (20.0004, "20.0004"), (35.27, "35.3")]
)
def test_the_value_is_visibly_beyond_its_limit(value, shown):
    trip = Trip("magnetic_disturbance_percent", "hand", value, 20.0, "warn")
    assert trip.sentence == f"magnetic disturbance of hand: {shown} %, the limit is 20 %"


def board(
    times_s: np.ndarray, device_s: np.ndarray | None = None, noise: float = 0.01
) -> ImuSamples:
    """Samples of a board that noise makes differ."""
    samples = imu(times_s)
    rng = np.random.default_rng(len(times_s))
    device = times_s if device_s is None else device_s
    return replace(
        samples,
        device_time_ns=np.round(device * SECOND).astype(np.int64),
        gyr=noise * rng.standard_normal((len(times_s), 3)),
    )


def heard(samples: ImuSamples, live: bool = True) -> list[tuple[str, float]]:
    """What the usual guards say of a board, looked at every tenth of a second, and when [s]."""
    watch, told = GuardWatch(Guards(), ["hand"], live), []
    for now in np.arange(0.1, samples.host_time_ns[-1] / SECOND, 0.1):
        chosen = (samples.host_time_ns <= now * SECOND) & (
            samples.host_time_ns > (now - 0.1) * SECOND
        )
        part = {name: values[chosen] for name, values in samples.to_columns().items()}
        chunk = ImuSamples.from_columns(part)
        trips = watch.look(round(now * SECOND), arm(), {"hand": chunk})
        told += [(trip.guard, now) for trip in trips]
    return told


TIMES = np.arange(0.01, 4, 0.01)
FROM = np.minimum(TIMES, 1.5)
"""A clock that stands still from 1.5 s on."""
BURSTS = np.ceil(TIMES)


@pytest.mark.parametrize(
    ("samples", "guard"),
    [
        (board(TIMES, FROM), "stuck_time_s"),
        (board(TIMES, noise=0.0), "stuck_reading_s"),
        (board(BURSTS, TIMES), "arrival_gap_s"),
    ],
    ids=["frozen time", "one line for ever", "bursts"],
)
def test_a_live_board_that_sticks_or_comes_in_bursts_is_told_within_two_seconds(samples, guard):
    begin = 1.5 if guard == "stuck_time_s" else 0.0
    (first, when), *more = heard(samples)
    assert (first, more) == (guard, []) or (guard == "arrival_gap_s" and first == guard)
    assert begin < when <= begin + 2.0
    assert heard(samples, live=False) == []


def test_a_board_that_works_is_not_told_of():
    assert heard(board(TIMES)) == []


def test_what_happens_to_a_sensor_is_said_and_the_same_not_twice_in_ten_seconds():
    words = DeviceWords()

    def said(*events: tuple[float, str, dict]) -> list[str]:
        happened = [Event(round(at * SECOND), name, details) for at, name, details in events]
        return list(words.lines({"hand": happened}))

    lost = ("disconnected", {"reason": "no such device"})
    assert said((1, *lost), (1.5, "reconnected", {"gap_s": 0.5}), (2, *lost)) == [
        "warning: hand: its connection was lost: no such device",
        "warning: hand: it is connected again, after 0.5 s",
    ]
    assert said((10.9, *lost)) == []
    assert len(said((11.1, *lost))) == 1
    (line,) = said((20, "temperature", {}), (20, "malformed_lines", {"count": 3, "why": "is odd"}))
    assert line.startswith(
        "warning: hand: 3 lines within a second do not fit its format, the first"
    )
    assert "the first is odd;" in line
