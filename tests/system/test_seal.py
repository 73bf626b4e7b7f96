"""Sessions that are verified and sealed on the command line; OpenSSL has the second word."""

from __future__ import annotations

import json
import shutil
import stat
import subprocess
from pathlib import Path

import pytest

from tests.command_line import command


@pytest.fixture
def place(quick, tmp_path, monkeypatch) -> Path:
    """A folder with a copy of a session and a pair of keys."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    shutil.copytree(quick.session.path, tmp_path / "session")
    assert command("seal", "--new-key", tmp_path / "key") == 0
    return tmp_path


def refused(capsys, *words: object) -> str:
    """What is said of a command that is refused."""
    capsys.readouterr()
    assert command(*words) == 2
    out, told = capsys.readouterr()
    assert told.startswith("error: ") and len(told.splitlines()) == 1 and not out
    return told


def test_a_sealed_session_is_verified_by_the_public_key(place, capsys):
    session = place / "session"
    assert command("seal", session, "--key", place / "key") == 0
    capsys.readouterr()
    assert command("verify", session, "--key", place / "key.pub", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["seal"] == "sealed by this key" and "imu_arm.parquet" in told["files"]
    assert command("evaluate", session) in {0, 1}
    assert command("verify", session, "--key", place / "key.pub") == 0


def test_the_seal_is_what_openssl_takes_for_one(place):
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    session = place / "session"
    assert command("seal", session, "--key", place / "key") == 0
    words = ["openssl", "pkeyutl", "-verify", "-pubin", "-rawin"]
    words += ["-inkey", str(place / "key.pub"), "-in", str(session / "manifest.json")]
    words += ["-sigfile", str(session / "manifest.json.sig")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_what_was_changed_together_with_its_hash_breaks_the_seal(place, capsys):
    session = place / "session"
    assert command("seal", session, "--key", place / "key") == 0
    manifest = json.loads((session / "manifest.json").read_text())
    shutil.copy(session / "truth_arm.parquet", session / "truth_forearm.parquet")
    manifest["files"]["truth_forearm.parquet"] = manifest["files"]["truth_arm.parquet"]
    (session / "manifest.json").write_text(json.dumps(manifest))
    assert command("verify", session) == 0
    assert "of whom is not known" in capsys.readouterr().out
    told = refused(capsys, "verify", session, "--key", place / "key.pub")
    assert "is no signature of manifest.json" in told


def test_another_key_or_none_is_told(place, capsys):
    session = place / "session"
    assert "is not sealed" in refused(capsys, "verify", session, "--key", place / "key.pub")
    assert command("seal", session, "--key", place / "key") == 0
    assert command("seal", "--new-key", place / "other") == 0
    assert "another key" in refused(capsys, "verify", session, "--key", place / "other.pub")


def test_a_session_brings_no_key_of_its_own(place, capsys):
    session = place / "session"
    assert command("seal", session, "--key", place / "key") == 0
    shutil.copy(place / "key.pub", session)
    shutil.copy(place / "key", session)
    told = refused(capsys, "verify", session, "--key", session / "key.pub")
    assert "lies in the session" in told
    assert "lies in the session" in refused(capsys, "seal", session, "--key", session / "key")
    assert "lies in the session" in refused(capsys, "seal", "--new-key", session / "export" / "k")


def test_private_keys_are_for_their_owner_alone(place, capsys):
    assert stat.S_IMODE((place / "key").stat().st_mode) == 0o600
    (place / "key").chmod(0o640)
    told = refused(capsys, "seal", place / "session", "--key", place / "key")
    assert "chmod 600" in told
    assert "exists already" in refused(capsys, "seal", "--new-key", place / "key")


@pytest.mark.parametrize("content", ["", "no key", "-----BEGIN PRIVATE KEY-----\nAAAA\n"])
def test_what_is_no_key_is_said(place, capsys, content):
    for name in ("key", "key.pub"):
        (place / name).write_text(content)
    assert "no private key" in refused(capsys, "seal", place / "session", "--key", place / "key")
    (place / "session" / "manifest.json.sig").write_bytes(bytes(64))
    told = refused(capsys, "verify", place / "session", "--key", place / "key.pub")
    assert "no public key" in told


def test_only_what_is_sound_and_closed_is_sealed(place, capsys):
    session = place / "session"
    manifest = json.loads((session / "manifest.json").read_text())
    (session / "manifest.json").write_text(json.dumps(manifest | {"status": "running"}))
    assert "is not closed" in refused(capsys, "seal", session, "--key", place / "key")
    (session / "manifest.json").write_text(json.dumps(manifest | {"files": {}}))
    assert "states no hashes" in refused(capsys, "seal", session, "--key", place / "key")
    assert "states no hashes" in refused(capsys, "verify", session)
    (session / "manifest.json").write_text(json.dumps(manifest))
    (session / "protocol.yaml").write_text("another")
    told = refused(capsys, "seal", session, "--key", place / "key")
    assert "protocol.yaml was changed" in told and not (session / "manifest.json.sig").exists()


@pytest.mark.parametrize(
    "words",
    [
        ("evaluate", "{}"),
        ("estimate", "{}"),
        ("report", "{}"),
        ("view", "{}", "--save", "{}.rrd"),
        ("export", "{}", "--to", "csv"),
        ("gait", "{}"),
        ("noise", "{}"),
        ("calibrate", "{}", "--sensor", "arm", "--out", "{}.yaml"),
        ("tune", "{}", "--filter", "madgwick_imu", "--out", "{}.json"),
    ],
    ids=lambda words: words[0],
)
def test_every_command_that_analyses_refuses_what_was_changed(place, capsys, words):
    session = place / "session"
    content = (session / "truth_arm.parquet").read_bytes()
    (session / "truth_forearm.parquet").write_bytes(content)
    told = refused(capsys, *(word.format(session) for word in words))
    assert "truth_forearm.parquet was changed" in told
    assert not list(place.glob("session.*"))
