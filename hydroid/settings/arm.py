"""A hydraulic arm: an MJCF, and one YAML file with what MJCF cannot say.

The MJCF has links, joints, ranges, masses and meshes; its keyframes are the named poses. The YAML has the
actuators, in units of a drawing (mm, mm², cm³/rad).
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, Strict, ValidationInfo, model_validator

from hydroid.assets import find_config
from hydroid.errors import SettingsError
from hydroid.settings.linkage import Cylinder, LinearActuator, RotaryActuator
from hydroid.settings.load import Settings, load


def _from_folder(path: Path, info: ValidationInfo) -> Path:
    folder = (info.context or {}).get("folder")
    return path if folder is None else (folder / path).resolve()


Beside = Annotated[Path, Strict(False), AfterValidator(_from_folder)]
"""a path relative to the file that names it"""


class ArmFile(Settings):
    """The YAML file of an arm."""

    model: Beside
    """the arm's MJCF, relative to this file; its keyframes are the named poses"""
    actuators: dict[str, Annotated[Cylinder | RotaryActuator, Field(discriminator="kind")]] = Field(
        default_factory=dict[str, Cylinder | RotaryActuator]
    )
    """what turns the joints, by name; a joint that stage 2 does not drive needs none"""
    payload: str | None = None
    """site of the model where the gripper holds a payload's centre of mass; null: logs have no payloads"""
    pair: Beside | None = None
    """MJCF of a machine with two of these arms, whose joints are named right_JOINT and left_JOINT; null: the
    arm stands alone"""

    @model_validator(mode="after")
    def _one_geometry(self) -> "ArmFile":
        for name, one in self.actuators.items():
            if isinstance(one, Cylinder) and one.pivots is not None and one.triangle is not None:
                raise ValueError(f"actuators.{name}: pivots take the place of triangle: give one")
            if isinstance(one, Cylinder) and one.four_bar is not None and one.triangle is None:
                raise ValueError(f"actuators.{name}: four_bar needs a triangle")
        return self


@dataclass(frozen=True)
class Joint:
    """A hinge.

    Attributes:
        name: of the model's joint.
        range: smallest and largest angle [deg].
        continuous: whether it turns without stops, and `range` only limits what is shown and tested.
        actuator: what turns it; None: nothing that stage 2 knows.
    """

    name: str
    range: tuple[float, float]
    continuous: bool = False
    actuator: LinearActuator | RotaryActuator | None = None


@dataclass(frozen=True)
class Arm:
    """An arm as its MJCF and its YAML file describe it.

    Attributes:
        file: the YAML's settings.
        name: of the model.
        joints: in the order of the model, J of them.
        link_names: bodies that move and have mass, L of them: those of the joints in their order, then parts
            that are fixed to them.
        link_masses: of these [kg].
        poses: angle of each joint by the pose's name [rad].
    """

    file: ArmFile
    name: str
    joints: tuple[Joint, ...]
    link_names: tuple[str, ...]
    link_masses: tuple[float, ...]
    poses: dict[str, tuple[float, ...]]

    @property
    def model(self) -> Path:
        """The MJCF."""
        return self.file.model

    @property
    def payload(self) -> str | None:
        """Site of the model that holds a payload."""
        return self.file.payload

    @property
    def pair(self) -> Path | None:
        """The MJCF of two of these arms."""
        return self.file.pair

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names, (J,), from the base outwards."""
        return tuple(joint.name for joint in self.joints)

    @property
    def masses(self) -> NDArray[np.float64]:
        """Nominal masses [kg], shape (L,)."""
        return np.array(self.link_masses)

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower joint stops [rad], shape (J,); -inf where there is none."""
        return np.array([-np.inf if j.continuous else math.radians(j.range[0]) for j in self.joints])

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper joint stops [rad], shape (J,); inf where there is none."""
        return np.array([np.inf if j.continuous else math.radians(j.range[1]) for j in self.joints])

    def pose(self, name: str) -> NDArray[np.float64]:
        """Return a named pose [rad], shape (J,).

        Raises:
            SettingsError: no such pose, with the names there are.
        """
        if name not in self.poses:
            raise SettingsError(f"{self.name} has no pose {name!r}", hint=f"one of: {', '.join(self.poses)}")
        return np.array(self.poses[name])


def load_arm(name: str | Path, beside: Path | None = None) -> Arm:
    """Read an arm's YAML, found as `find_config` does, and its MJCF.

    Raises:
        SettingsError: no such file, a setting that is not allowed, or one that the model contradicts.
        ModelError: an MJCF that hydroid cannot simulate.
    """
    from hydroid.settings.arm_model import make_arm  # imports MuJoCo

    path = find_config(name, beside, kind="arm")
    return make_arm(load(path, ArmFile), str(path))
