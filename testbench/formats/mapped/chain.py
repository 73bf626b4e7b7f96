"""The model that a mapping states for the chain filter: looked at before anything is written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from testbench.exceptions import BenchError, NotFoundError
from testbench.formats.mapping import MappingSpec
from testbench.model.kinematics import Kinematics
from testbench.records.disk.yaml_file import YamlDocument
from testbench.records.session.layout import CHAIN_ROBOT, CHAIN_URDF
from testbench.records.specs.protocol_chain import ChainEstimation
from testbench.records.specs.robot import Robot, load_robot

PLACE = ("estimate", "chain", "model")


def chain_of(
    document: YamlDocument[MappingSpec], sensors: list[str]
) -> tuple[ChainEstimation | None, dict[str, str]]:
    """The chain that a mapping asks for, and the files that the session keeps for it.

    A model that does not ship with the bench is kept in the session, which then needs no other
    file.

    Args:
        document: The mapping.
        sensors: Names of the sensors that the files have.

    Raises:
        FileProblems: The model is not there, or speaks of a sensor, a link or a joint that is not.
    """
    estimate = document.value.estimate
    chain = None if estimate is None else estimate.chain
    if chain is None or chain.model is None:
        return chain, {}
    robot = _robot(document, chain.model.robot)
    _check(document, robot, chain, sensors)
    if robot.file is None or not _is_path(chain.model.robot):
        return chain, {}
    try:
        urdf = robot.urdf.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise document.problem(f"{robot.urdf} cannot be read: {error}", *PLACE, "robot") from None
    model = chain.model.model_copy(update={"robot": CHAIN_ROBOT})
    kept = {CHAIN_ROBOT: robot.text, CHAIN_URDF: urdf}
    return chain.model_copy(update={"model": model}), kept


def _is_path(robot: str) -> bool:
    return Path(robot).suffix in {".yaml", ".yml", ".urdf"} or len(Path(robot).parts) > 1


def _robot(document: YamlDocument[MappingSpec], stated: str) -> Robot:
    """The model by its name, or by its path from the mapping's folder."""
    beside = document.file.parent / stated
    try:
        return load_robot(beside if _is_path(stated) else stated)
    except BenchError as error:
        raise document.problem(str(error), *PLACE, "robot") from None


def _check(
    document: YamlDocument[MappingSpec], robot: Robot, chain: ChainEstimation, sensors: list[str]
) -> None:
    """Refuse a model that speaks of what there is not."""
    model = chain.model
    assert model is not None
    links = Kinematics(robot).link_names

    def check(kind: str, name: str, known: list[str], *place: Any) -> None:
        if name not in known:
            error = NotFoundError(kind, name, known)
            raise document.problem(str(error), *place)

    for name, one in model.sensors.items():
        check("sensor of the mapping", name, sensors, *PLACE, "sensors", name)
        check(f"link of {robot.name}", one.link, links, *PLACE, "sensors", name, "link")
    for key in ("start_deg", "lengths_mm"):
        for joint in getattr(model, key):
            check(f"joint of {robot.name}", joint, robot.joint_names, *PLACE, key, joint)
    for i, name in enumerate(chain.sensors):
        check("sensor of the model", name, list(model.sensors), *PLACE[:2], "sensors", i)
    for i, joint in enumerate(chain.joints):
        check(f"joint of {robot.name}", joint, robot.joint_names, *PLACE[:2], "joints", i)
