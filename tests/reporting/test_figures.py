"""Figures: scales that show what is there, colours that can be told apart from the paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.reporting.page.figures import Axis, Curve, error_curves, heat_map
from testbench.reporting.page.palette import COLOURS, ORDERED, REFERENCE, rgb
from testbench.reporting.sections.outliers import common_top


def test_curves_far_below_others_are_not_left_flat() -> None:
    x = [0.0, 10.0, 20.0]
    own = [
        Curve("a", x, [0.02, 0.0, 0.05], "#123456", [0.01] * 3),
        Curve("b", x, [0.01, 0.03, None], "#654321", [0.01] * 3),
    ]
    far = Curve("published", x, [2.0, 5.0, 1.0], REFERENCE, dashed=True)
    flat = error_curves([*own, far], "x", "y")
    assert flat["layout"]["yaxis"]["type"] == "log"
    assert [trace["y"] for trace in flat["data"]] == [
        [0.02, None, 0.05],
        [0.01, 0.03, None],
        [2, 5, 1],
    ]  # no bands, no zero
    for beside in ([], [replace(far, hidden=True)], [replace(far, y=[0.1, 0.1, 0.2])]):
        shown = error_curves([*own, *beside], "x", "y")
        assert shown["layout"]["yaxis"]["rangemode"] == "tozero"
        assert "type" not in shown["layout"]["yaxis"]
        assert sum(trace.get("fill") == "toself" for trace in shown["data"]) == 2


def test_maps_share_a_scale_that_an_outlier_does_not_set_and_cross_what_lies_beyond() -> None:
    rng = np.random.default_rng(0)
    grids = {name: rng.uniform(0, 1, (5, 8)) for name in ("a", "b", "c", "d", "e")}
    everyone = np.concatenate([grid.ravel() for grid in grids.values()])
    assert common_top(grids) == pytest.approx(everyone.max())
    assert common_top(grids | {"runs": np.full((5, 8), 60.0)}) == pytest.approx(everyone.max())
    grids["a"][0, 0] = everyone[0] = 5.0
    assert common_top(grids) == pytest.approx(np.quantile(everyone, 0.98))
    z = np.array([[0.1, 3.0], [np.nan, 0.9]])
    x, y = Axis("x", [1.0, 2.0]), Axis("y", [10.0, 20.0])
    _, crosses = heat_map("t", x, y, z, "z", 1.0)["data"]
    assert (crosses["x"], crosses["y"]) == ([2.0], [10.0])
    assert len(heat_map("t", x, y, z, "z", 5.0)["data"]) == 1


def contrast(first: str, second: str) -> float:
    def luminance(colour: str) -> float:
        parts = [part / 255 for part in rgb(colour)]
        linear = [p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    light, dark = sorted((luminance(first), luminance(second)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("colour", [*COLOURS, *ORDERED, REFERENCE])
def test_every_colour_is_legible_on_light_and_on_dark(colour: str) -> None:
    assert contrast(colour, "#ffffff") >= 3
    assert contrast(colour, "#14171c") >= 3
