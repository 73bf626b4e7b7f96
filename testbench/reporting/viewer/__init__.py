"""view: a session in rerun, with the arm, the sensors, their signals and errors; the one door to
rerun.
"""

from testbench.reporting.viewer.process import screenshot, view
from testbench.reporting.viewer.recording import save_recording, write_recording

__all__ = ["save_recording", "screenshot", "view", "write_recording"]
