"""A hydraulic arm: an MJCF, and one YAML file with what MJCF cannot say.

The MJCF has links, joints, ranges, masses and meshes; its keyframes are the named poses. The YAML has the
actuators, in units of a drawing (mm, mm², cm³/rad).
"""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, Strict, ValidationInfo, model_validator

from hydroid.assets import find_config
from hydroid.errors import SettingsError
from hydroid.settings.arm_outline import Outline, read_outline
from hydroid.settings.linkage import Cylinder, LinearActuator, RotaryActuator
from hydroid.settings.load import Settings, load

if TYPE_CHECKING:
    from hydroid.settings.arm_model import ArmModel


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
    """An arm as its MJCF and its YAML file describe it; the MJCF is compiled when that is first needed.

    Attributes:
        file: the YAML's settings.
        outline: names and ranges of the model.
        where: begins messages about the settings.
    """

    file: ArmFile
    outline: Outline
    where: str = field(default="the arm's file", compare=False)

    @property
    def name(self) -> str:
        """Of the model."""
        return self.outline.name

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
        """Joint names, (J,), in the order of the model."""
        return self.outline.joint_names

    @property
    def link_names(self) -> tuple[str, ...]:
        """Bodies that move and have mass, (L,)."""
        return self.outline.link_names

    @property
    def ranges(self) -> tuple[tuple[float, float] | None, ...]:
        """Of the joints [deg], (J,); None: no stops."""
        return self.outline.ranges

    @property
    def actuators(self) -> tuple[Cylinder | RotaryActuator | None, ...]:
        """Settings of what turns the joints, (J,)."""
        return tuple(self.file.actuators.get(name) for name in self.joint_names)

    @cached_property
    def _compiled(self) -> "ArmModel":
        from hydroid.settings.arm_model import read_model  # imports MuJoCo

        return read_model(self)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """With their actuators, J of them."""
        return self._compiled.joints

    @property
    def masses(self) -> NDArray[np.float64]:
        """Nominal masses of the links [kg], shape (L,)."""
        return np.array(self._compiled.masses)

    @property
    def poses(self) -> dict[str, tuple[float, ...]]:
        """Angle of each joint by the pose's name [rad]."""
        return self._compiled.poses

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower joint stops [rad], shape (J,); -inf where there is none."""
        return np.radians([-np.inf if limits is None else limits[0] for limits in self.ranges])

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper joint stops [rad], shape (J,); inf where there is none."""
        return np.radians([np.inf if limits is None else limits[1] for limits in self.ranges])

    def pose(self, name: str) -> NDArray[np.float64]:
        """Return a named pose [rad], shape (J,).

        Raises:
            SettingsError: no such pose, with the names there are.
        """
        if name not in self.poses:
            raise SettingsError(f"{self.name} has no pose {name!r}", hint=f"one of: {', '.join(self.poses)}")
        return np.array(self.poses[name])


def load_arm(name: str | Path, beside: Path | None = None) -> Arm:
    """Read an arm's YAML, found as `find_config` does, and names in its MJCF.

    Raises:
        SettingsError: no such file, a setting that is not allowed, or a name that the model lacks.
        ModelError: no MJCF.
    """
    path = find_config(name, beside, kind="arm")
    return make_arm(load(path, ArmFile), str(path))


def make_arm(file: ArmFile, where: str) -> Arm:
    """Return the arm of an arm file's settings; `where` begins messages about them."""
    arm = Arm(file, read_outline(file.model), where)
    for name in file.actuators:
        if name not in arm.joint_names:
            hint = f"the model's joints: {', '.join(arm.joint_names)}"
            raise SettingsError(f"actuators.{name}: no such joint", where=where, hint=hint)
    if file.payload is not None and file.payload not in arm.outline.sites:
        raise SettingsError(f"payload: the model has no site {file.payload!r}", where=where)
    return arm
