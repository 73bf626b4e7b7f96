"""view: a session in rerun, with the arm, the sensors, their signals and errors, afterwards or
while it is recorded; the one door to rerun.
"""

from testbench.reporting.viewer.live_layout import LiveContent
from testbench.reporting.viewer.live_process import Shown, saved_live, shown_live
from testbench.reporting.viewer.live_scene import LiveScene
from testbench.reporting.viewer.process import Picture, Where, screenshot, view
from testbench.reporting.viewer.recording import save_recording, write_recording

__all__ = [
    "LiveContent",
    "LiveScene",
    "Picture",
    "Shown",
    "Where",
    "save_recording",
    "saved_live",
    "screenshot",
    "shown_live",
    "view",
    "write_recording",
]
