"""Which specimens of its sensors a session was recorded with."""

from __future__ import annotations

from testbench.records.session.session import Session


def part_of(session: Session) -> str | None:
    """What tells the sensors of a session from others of their kind.

    Of simulated ones the seeds that they were drawn with, of others their tags.

    Returns:
        The same for the same parts; None where nothing tells them.
    """
    manifest = session.manifest
    if session.simulated:
        own = {name: sensor.part for name, sensor in session.analysis.sensors.items()}
        drawn = {name: manifest.seed if part is None else part for name, part in own.items()}
        return _named(
            "simulated, part ", {k: None if v is None else str(v) for k, v in drawn.items()}
        )
    return _named("", {name: own.device_tag for name, own in manifest.sensors.items()})


def _named(what: str, tags: dict[str, str | None]) -> str | None:
    """Tags in a row, those that are all alike once; None where one is not known."""
    known = {name: tag for name, tag in tags.items() if tag is not None}
    if not tags or len(known) < len(tags):
        return None
    alike = sorted(set(known.values()))
    return what + (alike[0] if len(alike) == 1 else ", ".join(known.values()))
