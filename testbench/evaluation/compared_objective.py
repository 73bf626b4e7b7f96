"""One number for how near a filter comes to another orientation, for a tuning without a truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.evaluation.differences import compared_with
from testbench.evaluation.metrics import rms
from testbench.evaluation.objective import Objective
from testbench.exceptions import InputError, SessionError
from testbench.records.results.estimate import Estimate, SensorEstimate
from testbench.records.session.session import Session


class ComparisonJudge:
    """The objective of a session against an orientation that is no truth.

    Args:
        session: The recording.
        objective: What to compute, of a comparison.
        estimate: Of the session, with the orientation that is compared with.
        compare: Filter that it is by.

    Raises:
        SessionError: No sensor has that orientation.
    """

    def __init__(self, session: Session, objective: Objective, estimate: Estimate, compare: str):
        self._part, self._compare = objective.of_comparison, compare
        self._sensors: dict[str, SensorEstimate] = {
            name: sensor
            for name, sensor in estimate.sensors.items()
            if compare in sensor.orientation and objective.owner in (None, name)
        }
        if not self._sensors:
            reasons = [sensor.skipped.get(compare, "") for sensor in estimate.sensors.values()]
            why = next((reason for reason in reasons if reason), "it was not run")
            raise SessionError(f"{session.path}: {compare} cannot be compared with: {why}")

    def value(self, estimate: Estimate, filter_name: str) -> float:
        """Mean over the sensors of the RMS difference; infinite where it is no number [deg].

        Args:
            estimate: Of the same session, with this filter.
            filter_name: Which one.

        Raises:
            InputError: The filter could not run.
        """
        values = []
        for name, reference in self._sensors.items():
            own = estimate.sensors[name]
            if filter_name not in own.orientation:
                why = own.skipped.get(filter_name, "it was not run")
                raise InputError(
                    f"{estimate.session}: {filter_name} gives no orientation of {name}: {why}"
                )
            both = {
                filter_name: own.orientation[filter_name],
                self._compare: reference.orientation[self._compare],
            }
            found = compared_with(replace(own, orientation=both), filter_name, self._compare)
            if found is None:
                return float("inf")
            values.append(rms(np.degrees(getattr(found[2], self._part))))
        mean = float(np.mean(values))
        return mean if np.isfinite(mean) else float("inf")
