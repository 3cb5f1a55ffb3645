"""A hydraulic arm: an MJCF, and one YAML file with what MJCF cannot say.

The MJCF has links, joints, ranges, masses and meshes; its keyframes are the named
poses. The YAML has the actuators, in units of a drawing (mm, mm², cm³/rad).
"""

import math
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, Strict, ValidationInfo

from hydroid.arrays import Array, Limits, record
from hydroid.errors import ModelError, SettingsError
from hydroid.files import find_config
from hydroid.quantity_table import CHOICES
from hydroid.settings.cylinder import LinearActuator, make_cylinder
from hydroid.settings.linkage import DIGITS, Cylinder, RotaryActuator
from hydroid.settings.load import NotNegative, Settings, load
from hydroid.units import Display, display

Actuator: TypeAlias = LinearActuator | RotaryActuator

FARTHEST_BY_CYLINDER = 270.0
"""range of a joint up to which a cylinder may turn it [deg]: a bucket's linkage turns it
by 200, and the ranges of files are generous. Slewing gears and rotators turn farther"""
TIP_LOAD = "tip_load"  # name of the link that is a load at the tip
SLIDE = 2  # MuJoCo's number of a joint that slides


def _from_folder(path: Path, info: ValidationInfo) -> Path:
    folder = (info.context or {}).get("folder")
    if folder is None:
        return path
    return (folder / path).resolve()


Beside = Annotated[Path, Strict(False), AfterValidator(_from_folder)]
"""a path relative to the file that names it"""


@record
class Joint:
    """A joint that turns [deg], or `slides` [m];
    what is said of angles then holds for its position.

    A continuous one turns without stops: its range limits what is shown and tested. No
    actuator: nothing that stage 2 knows moves it.
    """

    name: str
    range: Limits
    continuous: bool
    actuator: Actuator | None
    slides: bool = False

    @property
    def limits(self) -> Limits:
        """The range in the units of a simulation [rad], or [m]."""
        if self.slides:
            return self.range
        low, high = self.range
        return math.radians(low), math.radians(high)

    @property
    def shown(self) -> Display:
        """How a reader is shown where it is: its angle in deg, or its position in
        mm."""
        return display(slides=self.slides)

    @property
    def may_stand_in(self) -> bool:
        """Whether its rotary actuator may stand in for a cylinder of unknown size and
        linkage."""
        if self.continuous or self.slides:
            return False
        low, high = self.range
        return (
            isinstance(self.actuator, RotaryActuator)
            and high - low <= FARTHEST_BY_CYLINDER
        )

    def has(self, quantity: str) -> bool:
        """Return whether a quantity of a joint's actuator means anything of what moves
        this one."""
        kind = CHOICES[quantity].of
        if kind == "cylinder":
            return isinstance(self.actuator, LinearActuator)
        if kind == "stand-in":
            return self.may_stand_in
        return True


