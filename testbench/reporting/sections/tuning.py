"""What the report says of the filters' parameters, and of those that were tuned."""

from __future__ import annotations

from testbench.clock import utc_day
from testbench.records.results.estimate import Estimate
from testbench.reporting.page.page import Sentence
from testbench.reporting.page.tables import Cell, Row, Table, label, text

TUNED_HERE = "tuned on this session"


def parameter_table(estimate: Estimate) -> Table:
    """The parameters that each filter ran with, and where they came from."""
    rows = []
    for key, parameters in estimate.filter_parameters.items():
        used = estimate.tuned.get(key)
        values = ", ".join(f"{name} {value:.4g}" for name, value in parameters.items()) or "none"
        cells = [label(key), text(values, kind="wide")]
        own = estimate.set_parameters.get(key)
        set_here = [f"{', '.join(own)} set for this estimate"] if own else []
        if used is None:
            origin = "; ".join([*set_here, "defaults, or the protocol's"])
            rows.append(Row([*cells, text(origin), text(""), text("")]))
            continue
        where = TUNED_HERE if used.on_this_session else "not tuned on this session"
        badge = Cell(where, kind="badge marginal" if used.on_this_session else "")
        near = f" from {used.comparison}, no truth" if used.comparison else ""
        found = (
            f"{', '.join(used.tuned)} tuned for {used.objective}{near}, {utc_day(used.tuned_utc)}"
        )
        rows.append(
            Row(
                [
                    *cells,
                    text("; ".join([*set_here, found]), kind="wide"),
                    text(", ".join(used.tuned_on), kind="wide"),
                    badge,
                ]
            )
        )
    return Table(
        "Parameters of the filters",
        [Cell("filter"), Cell("parameters"), Cell("from"), Cell("tuned on"), Cell("here")],
        rows,
        "How to read: the errors of a filter that was tuned on this very session are those of a "
        "fit; what its parameters are worth shows on sessions that they were not tuned on.",
        folded=not estimate.tuned and not estimate.set_parameters,
    )


def fitted_here(filters: list[str]) -> Sentence:
    """A warning that stands under a ranking."""
    verb = "was" if len(filters) == 1 else "were"
    return Sentence(
        f"{', '.join(filters)} {verb} {TUNED_HERE}: the place in this ranking is that of a fit, "
        "not of a test."
    )
