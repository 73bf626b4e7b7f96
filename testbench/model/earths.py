"""Earth frames of other filters, and the way between them and the bench's own, ENU."""

from __future__ import annotations

import numpy as np

HALF = float(np.sqrt(0.5))
Q_ENU_FROM = {
    "ENU": [1.0, 0.0, 0.0, 0.0],
    "NED": [0.0, HALF, HALF, 0.0],
    "NWU": [HALF, 0.0, 0.0, HALF],
}
"""q_enu_from_earth for east-north-up, north-east-down and north-west-up."""
