"""A few of what the campaigns of crashes, full disks and damaged sessions ask by the hundred."""

from __future__ import annotations

import pytest

from tests.benchmarks.crash_points import Crashes
from tests.benchmarks.damaged_sessions import Seeds
from tests.benchmarks.full_disks import Disks
from tests.processes import NO_DISK

pytestmark = pytest.mark.slow


def test_a_command_that_dies_at_an_operation_on_files_leaves_nothing_that_is_believed(tmp_path):
    crashes = Crashes(tmp_path, ("import", "evaluate"))
    assert min(crashes.counts.values()) > 20
    tried = [crashes.trial(*point) for point in crashes.points[:4]]
    assert [one for one in tried if one["failure"]] == []


def test_a_disk_that_takes_no_more_is_told_in_a_sentence_and_nothing_half_is_left(tmp_path):
    disks = Disks(tmp_path, ("import", "export mcap"))
    if not disks.points:
        pytest.skip(NO_DISK)
    tried = [disks.trial(*point) for point in disks.points[:4]]
    assert [one for one in tried if one["failure"]] == []
    assert sum(one["code"] == 3 for one in tried) > 1


def test_damaged_sessions_are_analysed_or_refused_in_a_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    seeds = Seeds(tmp_path, ("brought",))
    tried = [seeds.trial(number) for number in range(8)]
    assert [one for one in tried if one["failure"]] == []
    assert any(one["reached"] == 2 for one in tried)
