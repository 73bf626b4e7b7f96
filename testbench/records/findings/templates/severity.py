"""Severity: how much a finding weighs."""

from __future__ import annotations

from enum import StrEnum


class Severity(StrEnum):
    """How much a finding weighs; what cannot be right at all is refused by an error instead."""

    NOTE = "note"
    """Worth knowing; no result is wrong by it."""
    WARNING = "warning"
    """A result may be wrong by it, or something was left out."""
