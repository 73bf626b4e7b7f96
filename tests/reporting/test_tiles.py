"""The numbers at the top of the report crown nobody whom the ranking does not."""

from __future__ import annotations

from dataclasses import replace

from testbench.records.results.evaluation import Evaluation, JointRow, Metric, OrientationRow
from testbench.records.results.evaluation_rows import RankRow
from testbench.reporting.sections.tiles import CRITERION, result_tiles

FLEXION = {"vqf_6d": 4.99, "gyro": 5.0, "vqf_9d": 3.21}
TOTAL = {"vqf_6d": 5.0, "gyro": 5.02, "vqf_9d": 24.0}


def judged(
    alike: dict[str, list[str]], total: dict[str, float] = TOTAL, left_out: tuple[str, ...] = ()
) -> Evaluation:
    """A sweep of a knee by three filters. By its flexion vqf_9d is nearest: its errors of heading
    and mounting cancel.
    """
    row = JointRow("knee", "gyro", "ZXY", "sweep", 0, "sweep", None, None, {}, 1, *[0.0] * 5, [])
    metrics = [
        Metric(
            "knee.flexion_mean_abs_error_deg",
            value,
            "deg",
            None,
            None,
            None,
            "",
            name,
            "ZXY",
            "sweep",
            0.2,
        )
        for name, value in FLEXION.items()
    ]
    ranks = [
        RankRow(*place, None, CRITERION, name, value, 1, 3, "a", alike.get(name, []))
        for place in (("knee", "sweep"), ("shank", None))
        for name, value in total.items()
        if name not in left_out
    ]
    own = [
        RankRow("knee", "sweep", "ZXY", "mean |flexion error|", name, value, 1, 3, "a")
        for name, value in FLEXION.items()
    ]
    sensor = [
        OrientationRow("shank", name, 9, value, value, 5.0, value) for name, value in total.items()
    ]
    return Evaluation(
        session="session",
        joint_angle=[row],
        orientation=sensor,
        metrics=metrics,
        ranking=[*own, *ranks] if total else [],
    )


def joint_and_sensor(evaluation: Evaluation):
    knee, shank = result_tiles(evaluation, {"knee": "ZXY"})
    return knee, shank


def test_the_filter_that_was_shown_to_be_best_by_its_whole_error_is_named():
    knee, shank = joint_and_sensor(judged({}))
    assert (knee.value, knee.title) == ("4.99", "mean |flexion error|, knee, sweep")
    assert knee.detail.startswith(
        "best: vqf_6d, by RMS total error 5.00 deg against 5.02 to 24.00 deg; ZXY (truth ± 0.20 "
        "deg)"
    )
    assert knee.detail.endswith("the others: 3.21 to 5.00 deg")
    assert shank.value == "5.00" and shank.detail.startswith("best: vqf_6d, by RMS total error")


def test_filters_that_were_not_shown_to_differ_give_a_range_and_no_best():
    knee, shank = joint_and_sensor(judged({"vqf_6d": ["gyro"], "gyro": ["vqf_6d"]}))
    assert knee.value == "4.99 to 5.00"
    assert knee.detail.startswith(
        "no difference shown between vqf_6d, gyro by RMS total error 5.00 to 5.02 deg; the others "
        "were"
    )
    assert shank.value == "5.00 to 5.02"
    everyone, _ = joint_and_sensor(judged({"vqf_6d": ["gyro", "vqf_9d"]}))
    assert everyone.value == "3.21 to 5.00"
    assert everyone.detail.startswith(
        "no difference shown between 3 filters by RMS total error 5.00 to 24.00 deg"
    )
    assert all("best" not in tile.detail for tile in (knee, shank, everyone))


def test_what_was_not_ranked_is_said():
    unranked = replace(judged({}), ranking=[])
    knee, shank = joint_and_sensor(unranked)
    assert knee.value == "3.21 to 5.00" and shank.value == "5.00 to 24.00"
    assert knee.detail.startswith("3 filters, too little was evaluated to rank them")
    drifted, _ = joint_and_sensor(judged({}, left_out=("gyro",)))
    assert (
        "best: vqf_6d, by RMS total error 5.00 deg against 24.00 deg; not ranked: gyro"
        in drifted.detail
    )
