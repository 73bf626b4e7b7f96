"""The command `design`: the calibration that tells most, as a protocol."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from testbench.cli.options import JsonOption, entries_of
from testbench.cli.output import say, say_json, say_table


class CriterionName(StrEnum):
    """What is made small."""

    D = "D"
    A = "A"


# Long by its options, one parameter each.
def design(
    out: Annotated[Path, typer.Option("--out", help="Protocol file to write.")],
    robot: Annotated[str, typer.Option("--robot", help="Robot name, robot.yaml or URDF.")] = "ur3e",
    like: Annotated[
        str,
        typer.Option(
            "--like",
            help="Protocol whose sensor is calibrated, and whose static poses are the comparison.",
        ),
    ] = "calibration_3d",
    sensor: Annotated[
        str | None, typer.Option("--sensor", help="Which of its sensors, where it has several.")
    ] = None,
    link: Annotated[
        str | None,
        typer.Option(
            "--link", help="Link that carries the sensor, where it is not the one of that protocol."
        ),
    ] = None,
    poses: Annotated[
        int, typer.Option("--poses", min=4, max=200, help="Number of static poses.")
    ] = 12,
    turns: Annotated[
        int,
        typer.Option(
            "--turns", min=0, max=200, help="Number of turns there and back, for the gyroscope."
        ),
    ] = 9,
    joints: Annotated[
        str | None,
        typer.Option(
            "--joints", help="Joints that may move, separated by commas; else the last three."
        ),
    ] = None,
    criterion: Annotated[
        CriterionName,
        typer.Option(
            "--criterion", help="D: volume of the confidence ellipsoid; A: sum of variances."
        ),
    ] = CriterionName.D,
    dwell: Annotated[
        float,
        typer.Option("--dwell", metavar="S", min=1, max=600, help="Rest at each pose in seconds."),
    ] = 5.0,
    turn: Annotated[
        float,
        typer.Option(
            "--turn-deg", metavar="DEG", min=10, max=180, help="Amplitude of a turn in degrees."
        ),
    ] = 90.0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the candidate poses.")] = 0,
    json: JsonOption = False,
) -> None:
    """Choose the poses and turns that leave a calibration least uncertain, and write them as a
    protocol.
    """
    from testbench.pipeline.design import design as carry_out
    from testbench.pipeline.request import DesignRequest

    asked = DesignRequest(
        out=str(out),
        robot=robot,
        like=like,
        sensor=sensor,
        link=link,
        poses=poses,
        turns=turns,
        joints=entries_of(joints or None),
        criterion=criterion.value,
        dwell_s=dwell,
        turn_deg=turn,
        seed=seed,
    )
    found = carry_out(asked)
    rows: list[list[Any]] = [
        [row.parameter, row.unit, row.compared, row.designed, row.ratio] for row in found.rows
    ]
    if json:
        keys = ["parameter", "unit", f"sd_{found.compared}", "sd_designed", "ratio"]
        listed = [dict(zip(keys, row, strict=True)) for row in rows]
        compared = {"protocol": found.compared, "robot": found.compared_on}
        say_json(
            {
                "file": str(out),
                "duration_s": found.plan.duration,
                "parameters": listed,
                "efficiency": found.efficiency,
                "compared": compared,
            }
        )
        return
    say_table(
        f"Predicted standard uncertainty, {poses} poses and {turns} turns against "
        f"{found.compared}, each as it is",
        ["parameter", "unit", found.compared, "designed", "ratio"],
        rows,
    )
    say(found.sentence)
    say(found.remark)
    say(f"written: {out}, {found.plan.duration:.0f} s on {found.plan.robot.name}")