class Arm(Settings):
    """An arm as its YAML file and its MJCF describe it; the MJCF is read when something
    of it is asked for. Raises SettingsError: where the MJCF is read, a setting that
    does not fit it; ModelError: then, no MJCF, or one that hydroid cannot simulate.
    """

    model: Beside
    """the arm's MJCF, relative to this file; its keyframes are the named poses"""
    actuators: dict[
        str, Annotated[Cylinder | RotaryActuator, Field(discriminator="kind")]
    ] = {}
    """what moves the joints, by name; a joint that stage 2 does not drive needs none"""
    payload: str | None = None
    """site of the model that is the arm's tip: where the gripper holds a payload's
    centre of mass; null: the end of the last link, which is the farthest point of its
    shapes in the direction of its centre of mass"""
    load: NotNegative = 0.0
    """mass that the arm carries at its tip in every log [kg]: a link `tip_load`, whose
    mass a parameter can be; payloads of logs come on top"""
    pair: Beside | None = None
    """MJCF of a machine with two of these arms, whose joints are named right_JOINT and
    left_JOINT; null: the arm stands alone"""

    def model_post_init(self, context: Any) -> None:
        """Keep where the settings came from beside what is read of the model:
        it decides nothing."""
        vars(self)["where"] = (context or {}).get("source", self.where)

    def __copy__(self) -> "Arm":
        """Copy the settings alone: a copy with another model must not keep what was
        read of this one."""
        copy = super().__copy__()
        for name in vars(copy).keys() - Arm.model_fields.keys():
            del vars(copy)[name]
        return copy

    @cached_property
    def where(self) -> str:
        """The file that settings came from, with which messages about them begin."""
        return "the arm's file"

    @cached_property
    def joints(self) -> tuple["Joint", ...]:
        """Joints in the order of the model, (J,)."""
        model = self._model
        names = [model.joint(j).name for j in range(model.njnt)]
        for name in self.actuators:
            if name not in names:
                hint = f"the model's joints: {', '.join(names)}"
                raise SettingsError(
                    f"actuators.{name}: no such joint", self.where, hint
                )
        sites = [model.site(s).name for s in range(model.nsite)]
        if self.payload is not None and self.payload not in sites:
            raise SettingsError(
                f"payload: the model has no site {self.payload!r}", self.where
            )
        return tuple(map(self._joint, names))

    def _joint(self, name: str) -> Joint:
        """Return a joint of the model with what moves it.

        Raises SettingsError: a cylinder that does not fit the model.
        """
        joint = self._model.joint(name)
        continuous = not joint.limited[0]
        slides = int(joint.type[0]) == SLIDE
        bare = Joint(name, _range(joint, continuous, slides), continuous, None, slides)
        actuator = self.actuators.get(name)
        if not isinstance(actuator, Cylinder):
            return replace(bare, actuator=actuator)
        try:
            if continuous:
                raise ValueError("a joint without limits needs a rotary actuator")
            data = _at_zero(self.model)
            made = make_cylinder(actuator, bare.limits, data, name, slides=slides)
        except ValueError as error:
            raise SettingsError(f"actuators.{name}: {error}", self.where) from None
        return replace(bare, actuator=made)

    @cached_property
    def mass_of(self) -> dict[str, float]:
        """Nominal masses of the links, the bodies that move [kg], by name.

        Those of the joints come in their order, then parts that are fixed to them, then
        a load at the tip; L in all.
        """
        model = self._model
        # what is welded to the world does not move: its mass changes nothing
        moving = [b for b in range(1, model.nbody) if model.body_weldid[b]]
        bodies = [model.body(b) for b in moving]
        links = [body for body in bodies if body.name and body.mass[0]]
        # the sort is stable: those of the joints come first, in their order
        links.sort(key=lambda body: not body.jntnum[0])
        masses = {body.name: float(body.mass[0]) for body in links}
        if self.load:
            masses[TIP_LOAD] = self.load
        return masses

    @cached_property
    def poses(self) -> dict[str, tuple[float, ...]]:
        """Angle of each joint by the pose's name [rad]: the model's keyframes, and
        `home`."""
        model = self._model
        # a keyframe of that name takes its place
        poses = {"home": tuple(model.qpos0.tolist())}
        for k in range(model.nkey):
            poses[model.key(k).name] = tuple(model.key_qpos[k].tolist())
        return poses

    @cached_property
    def name(self) -> str:
        """Name of the model."""
        return self._model.names.split(b"\0")[0].decode()

    @property
    def _model(self) -> Any:
        return _at_zero(self.model).model

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names, (J,)."""
        return tuple(joint.name for joint in self.joints)

    def joint(self, number: int) -> Joint:
        """Return a joint by its number, from 1."""
        return self.joints[number - 1]

    def name_of(self, joint: int) -> str:
        """Return the name of a joint by its number, from 1."""
        return self.joint(joint).name

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links, (L,)."""
        return tuple(self.mass_of)

    @property
    def masses(self) -> Array:
        """Nominal masses of the links [kg], shape (L,)."""
        return np.array([*self.mass_of.values()])

    @property
    def ranges(self) -> dict[str, Limits]:
        """Lower and upper stop of each joint by its name [rad], or [m] of a slide;
        infinite where none is."""
        free = (-math.inf, math.inf)
        return {
            joint.name: free if joint.continuous else joint.limits
            for joint in self.joints
        }

    def stops(self, joint: int) -> Limits:
        """Return the `ranges` of a joint by its number, from 1."""
        return self.ranges[self.name_of(joint)]

    @property
    def slides(self) -> tuple[int, ...]:
        """Joints, from 1, that slide."""
        return tuple(j for j, joint in enumerate(self.joints, 1) if joint.slides)

    @property
    def backward(self) -> tuple[int, ...]:
        """Joints, from 1, that turn to negative angles as their rods run out, at
        positive commands."""
        joints = list[int]()
        for number, joint in enumerate(self.joints, 1):
            if not isinstance(joint.actuator, LinearActuator):
                continue
            # the same throughout the range, which need not hold the angle 0 at which
            # the triangle is given
            if joint.actuator.moment_arm(sum(joint.limits) / 2) < 0:
                joints.append(number)
        return tuple(joints)

    @property
    def lower(self) -> Array:
        """Lower joint stops [rad], shape (J,)."""
        return np.array([low for low, _ in self.ranges.values()])

    @property
    def upper(self) -> Array:
        """Upper joint stops [rad], shape (J,)."""
        return np.array([high for _, high in self.ranges.values()])

    @property
    def limits(self) -> Array:
        """Ends of the range of each joint, in which it is shown and tested [rad], or
        [m] of a slide, shape (J, 2).

        They are finite: of a joint without stops once round, or 1 m to both sides.
        """
        return np.array([joint.limits for joint in self.joints])

    def pose(self, name: str) -> Array:
        """Return a named pose [rad], shape (J,)."""
        if name not in self.poses:
            hint = f"one of: {', '.join(self.poses)}"
            raise SettingsError(f"{self.name} has no pose {name!r}", hint=hint)
        return np.array(self.poses[name])


def load_arm(name: str | Path, beside: Path | None = None) -> Arm:
    """Read an arm's YAML, found as `find_config` does."""
    return load(find_config(name, beside, kind="arm"), Arm)


def _range(joint: Any, continuous: bool, slides: bool) -> Limits:
    """Return the range of a model's joint [deg], or [m]; without limits once round,
    for sliders and tests."""
    if continuous:
        return (-1.0, 1.0) if slides else (-180.0, 180.0)
    limits = joint.range if slides else np.degrees(joint.range)
    low, high = limits.round(DIGITS).tolist()
    return low, high


def _at_zero(path: Path) -> Any:
    """Return MuJoCo's data of a model with all joints at 0."""
    if not path.is_file():
        raise ModelError(
            "no such model", path, "give the arm's MJCF; `hydroid init` writes one"
        )
    state = path.stat()
    return _compiled(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=8)
def _compiled(path: Path, _changed: int, _size: int) -> Any:
    """Return the data of a file that did not change, without meshes that decide no
    inertia.

    Meshes take long to compile.
    """
    import mujoco

    from hydroid.mjcf import mujoco_errors, read_mjcf

    spec = read_mjcf(path)
    if (
        spec.compiler.inertiafromgeom
        != mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    ):
        for geom in list(spec.geoms):
            is_mesh = geom.type == mujoco.mjtGeom.mjGEOM_MESH
            if is_mesh and not geom.name and geom.parent.explicitinertial:
                spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)
    with mujoco_errors(path):
        data = mujoco.MjData(spec.compile())
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(data.model, data)
    return data
