"""A whole recording put through the gates at once."""

from __future__ import annotations

import numpy as np

from testbench.consistency.doubtful import Belief, Gates, without
from testbench.consistency.traits import Traits
from testbench.estimation.signals.quality import Inspection, Quality, findings_on
from testbench.records.session.samples import ImuSamples


def assess(
    samples: ImuSamples, static: np.ndarray, belief: Belief | None = None
) -> tuple[Quality, ImuSamples]:
    """Put a whole recording through the gates.

    Args:
        samples: As recorded.
        static: Whether each is at rest, shape (n,), bool.
        belief: What a person says of them.

    Returns:
        What was found, and the samples with NaN for what is unknown.
    """
    gates = Gates(Traits(belief.has_noise if belief else True).add(samples), belief or Belief())
    inspection, doubts = Inspection(gates), gates.doubt(samples)
    flags = inspection.flags(samples, doubts, slice(None))
    known = without(samples, doubts.unknown)
    found = [*inspection.findings(), *findings_on(known, static)]
    return Quality(flags, found, inspection.counts), known
