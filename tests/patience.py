"""How long a test waits for what ends in seconds: a guard against what hangs, and no bar."""

from __future__ import annotations

PATIENCE_S = 600.0
"""A process that must first compile all kernels beside others, on a slow machine, takes minutes."""
