"""A hydraulic arm: an MJCF, and one YAML file with what MJCF cannot say.

The MJCF has links, joints, ranges, masses and meshes; its keyframes are the named poses. The YAML has the
actuators, in units of a drawing (mm, mm², cm³/rad).
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, Strict, ValidationInfo

from hydroid.assets import find_config
from hydroid.errors import ModelError, SettingsError
from hydroid.settings.linkage import DIGITS, Cylinder, LinearActuator, RotaryActuator, make_cylinder, sides_of
from hydroid.settings.load import Settings, load

if TYPE_CHECKING:
    import mujoco

TURN = (-180.0, 180.0)
"""range of a joint without limits [deg], for sliders and tests"""


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
    continuous: bool
    actuator: LinearActuator | RotaryActuator | None


@dataclass(frozen=True)
class Arm:
    """An arm as its MJCF and its YAML file describe it.

    Attributes:
        file: the YAML's settings.
        name: of the model.
        joints: in the order of the model, J of them.
        mass_of: nominal masses of its links, the bodies that move [kg], by name: those of the joints in
            their order, then parts that are fixed to them, L of them.
        poses: angle of each joint by the pose's name [rad].
    """

    file: ArmFile
    name: str
    joints: tuple[Joint, ...]
    mass_of: dict[str, float]
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
        """Joint names, (J,)."""
        return tuple(joint.name for joint in self.joints)

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links, (L,)."""
        return tuple(self.mass_of)

    @property
    def masses(self) -> NDArray[np.float64]:
        """Nominal masses of the links [kg], shape (L,)."""
        return np.array([*self.mass_of.values()])

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower joint stops [rad], shape (J,); -inf where there is none."""
        return np.radians([-np.inf if joint.continuous else joint.range[0] for joint in self.joints])

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper joint stops [rad], shape (J,); inf where there is none."""
        return np.radians([np.inf if joint.continuous else joint.range[1] for joint in self.joints])

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
        SettingsError: no such file, a setting that is not allowed or does not fit the model.
        ModelError: no MJCF, or one that hydroid cannot simulate.
    """
    path = find_config(name, beside, kind="arm")
    return make_arm(load(path, ArmFile), str(path))


def make_arm(file: ArmFile, where: str) -> Arm:
    """Return the arm of an arm file's settings; `where` begins messages about them."""
    if not file.model.is_file():
        hint = "give the arm's MJCF; `hydroid init` writes one"
        raise ModelError("no such model", where=str(file.model), hint=hint)
    state = file.model.stat()
    data = _at_zero(file.model, state.st_mtime_ns, state.st_size)
    model = data.model
    joints = [model.joint(j) for j in range(model.njnt)]
    for name in file.actuators:
        if name not in [joint.name for joint in joints]:
            hint = f"the model's joints: {', '.join(joint.name for joint in joints)}"
            raise SettingsError(f"actuators.{name}: no such joint", where=where, hint=hint)
    if file.payload is not None and file.payload not in [model.site(s).name for s in range(model.nsite)]:
        raise SettingsError(f"payload: the model has no site {file.payload!r}", where=where)
    made: list[Joint] = []
    for joint in joints:
        actuator = file.actuators.get(joint.name)
        low, high = np.degrees(joint.range).round(DIGITS).tolist() if joint.limited[0] else TURN
        if isinstance(actuator, Cylinder):
            try:
                if not joint.limited[0]:
                    raise ValueError("a joint without limits needs a rotary actuator")
                sides, pivots = sides_of(actuator, data, joint.name)
                actuator = make_cylinder(actuator, sides, (low, high), pivots)
            except ValueError as error:
                raise SettingsError(f"actuators.{joint.name}: {error}", where=where) from None
        made.append(Joint(joint.name, (low, high), not joint.limited[0], actuator))
    moving = [model.body(b) for b in range(1, model.nbody) if model.body_weldid[b] and model.body_mass[b]]
    links = sorted((body for body in moving if body.name), key=lambda body: not body.jntnum[0])
    poses = {"home": tuple(model.qpos0.tolist())}
    poses |= {model.key(k).name: tuple(model.key_qpos[k].tolist()) for k in range(model.nkey)}
    name = model.names.split(b"\0")[0].decode()
    return Arm(file, name, tuple(made), {body.name: float(body.mass[0]) for body in links}, poses)


@lru_cache(maxsize=8)
def _at_zero(path: Path, _changed: int, _size: int) -> "mujoco.MjData":
    """The compiled MJCF with all joints at 0, without meshes that decide no inertia: these take long."""
    import mujoco

    from hydroid.mjcf import mujoco_errors, read_mjcf

    spec = read_mjcf(path)
    if spec.compiler.inertiafromgeom != mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        for geom in list(spec.geoms):
            mesh = geom.type == mujoco.mjtGeom.mjGEOM_MESH
            if mesh and not geom.name and geom.parent.explicitinertial:
                spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for one in [mesh for mesh in spec.meshes if mesh.name not in used]:
        spec.delete(one)
    with mujoco_errors(str(path)):
        data = mujoco.MjData(spec.compile())
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(data.model, data)
    return data
