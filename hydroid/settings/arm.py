"""A serial hydraulic arm: links, joints, cylinders and named poses, from one YAML file.

Units are those of a drawing (m, deg, mm, mm², cm³/rad); other packages turn them into SI.
"""

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, model_validator

from hydroid.assets import find_config
from hydroid.errors import SettingsError
from hydroid.settings.linkage import (
    STROKE_TOLERANCE,
    Direction,
    LinearActuator,
    RotaryActuator,
    Vector,
    four_bar,
)
from hydroid.settings.load import Settings, load
from hydroid.settings.parts import Base, FixedPart, Link, Name, Pair, PayloadPlace
from hydroid.settings.pivots import place_pivots


class Joint(Settings):
    """A hinge; it moves the link at the same position in the list of links."""

    name: Name
    """name of the joint"""
    axis: Direction
    """direction of the axis in the parent link's frame at angle 0"""
    at: Vector
    """position in the parent link's frame [m]"""
    range: tuple[float, float]
    """smallest and largest angle [deg]"""
    continuous: bool = False
    """true: the joint turns without stops, and `range` only limits the viewer's slider"""
    actuator: Annotated[LinearActuator | RotaryActuator, Field(discriminator="kind")] | None = None
    """what turns the joint; its `kind` decides which settings it has. Stage 1 needs none"""

    @model_validator(mode="after")
    def _possible(self) -> "Joint":
        low, high = self.range
        if not low < high:
            raise ValueError(f"joint {self.name}: range must be [lower, upper] in deg with lower < upper")
        if isinstance(self.actuator, LinearActuator):
            _check_cylinder(self, self.actuator)
        return self


class Arm(Settings):
    """A serial arm: `links[i]` hangs on `links[i - 1]` (the first on the base) by `joints[i]`."""

    name: str
    """name of the arm"""
    model: Annotated[Path, Strict(False)]
    """the MJCF model, relative to this file"""
    meshes: Annotated[Path, Strict(False)] = Path("meshes")
    """folder of the STL files, relative to this file"""
    base: Base = Base()
    links: Annotated[tuple[Link, ...], Field(min_length=1)]
    """the links, from the base outwards"""
    fixed: tuple[FixedPart, ...] = ()
    """parts bolted to links"""
    joints: tuple[Joint, ...]
    """the joints, from the base outwards"""
    payload: PayloadPlace | None = None
    """where the gripper holds a payload; null: logs have no payloads"""
    pair: Pair | None = None
    """two of these arms on one carrier; null: it stands alone"""
    poses: dict[Name, tuple[float, ...]]
    """named poses: the angle of each joint, by name [deg]"""

    @model_validator(mode="before")
    @classmethod
    def _pivots_as_triangles(cls, values: Any) -> Any:
        """Turn cylinders that are given by their two pivots into triangles."""
        return place_pivots(values) if isinstance(values, dict) else values

    @model_validator(mode="after")
    def _consistent(self) -> "Arm":
        if len(self.joints) != len(self.links):
            raise ValueError(f"{len(self.links)} links need as many joints, not {len(self.joints)}")
        for what, names in (("joint", self.joint_names), ("link", ("base", *self.link_names))):
            double = next((n for n in names if names.count(n) > 1), None)
            if double:
                raise ValueError(f"two {what}s are named {double}")
        moving = [link.name for link in self.links]
        carried = {part.name: part.carried_by for part in self.fixed}
        for name, link in (carried | ({"payload": self.payload.carried_by} if self.payload else {})).items():
            if link not in moving:
                raise ValueError(f"{name} is carried by {link!r}, which is not one of: {', '.join(moving)}")
        for name, pose in self.poses.items():
            if len(pose) != len(self.joints):
                raise ValueError(f"pose {name} needs {len(self.joints)} angles in deg, not {len(pose)}")
            for joint, angle in zip(self.joints, pose, strict=True):
                if not joint.continuous and not joint.range[0] <= angle <= joint.range[1]:
                    raise ValueError(
                        f"pose {name}: joint {joint.name} at {angle:g} deg is outside its range {joint.range}"
                    )
        return self

    @property
    def parts(self) -> tuple[Link, ...]:
        """Everything that has mass: the links in order, then the fixed parts."""
        return (*self.links, *self.fixed)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names, (J,), from the base outwards."""
        return tuple(joint.name for joint in self.joints)

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of everything that has mass, (L,)."""
        return tuple(part.name for part in self.parts)

    @property
    def masses(self) -> NDArray[np.float64]:
        """Nominal masses [kg], shape (L,)."""
        return np.array([part.mass for part in self.parts])

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
        return np.radians(self.poses[name])


def load_arm(name: str | Path, beside: Path | None = None) -> Arm:
    """Read an arm's YAML, found as `find_config` does; its `model` and `meshes` become absolute.

    Raises:
        SettingsError: no such file, or a setting that is not allowed.
    """
    path = find_config(name, beside, kind="arm")
    arm = load(path, Arm)
    folder = path.resolve().parent
    places: dict[str, Any] = {name: (folder / getattr(arm, name)).resolve() for name in ("model", "meshes")}
    if arm.pair is not None:
        places["pair"] = arm.pair.model_copy(update={"model": (folder / arm.pair.model).resolve()})
    return arm.model_copy(update=places)


def _check_four_bar(joint: Joint, actuator: LinearActuator) -> None:
    """Refuse a linkage that cannot be closed, or that passes a dead centre, within the joint's range."""
    with np.errstate(all="ignore"):
        arm = actuator.moment_arm(np.radians(np.linspace(*joint.range, 181)))
        turned = four_bar(np.radians(np.linspace(*joint.range, 181)), actuator.four_bar)[1]
    if not (np.isfinite(arm).all() and (turned * turned[0] > 0).all() and (arm * arm[0] > 0).all()):
        raise ValueError(
            f"joint {joint.name}: its four-bar linkage does not reach all of its range or has a dead centre"
        )


def _check_cylinder(joint: Joint, actuator: LinearActuator) -> None:
    """Refuse a triangle that is flat within the joint's range, and a stroke too short for the range."""
    if joint.continuous:
        raise ValueError(f"joint {joint.name}: a continuous joint needs a rotary actuator")
    if actuator.four_bar is not None:
        _check_four_bar(joint, actuator)
    first, last = sorted(actuator.sense * angle + actuator.theta0 for angle in joint.range)
    if actuator.four_bar is None and (first <= 0 or last >= 180):
        what = "range + theta0" if actuator.extends == "positive" else "theta0 - range"
        raise ValueError(
            f"joint {joint.name}: {what} runs from {first:g} to {last:g} deg, "
            "and the cylinder has no moment arm at 0 and 180"
        )
    if not np.cross(joint.axis, actuator.towards).any():
        raise ValueError(f"joint {joint.name}: `towards` must not lie along the joint's axis")
    shortest, longest = sorted(actuator.length(np.radians(joint.range)))
    needed = 1e3 * (longest - shortest)
    if actuator.stroke < (1 - STROKE_TOLERANCE) * needed:
        raise ValueError(
            f"joint {joint.name}: a stroke of {actuator.stroke:g} mm is too short for the range, "
            f"which needs {needed:.1f} mm"
        )
