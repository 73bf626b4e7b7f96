"""Whether a Universal Robots dashboard answers, before the client library connects to it."""

from __future__ import annotations

import socket
from contextlib import suppress

DASHBOARD_PORT = 29999
GREETING = b"Universal Robots Dashboard Server"
"""A dashboard says it first (Dashboard Server e-Series manual)."""
ANSWER_S = 2.0


def greet_dashboard(
    host: str, port: int = DASHBOARD_PORT, patience_s: float = ANSWER_S
) -> str | None:
    """What is wrong at an address, in a sentence; None if a dashboard answers.

    Args:
        host: Name or address of the controller.
        port: Of its dashboard.
        patience_s: For the connection, and for each answer [s].
    """
    said = b""
    try:
        with socket.create_connection((host, port), patience_s) as connection:
            with suppress(TimeoutError):
                said = connection.recv(200)
            if not said:  # a dashboard speaks first, others wait for a request
                connection.sendall(b"PolyscopeVersion\n\n")
                said = connection.recv(200)
    except (OSError, UnicodeError) as error:
        reason = (
            "timed out"
            if isinstance(error, TimeoutError)
            else getattr(error, "strerror", None) or str(error)
        )
        return f"no controller answers at {host}, port {port}: {reason}"
    if GREETING in said:
        return None
    lines = said.decode("ascii", "replace").splitlines()
    heard = "".join(c if c.isprintable() else "?" for c in lines[0])[:60] if lines else ""
    return f"{host}, port {port}, answers, but not like a UR dashboard ('{heard}')"
