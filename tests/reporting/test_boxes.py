"""Box plots stand in the order in which they are named."""

from __future__ import annotations

import numpy as np

from testbench.records.results.study import BoxNumbers
from testbench.reporting.page.figures import box_plots


def test_the_first_box_is_the_uppermost_and_each_has_its_own_numbers():
    values = {name: k + np.arange(9.0) for k, name in enumerate(("a", "b", "c"))}
    boxes = {name: BoxNumbers.of(own) for name, own in values.items()}
    figure = box_plots(boxes, dict.fromkeys(boxes, "#112233"), "error [deg]")
    # plotly counts categories from the bottom
    assert figure["layout"]["yaxis"]["categoryarray"] == ["c", "b", "a"]
    drawn = {trace["name"]: trace["median"] for trace in figure["data"]}
    assert drawn == {"a": [4.0], "b": [5.0], "c": [6.0]}
