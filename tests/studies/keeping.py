"""A study that is kept and read back."""

from __future__ import annotations

from pathlib import Path

from testbench.records.results.study import StudyRecord
from testbench.records.session.session import Session


def kept(study: StudyRecord, folder: Path, seed: int) -> StudyRecord:
    """The record as it comes back from its file; its sessions exist, with the seed of its part."""
    study.save(folder)
    again = StudyRecord.load(folder)
    assert again.to_dict() == study.to_dict()
    assert all(Session(path).manifest.seed == seed for path in again.sessions)
    return again
