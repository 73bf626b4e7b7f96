"""A robot arm turned into a metrology bench for inertial sensors.

    from testbench import plan, execute, estimate, evaluate

The four stages, `gait` of a walk beside them with its `GaitSettings`, `RunOptions` of a run,
`Session` to open a recording, `compare` for several, and `plot`, the figures; each is loaded when
it is first used.
"""

from __future__ import annotations

import os
import sys

if sys.version_info < (3, 11):  # noqa: UP036  (before anything that such a Python cannot read)
    raise SystemExit(
        f"testbench needs Python 3.11, 3.12 or 3.13; {sys.executable} is Python "
        f"{sys.version_info[0]}.{sys.version_info[1]}"
    )

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from testbench.estimation import estimate
    from testbench.estimation.gait import GaitSettings, gait
    from testbench.evaluation import evaluate
    from testbench.execution import RunOptions, execute
    from testbench.pipeline.compare import compare
    from testbench.planning import plan
    from testbench.records.session.session import Session
    from testbench.reporting import plot
    from testbench.reporting.report import report

__all__ = [
    "GaitSettings",
    "RunOptions",
    "Session",
    "compare",
    "estimate",
    "evaluate",
    "execute",
    "gait",
    "plan",
    "plot",
    "report",
]

_HOMES = {
    "plan": "testbench.planning",
    "execute": "testbench.execution",
    "RunOptions": "testbench.execution",
    "estimate": "testbench.estimation",
    "evaluate": "testbench.evaluation",
    "gait": "testbench.estimation.gait",
    "GaitSettings": "testbench.estimation.gait",
    "report": "testbench.reporting.report",
    "compare": "testbench.pipeline.compare",
    "Session": "testbench.records.session.session",
}


# Products of matrices here are of a few rows or columns: threads of BLAS that wait for work cost
# more than they do, on a busy machine many times the whole. Only NumPy's start can be told so; a
# program that has loaded it already, or that sets the variable, has decided for itself.
if "numpy" not in sys.modules:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def __getattr__(name: str) -> Any:
    if name == "plot":
        return import_module("testbench.reporting.plot")
    if name not in _HOMES:
        raise AttributeError(f"module 'testbench' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
