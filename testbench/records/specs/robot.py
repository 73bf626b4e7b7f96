"""Robot: what the bench knows of an arm beside its URDF.

Limits with their reasons, mounting, servo, noise of its encoders. Of a bare URDF, what it does not
say is filled in, and told.
"""

from __future__ import annotations

import math
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from pydantic import Field, model_validator

from testbench.exceptions import FileProblems, InputError, NotFoundError, Problem
from testbench.records.disk.yaml_file import YamlDocument, load_yaml
from testbench.records.specs.magnetism import Magnetism
from testbench.records.specs.shipped import shipped_folder
from testbench.records.specs.strict import Placement, StrictModel
from testbench.records.specs.urdf_joint import (
    UrdfJoint,
    in_degrees,
    package_folders,
    read_urdf,
    zero_limits,
)

TIME_TO_FULL_SPEED = 0.25
"""Assumed time to reach full speed, and full acceleration [s]; gentle for a cobot, whose makers
state about 0.1 to 0.3 s.
"""
ASSUMED_SPEED_DEG_S = 180.0
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class Joint(StrictModel):
    """One joint of the arm, in the vendor's order."""

    name: str
    position_deg: Pair | None = Field(
        description="Lowest and highest angle [deg]; null: unlimited."
    )
    velocity_deg_s: float = Field(gt=0)
    acceleration_deg_s2: float = Field(gt=0)
    jerk_deg_s3: float = Field(gt=0)
    why: str = Field(description="Where these limits come from.")

    @model_validator(mode="after")
    def _ordered(self) -> Joint:
        if self.position_deg is not None and self.position_deg[0] >= self.position_deg[1]:
            raise ValueError(f"position_deg {self.position_deg} must be ordered: lowest, highest")
        return self


class Floor(StrictModel):
    """A horizontal plane the arm must not touch."""

    height_mm: float = Field(description="Height of the plane in the world frame [mm].")
    ignore: list[str] = Field(default=[], description="Links that stand on it.")
    why: str = ""


class Collision(StrictModel):
    """How collisions are judged."""

    margin_mm: float = Field(
        default=0.0, ge=0, description="Smallest clearance that is accepted [mm]."
    )
    ignore: list[Annotated[list[str], Field(min_length=2, max_length=2)]] = Field(
        default=[], description="Pairs of links that are never checked, beside neighbours."
    )
    why: str = ""


class Servo(StrictModel):
    """Dynamics of the simulated arm: each joint follows its reference as a second-order system."""

    natural_frequency_hz: float = Field(default=12.0, gt=0)
    damping_ratio: float = Field(default=1.0, gt=0)
    encoder_resolution_deg: float = Field(default=360 / 2**18, ge=0)
    encoder_noise_deg: float = Field(
        default=0.0005, ge=0, description="Standard deviation of one reading [deg]."
    )
    velocity_noise_deg_s: float = Field(
        default=0.02, ge=0, description="Standard deviation of one reading [deg/s]."
    )
    repeatability_deg: float = Field(
        default=0.003,
        ge=0,
        description="Standard deviation of the joint's true angle about its reading, drawn per "
        "move [deg].",
    )
    why: str = ""


