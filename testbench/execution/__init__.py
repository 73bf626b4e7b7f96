"""execute: the only stage that talks to arms and sensors; it turns a plan into a session."""

from testbench.execution.executor import execute

__all__ = ["execute"]
