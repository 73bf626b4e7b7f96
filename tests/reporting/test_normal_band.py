"""Normal bands: read from a file, moved to where a cycle begins, and missed where nothing fits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from testbench.exceptions import FileProblems, NotFoundError
from testbench.records.specs.band import Band, load_band
from testbench.reporting.page.page import Figures, Section
from testbench.reporting.sections.cycle import cycle_figure
from testbench.reporting.sections.normal import best_shift, normal_words, unused

PERCENT = np.arange(0, 101, 2.0)


@pytest.fixture(scope="module")
def boys() -> Band:
    return load_band("gait_boys")


def test_the_band_that_ships_says_where_it_is_from(boys: Band) -> None:
    assert "Olshen" in boys.source and boys.persons == 38
    knee = boys.curve("knee_r_flexion")
    assert knee is not None and max(knee.mean_deg) == 73.9
    assert boys.curve("knee_r_adduction") is None and boys.curve("kneeling_flexion") is None
    assert boys.curve("hip_flexion") is not None and boys.curve("ankle_flexion") is None


def test_a_band_goes_round(boys: Band) -> None:
    curve = boys.curve("hip_flexion")
    assert curve is not None
    mean, sd = curve.at(np.array([0.0, 100.0, 2.5, -97.5]))
    assert mean == pytest.approx([(42.9 + 43.5) / 2] * 2 + [42.9] * 2)
    assert (sd > 0).all()


@pytest.mark.parametrize("moved", [0, 12, -37, 49])
def test_a_cycle_that_begins_elsewhere_has_the_band_moved_there(boys: Band, moved: int) -> None:
    curve = boys.curve("knee_flexion")
    assert curve is not None
    angle = 0.8 * curve.at(PERCENT - moved)[0] + 7.0  # another range and zero
    assert best_shift(curve, PERCENT, angle) == moved
    cycle = {"percent": PERCENT}
    for key in ("estimated", "true", "error"):
        cycle |= {key: angle, f"{key}_sd": np.ones(len(angle))}
    trace = cycle_figure("knee", {"f": cycle}, {"f": "#123456"}, curve)["data"][0]
    assert trace["name"] == ("normal" if moved == 0 else f"normal, moved by {moved} %")
    low, high = trace["y"][: len(PERCENT)], trace["y"][len(PERCENT) :][::-1]
    mean, sd = curve.at(PERCENT - moved)
    assert low == pytest.approx(mean - sd, rel=1e-3) and high == pytest.approx(mean + sd, rel=1e-3)
    figures = Figures("f", {"f": {"data": [trace], "layout": {}}}, "")
    assert unused(boys, [Section("a", "A", [figures])]) is None


def test_a_band_that_fits_nothing_is_told(boys: Band) -> None:
    said = unused(boys, [Section("a", "A")])
    assert said is not None and "hip flexion, knee flexion" in said.text
    assert boys.source in normal_words(boys) and normal_words(None) == ""


def test_a_band_of_ones_own_is_read_and_a_faulty_one_refused(tmp_path: Path) -> None:
    file = tmp_path / "elbow.yaml"
    whole = (
        "description: nine persons who drink\nsource: our laboratory\npersons: 9\ncurves:\n"
        "  - {joint: elbow, percent: [0, 25, 50, 75], mean_deg: [10, 60, 120, 60],\n"
        "     sd_deg: [5, 5, 5, 5]}\n"
    )
    file.write_text(whole)
    assert load_band(str(file)).told == "elbow flexion"
    for wrong, said in (
        ("75]", "20]"),
        ("[5, 5, 5, 5]", "[5, 5, 5]"),
        ("persons: 9", "persons: 0"),
    ):
        file.write_text(whole.replace(wrong, said))
        with pytest.raises(FileProblems):
            load_band(str(file))
    with pytest.raises(NotFoundError, match="gait_boys"):
        load_band("girls")
