"""Options that several commands share, and what they mean."""

from __future__ import annotations

from typing import Annotated, Any

import typer


def complete_protocol(incomplete: str) -> list[str]:
    """Names of protocols that begin so."""
    from testbench.records.shipped import shipped_folder

    return [
        path.stem
        for path in shipped_folder("protocols").glob("*.yaml")
        if path.stem.startswith(incomplete)
    ]


def complete_robot(incomplete: str) -> list[str]:
    """Names of robots that begin so."""
    from testbench.records.robot import list_robots

    return [name for name in list_robots() if name.startswith(incomplete)]


ProtocolArgument = Annotated[
    str,
    typer.Argument(
        help="Protocol file, or the name of one that ships with the bench.",
        autocompletion=complete_protocol,
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        help="Robot name, robot.yaml or URDF, in place of the protocol's.",
        autocompletion=complete_robot,
    ),
]


def exit_code(evaluation: Any) -> int:
    """0 pass or no limits, 1 when a limit was broken or what it limits could not be measured."""
    return int(evaluation.limited and evaluation.outcome in {"fail", "not_measured"})