class Uncertainty(StrictModel):
    """How far the truth that this arm gives may be off; standard uncertainties, for the budget of
    every reported error.

    The repeatability and the resolution of the encoders are those of `servo`.
    """

    joint_angle_deg: float | list[float] = Field(
        default=0.1,
        description="Of each joint's angle (the theta of Denavit & Hartenberg), by the calibration "
        "of the kinematics: one number, or one for each joint [deg].",
    )
    link_twist_deg: float = Field(
        default=0.12,
        ge=0,
        description="Of each joint's axis against the one before it: the twist alpha, and of "
        "parallel axes the tilt across as well [deg].",
    )
    link_length_mm: float = Field(
        default=0.2, ge=0, description="Of each link's length a [mm]; it moves, and turns nothing."
    )
    link_offset_mm: float = Field(
        default=0.2, ge=0, description="Of each link's offset d [mm]; it moves, and turns nothing."
    )
    mounting_deg: float = Field(
        default=0.5,
        ge=0,
        description="Of a sensor's rotation against its mounting as believed, about each axis "
        "[deg].",
    )
    levelling_deg: float = Field(
        default=0.1,
        ge=0,
        description="Of the base's tilt against the plumb line, about each horizontal axis [deg].",
    )
    reliability_percent: float = Field(
        default=25.0,
        gt=0,
        le=100,
        description="Relative uncertainty of these numbers; decides their degrees of freedom.",
    )
    why: str = Field(
        default="Assumed for an arm with nominal kinematics and sensors fixed by hand; see "
        "docs/uncertainty.md.",
        description="Where these numbers come from.",
    )

    @model_validator(mode="after")
    def _not_negative(self) -> Uncertainty:
        values = (
            self.joint_angle_deg
            if isinstance(self.joint_angle_deg, list)
            else [self.joint_angle_deg]
        )
        if not all(np.isfinite(value) and value >= 0 for value in values):
            raise ValueError(f"joint_angle_deg {self.joint_angle_deg} must not be negative")
        return self

    @property
    def degrees_of_freedom(self) -> float:
        """Of each of the numbers above (JCGM 100:2008, eq. G.3)."""
        return 0.5 / (self.reliability_percent / 100) ** 2


class Rates(StrictModel):
    """Rates of the controller."""

    control_hz: float = Field(default=500.0, gt=0)
    record_hz: float = Field(default=125.0, gt=0)


class RobotSpec(StrictModel):
    """The content of a robot.yaml."""

    name: str
    description: str = ""
    urdf: str = Field(
        description="Path of the URDF: below this file, or below example-robot-data with that "
        "prefix."
    )
    mesh_packages: list[str] = Field(
        default=[], description="Python distributions whose packages hold the meshes."
    )
    base: Placement = Field(
        default_factory=Placement, description="Pose of the arm's base in the world."
    )
    gravity_m_s2: Vector3 = Field(
        default=[0.0, 0.0, -9.80665], description="Gravity in the world frame."
    )
    joints: list[Joint] = Field(min_length=1)
    home_deg: list[float]
    stature_mm: float | None = Field(
        default=None,
        gt=500,
        lt=2500,
        description="Of the person that a model of a body is of [mm]; a recording of another one "
        "is scaled by it.",
    )
    payload_kg: float | None = Field(
        default=None,
        gt=0,
        description="The heaviest tool that the maker allows on the flange [kg]; null: not known, "
        "not checked.",
    )
    floor: Floor | None = None
    collision: Collision = Field(default_factory=Collision)
    servo: Servo = Field(default_factory=Servo)
    uncertainty: Uncertainty = Field(default_factory=Uncertainty)
    magnetism: Magnetism = Field(default_factory=Magnetism)
    rates: Rates = Field(default_factory=Rates)
    assumptions: list[str] = Field(
        default=[], description="What was filled in without a source; shown with every plan."
    )

    @model_validator(mode="after")
    def _home_fits(self) -> RobotSpec:
        if len(self.home_deg) != len(self.joints):
            raise ValueError(
                f"home_deg has {len(self.home_deg)} angles, the arm has {len(self.joints)} joints"
            )
        return self

    @model_validator(mode="after")
    def _uncertainty_fits(self) -> RobotSpec:
        angles = self.uncertainty.joint_angle_deg
        if isinstance(angles, list) and len(angles) != len(self.joints):
            raise ValueError(
                f"uncertainty: joint_angle_deg has {len(angles)} values, the arm has "
                f"{len(self.joints)} joints"
            )
        return self


