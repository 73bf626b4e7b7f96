"""execute: the only stage that talks to arms and sensors; it turns a plan into a session."""

from testbench.execution.executor import execute
from testbench.execution.options import RunOptions

__all__ = ["RunOptions", "execute"]
