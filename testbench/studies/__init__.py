"""Studies: questions asked of whole runs, whose tables stand beside published ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from testbench.exceptions import NotFoundError

if TYPE_CHECKING:
    from testbench.records.study import StudyRecord
    from testbench.studies.bench import StudyBench


@dataclass(frozen=True)
class Study:
    """A study that can be asked for by name; `module` has the function `run`."""

    name: str
    description: str
    module: str

    def run(self, bench: StudyBench) -> StudyRecord:
        """Run it; its module is loaded now."""
        function: Callable[[StudyBench], StudyRecord] = import_module(self.module).run
        return function(bench)


STUDIES = {
    study.name: study
    for study in (
        Study(
            "gimvebo",
            "Integrators in the calibration of a gyroscope on a gimbal, beside tables 4.1 to 4.7 of Botina & Vergara 2018",
            "testbench.studies.gimvebo",
        ),
        Study(
            "beta_zeta",
            "The two gains of Madgwick's filter, beside the sweeps of de Miguel Pueyo 2024, and what a true bias state gains",
            "testbench.studies.beta_zeta",
        ),
    )
}
"""Every study by its name."""


def get_study(name: str) -> Study:
    """A study by its name.

    Raises:
        NotFoundError: No such study; lists those that exist.
    """
    if name not in STUDIES:
        raise NotFoundError("study", name, list(STUDIES))
    return STUDIES[name]