class Robot:
    """An arm the bench can plan for: its specification, its URDF, and its limits in radians.

    Args:
        spec: The content of robot.yaml.
        urdf: Absolute path of the URDF.
        text: The specification as YAML, written verbatim into every session.
        file: Where it was read from; None where it was not, or is found by its name alone.
    """

    def __init__(self, spec: RobotSpec, urdf: Path, text: str, file: Path | None = None):
        self.spec, self.urdf, self.text, self.file = spec, urdf, text, file

    @property
    def name(self) -> str:
        return self.spec.name

    @property
    def joint_names(self) -> list[str]:
        return [joint.name for joint in self.spec.joints]

    @property
    def position_limits(self) -> np.ndarray:
        """Lowest and highest angle of each joint, shape (n, 2), [rad]; infinite where unlimited."""
        unlimited = [-np.inf, np.inf]
        return np.radians([joint.position_deg or unlimited for joint in self.spec.joints])

    @property
    def velocity_limits(self) -> np.ndarray:
        """Shape (n,), [rad/s]."""
        return np.radians([joint.velocity_deg_s for joint in self.spec.joints])

    @property
    def acceleration_limits(self) -> np.ndarray:
        """Shape (n,), [rad/s^2]."""
        return np.radians([joint.acceleration_deg_s2 for joint in self.spec.joints])

    @property
    def jerk_limits(self) -> np.ndarray:
        """Shape (n,), [rad/s^3]."""
        return np.radians([joint.jerk_deg_s3 for joint in self.spec.joints])

    @property
    def home(self) -> np.ndarray:
        """Shape (n,), [rad]."""
        return np.radians(self.spec.home_deg)

    @property
    def joint_angle_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of each joint's angle by the kinematic calibration, shape (n,)
        [rad].
        """
        return np.radians(
            np.broadcast_to(
                np.asarray(self.spec.uncertainty.joint_angle_deg, float), len(self.spec.joints)
            )
        )

    @property
    def gravity(self) -> np.ndarray:
        """Gravity in the world frame, shape (3,), [m/s^2]."""
        return np.asarray(self.spec.gravity_m_s2, float)

    def mesh_folders(self) -> list[Path]:
        """Folders that `package://` addresses of the URDF are looked up in."""
        folders = [self.urdf.parent, *package_folders(self.urdf)]
        folders.append(_example_robot_data().parent.parent)
        return folders + [_distribution_folder(name) for name in self.spec.mesh_packages]


def load_robot(name_or_path: str | Path) -> Robot:
    """Find an arm by name or by path.

    Args:
        name_or_path: A name that `list_robots` gives, or the path of a robot.yaml, of its folder,
            or of a bare URDF.

    Raises:
        NotFoundError: No such robot; lists those that exist.
        FileProblems: The robot file is malformed.
    """
    path = Path(name_or_path)
    if path.suffix in {".yaml", ".yml", ".urdf"} or path.is_dir():
        if not path.exists():
            raise InputError(f"robot file {path} does not exist")
        if path.suffix == ".urdf":
            return robot_from_urdf(path)
        return _robot_from_yaml(path / "robot.yaml" if path.is_dir() else path)
    name = str(name_or_path)
    folder = shipped_folder("robots") / name
    if (folder / "robot.yaml").is_file():
        return _robot_from_yaml(folder / "robot.yaml")
    entry = _catalogue().get(name)
    if entry is None:
        raise NotFoundError("robot", name, sorted(list_robots()))
    return robot_from_urdf(_example_robot_data() / entry.urdf, name=name, entry=entry)


def list_robots() -> dict[str, str]:
    """Names of the arms that can be asked for, with a line on each."""
    own = {
        path.parent.name: load_yaml(path, RobotSpec).value.description
        for path in sorted(shipped_folder("robots").glob("*/robot.yaml"))
    }
    return own | {
        name: entry.description for name, entry in _catalogue().items() if name not in own
    }


class CatalogueEntry(StrictModel):
    """An arm of example-robot-data that needs no robot.yaml of its own."""

    urdf: str
    description: str = ""
    joints: list[str] = Field(
        description="The arm's joints in the vendor's order; every other joint is locked."
    )
    home_deg: list[float]


class Catalogue(StrictModel):
    """The content of robots/example_robot_data.yaml."""

    robots: dict[str, CatalogueEntry]
    source: Literal["example-robot-data"] = "example-robot-data"


def robot_from_text(file: Path, urdf: Path) -> Robot:
    """The robot of a session, from the specification kept in it and the URDF it was run with."""
    document = load_yaml(file, RobotSpec)
    return Robot(document.value, urdf, document.text)


def _catalogue() -> dict[str, CatalogueEntry]:
    return load_yaml(shipped_folder("robots") / "example_robot_data.yaml", Catalogue).value.robots


def _robot_from_yaml(path: Path) -> Robot:
    document: YamlDocument[RobotSpec] = load_yaml(path, RobotSpec)
    prefix, _, rest = document.value.urdf.partition(":")
    urdf = (
        _example_robot_data() / rest
        if prefix == "example-robot-data"
        else path.parent / document.value.urdf
    )
    if not urdf.is_file():
        raise document.problem(f"the URDF {urdf} does not exist", "urdf")
    return Robot(document.value, urdf.resolve(), document.text, path.resolve())


def _example_robot_data() -> Path:
    return (
        _distribution_folder("example-robot-data") / "cmeel.prefix/share/example-robot-data/robots"
    )


def _distribution_folder(name: str) -> Path:
    try:
        return Path(str(distribution(name).locate_file("")))
    except PackageNotFoundError as error:
        raise InputError(
            f"the package '{name}', which this robot's meshes come from, is not installed"
        ) from error


def robot_from_urdf(
    path: Path, name: str | None = None, entry: CatalogueEntry | None = None
) -> Robot:
    """Describe the arm of a URDF.

    Args:
        path: The URDF.
        name: How to call the arm; its own name if None.
        entry: Which joints make up the arm, and where home is; all movable joints and their middle
            if None.

    Raises:
        FileProblems: Not a URDF, or one without the joints that are asked for.
    """
    root, found = read_urdf(path)
    arm = _arm_joints(path, found, entry)
    joints = [_joint(joint) for joint in arm]
    home = (
        entry.home_deg
        if entry
        else [0.0 if not j["position_deg"] else sum(j["position_deg"]) / 2 for j in joints]
    )
    data: dict[str, Any] = {
        "name": name or root.get("name") or path.stem,
        "description": entry.description if entry else f"from {path.name}",
        "urdf": str(path),
        "joints": joints,
        "assumptions": [
            f"{path.name} states no acceleration, jerk, servo or floor: full speed in "
            f"{TIME_TO_FULL_SPEED} s, a servo of "
            f"{Servo().natural_frequency_hz:g} Hz and no floor are assumed"
            + ("" if entry else ", and home in the middle of each joint's range"),
            *zero_limits(path, arm),
            *in_degrees(path, arm),
        ],
        "home_deg": home,
    }
    text = yaml.safe_dump(data, sort_keys=False)
    return Robot(
        RobotSpec.model_validate(data), path.resolve(), text, None if entry else path.resolve()
    )


def _arm_joints(
    path: Path, joints: dict[str, UrdfJoint], entry: CatalogueEntry | None
) -> list[UrdfJoint]:
    """The joints of a URDF that make up the arm, in the arm's order.

    Raises:
        FileProblems: It lacks some of them, one does not rotate, or limits or axes are none.
    """
    movable = {name: joint for name, joint in joints.items() if joint.movable}
    names = (
        entry.joints if entry else [key for key, joint in movable.items() if joint.mimics is None]
    )
    missing = [key for key in names if key not in movable]
    if missing or not names:
        raise FileProblems(
            path,
            [
                Problem(
                    f"the URDF lacks the movable joints {missing or 'of an arm'}; it has "
                    f"{sorted(movable)}"
                )
            ],
        )
    arm = [movable[key] for key in names]
    problems = [
        joint.problem("it is prismatic; the bench drives rotating joints only")
        for joint in arm
        if joint.kind == "prismatic"
    ]
    problems = problems or [problem for joint in arm for problem in joint.problems()]
    if problems:
        raise FileProblems(path, problems)
    return arm


def _joint(joint: UrdfJoint) -> dict[str, Any]:
    position = joint.position()
    speed = math.degrees(joint.speed())
    why = "position and velocity from the URDF"
    if speed <= 0:
        speed, why = (
            ASSUMED_SPEED_DEG_S,
            f"the URDF states no velocity: {ASSUMED_SPEED_DEG_S:.0f} deg/s assumed",
        )
    return {
        "name": joint.name,
        "position_deg": None if position is None else [math.degrees(end) for end in position],
        "velocity_deg_s": speed,
        "acceleration_deg_s2": speed / TIME_TO_FULL_SPEED,
        "jerk_deg_s3": speed / TIME_TO_FULL_SPEED**2,
        "why": f"{why}; acceleration and jerk assumed: full speed in {TIME_TO_FULL_SPEED} s",
    }
