"""Orientations of sensors that follow from the joints of a chain."""

from __future__ import annotations

import numpy as np

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.results.chain import ChainEstimate
from testbench.records.session.session import Session


def chain_orientation(session: Session, one: ChainEstimate, sensor: str) -> np.ndarray:
    """Orientation of a sensor by the joints of a chain, with its mounting as the filter had it.

    Args:
        session: The recording.
        one: The estimate.
        sensor: On the chain.

    Returns:
        q_world_from_sensor at the estimate's instants, shape (n, 4).

    Raises:
        InputError: The sensor is not on it.
    """
    if sensor not in one.sensors:
        raise InputError(
            f"{session.path}: the chain '{one.key}' has no sensor '{sensor}'; it has "
            f"{', '.join(one.sensors)}"
        )
    robot, (link, mounting) = session.chain_robot, session.carried(sensor)
    assert robot is not None
    standing = one.facts.get("standing_deg", {})
    q = np.tile(
        np.radians([standing.get(name, 0.0) for name in robot.joint_names]), (len(one.mean), 1)
    )
    for i, joint in enumerate(one.joints):
        q[:, robot.joint_names.index(joint)] = one.mean[:, 0, i]
    fitted = one.facts.get("placement", {}).get("sensors", {}).get(sensor)
    turn = Pose.from_placement(mounting).R
    if fitted is not None:
        vector = np.radians([fitted["rotation_vector_deg"]])
        turn = turn @ rotation.to_matrix(rotation.from_rotation_vector(vector))[0]
    _, world_from_link = Kinematics(robot).link_poses([link], q)
    return rotation.from_matrix(world_from_link[:, 0] @ turn)
