"""plan: a protocol becomes a checked, timed motion that touches no hardware."""

from testbench.planning.planner import plan

__all__ = ["plan"]
