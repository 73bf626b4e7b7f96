"""One bench on a machine drives a controller at a time."""

from __future__ import annotations

import subprocess
import sys

import pytest

from testbench.drivers.arms.controller_lock import ControllerLock

HOLD = """
import sys
from testbench.drivers.arms.controller_lock import ControllerLock
print(ControllerLock(sys.argv[1]).take(), flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


def test_a_controller_is_locked_until_it_is_let_go_and_others_are_not():
    first, second, other = (
        ControllerLock("127.0.0.9"),
        ControllerLock("127.0.0.9"),
        ControllerLock("127.0.0.10"),
    )
    assert first.take()
    assert not second.take()
    assert other.take()
    first.release()
    assert second.take()
    for lock in (first, second, other):
        lock.release()


def test_two_names_of_one_address_share_a_lock():
    assert ControllerLock("localhost").path == ControllerLock("127.0.0.1").path


def test_a_name_cannot_lead_out_of_the_folder(tmp_path):
    assert ControllerLock("../../no/host").path.parent == tmp_path


def test_a_killed_process_lets_go(tmp_path):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, "127.0.0.9"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={"TMPDIR": str(tmp_path), "PYTHONPATH": ":".join(sys.path)},
    )
    try:
        assert holder.stdout.readline() == "True\n"
        assert not ControllerLock("127.0.0.9").take()
    finally:
        holder.kill()
        holder.communicate()
    lock = ControllerLock("127.0.0.9")
    assert lock.take()
    lock.release()


def test_a_link_planted_in_the_folder_is_not_followed(tmp_path):
    target = tmp_path / "precious"
    lock = ControllerLock("127.0.0.9")
    lock.path.symlink_to(target)
    assert lock.take()
    assert not target.exists()
