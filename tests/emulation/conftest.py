"""Emulated controllers in lock step."""

from tests.lock_step.bench import bench

__all__ = ["bench"]
