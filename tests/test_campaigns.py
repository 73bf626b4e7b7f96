"""A campaign that is stopped goes on where it was: `tests.benchmarks.resuming`."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.benchmarks import resuming
from tests.benchmarks.resuming import resumed


class Stopped(Exception):
    pass


@pytest.fixture
def trials():
    """A campaign of squares that notes what it was asked, and stops before a number if told so."""

    class Trials:
        asked: list[int] = []
        stop: int | None = None

        def __call__(self, numbers: range) -> Iterator[dict[str, int]]:
            for number in numbers:
                if number == self.stop:
                    raise Stopped
                self.asked.append(number)
                yield {"square": number**2}

    return Trials()


def test_a_campaign_that_was_stopped_asks_for_what_is_missing_only(trials, tmp_path) -> None:
    trials.stop = 3
    with pytest.raises(Stopped):
        resumed("squares", 5, trials, tmp_path)
    trials.stop = None
    found = resumed("squares", 5, trials, tmp_path)
    assert found == [{"square": number**2} for number in range(5)]
    assert trials.asked == [0, 1, 2, 3, 4]
    assert resumed("squares", 2, trials, tmp_path) == found[:2]
    assert len(resumed("squares", 6, trials, tmp_path)) == 6
    assert trials.asked == [0, 1, 2, 3, 4, 5]


def test_a_trial_that_was_cut_off_while_it_was_kept_is_run_again(trials, tmp_path) -> None:
    resumed("squares", 3, trials, tmp_path)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-4])
    assert resumed("squares", 3, trials, tmp_path) == [{"square": n**2} for n in range(3)]
    assert trials.asked == [0, 1, 2, 2]


def test_what_another_state_of_the_source_gave_is_not_taken(trials, tmp_path, monkeypatch) -> None:
    resumed("squares", 2, trials, tmp_path)
    monkeypatch.setattr(resuming, "source_hash", lambda: "another" * 8)
    resumed("squares", 2, trials, tmp_path)
    assert trials.asked == [0, 1, 0, 1]
    assert len(list(tmp_path.iterdir())) == 2


def test_two_processes_are_not_at_one_campaign(trials, tmp_path) -> None:
    class Within:
        def __call__(self, numbers: range) -> Iterator[int]:
            with pytest.raises(SystemExit, match="squares is under way in another process"):
                resumed("squares", 2, trials, tmp_path)
            yield from numbers

    assert resumed("squares", 2, Within(), tmp_path) == [0, 1]
    assert trials.asked == []
