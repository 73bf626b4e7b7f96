"""estimate: recordings become orientations and joint angles on one clock and in one frame; offline
and pure.
"""

from testbench.estimation.estimator import estimate

__all__ = ["estimate"]
