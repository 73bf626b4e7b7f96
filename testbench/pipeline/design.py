"""Design a calibration as a request asks for it."""

from __future__ import annotations

import math
from pathlib import Path

from testbench.pipeline.request import DesignRequest
from testbench.planning.designed import DesignedProtocol, design_protocol
from testbench.planning.experiment_design import Wanted


def design(asked: DesignRequest) -> DesignedProtocol:
    """Design, compare, check and write a calibration protocol.

    Raises:
        InputError: The file exists, or there is no such sensor, or no such design.
    """
    wanted = Wanted(
        asked.poses,
        asked.turns,
        asked.joints,
        asked.criterion,
        asked.dwell_s,
        math.radians(asked.turn_deg),
        seed=asked.seed,
    )
    return design_protocol(
        Path(asked.out), asked.robot, asked.like, asked.sensor, wanted, asked.link
    )
