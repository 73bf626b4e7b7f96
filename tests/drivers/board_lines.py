"""The lines of a serial board whose readings tell their number."""

from __future__ import annotations

from testbench.drivers.imus.line_format import LineFormat


def make_format(**changes: object) -> LineFormat:
    """`t ax ay az gx gy gz` in ms, g and deg/s at 400 Hz, with changes."""
    columns = [
        {"quantity": "time", "unit": "ms", "wrap_bits": 32},
        {"quantity": "acceleration", "unit": "g", "full_scale": 2.0},
        {"quantity": "angular_rate", "unit": "deg/s", "full_scale": 250.0},
    ]
    base: dict[str, object] = {"description": "board", "rate_hz": 400.0, "columns": columns}
    return LineFormat.model_validate(base | changes)


def line(number: int, period_ms: float = 2.5) -> bytes:
    """Line of a sample whose readings tell its number."""
    return b"%.1f 0.5 -0.25 1 %d %.1f -3\r\n" % (
        number * period_ms,
        number % 200,
        number / 10 % 100,
    )
