"""Campaigns that ask a thing by the hundred: stopped at any moment, they go on where they were."""

from __future__ import annotations

import argparse
import fcntl
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "campaigns"


def resumed(
    name: str, count: int, trials: Callable[[range], Iterator[Any]], folder: Path = FOLDER
) -> list[Any]:
    """What trials 0 to count - 1 gave; those that an earlier call finished are not run again.

    Each is kept as a line of a file as soon as it is there. What another state of the source gave
    is left alone: its file has another name.

    Args:
        name: Of the campaign.
        count: Of trials.
        trials: Runs some, by their numbers, and gives what each came to as plain values.
        folder: That the file lies in.

    Raises:
        SystemExit: Another process is at the same campaign.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}_{source_hash()[:12]}.jsonl"
    with file.open("a", encoding="utf-8") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            sys.exit(f"the campaign {name} is under way in another process")
        done = finished(file)
        if done:
            print(f"{name}: {min(len(done), count)} of {count} were done before", flush=True)
        for found in trials(range(len(done), count)):
            stream.write(json.dumps(found) + "\n")
            stream.flush()
            done.append(found)
    return done[:count]


def finished(file: Path) -> list[Any]:
    """The trials in a file; a last line that was cut off is taken away."""
    whole, end, _ = file.read_bytes().rpartition(b"\n")
    os.truncate(file, len(whole + end))
    return [json.loads(line) for line in whole.splitlines()]


def source_hash() -> str:
    """SHA-256 over the source that is tested, and the tests that ask."""
    digest = hashlib.sha256()
    for folder in ("testbench", "robots", "protocols", "tests"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in {".py", ".yaml", ".urdf"}:
                digest.update(path.read_bytes())
    return digest.hexdigest()


def count_of(default: int, doc: str | None) -> int:
    """The number after --count on the command line."""
    parser = argparse.ArgumentParser(description=doc)
    parser.add_argument("--count", type=int, default=default, help="trials (%(default)s)")
    return int(parser.parse_args().count)
