"""A URDF or MJCF -> the links and joints of a serial arm, with everything posed at joint angles 0."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import mujoco
import numpy as np
import trimesh

from hydroid.arm.model import mujoco_errors
from hydroid.cad.chain import Chain, choose_chain
from hydroid.cad.imported import Array, ImportedArm, ImportedJoint, ImportedLink
from hydroid.cad.inertia import body_mass, fused, stated_faults
from hydroid.cad.shapes import MeshFiles, joined, primitive
from hydroid.cad.source import Source, read_source

DEFAULT_RANGE = (-180.0, 180.0)
"""of a joint without limits [deg]"""
Part = TypeVar("Part", ImportedLink, ImportedJoint)
LEAST_MASS = 1e-9
"""bound that lets MuJoCo compile bodies without mass [kg]"""


@dataclass(frozen=True)
class _MeshPlace:
    """A mesh of a body; a site marks where it is."""

    site: str
    file: str
    scale: Array
    visual: bool


def import_arm(path: Path, columns: Sequence[str] = (), tip: str | None = None) -> ImportedArm:
    """Read a robot through MuJoCo's importer and take the arm out of it.

    Args:
        path: a URDF or an MJCF.
        columns: names of a log's columns, which help to choose among branches.
        tip: name of the link at which the arm ends; None: the tip that fits best.

    Raises:
        ModelError: the file cannot be read, or holds no arm.
    """
    source = read_source(path)
    faults = stated_faults(source)
    places = _sites_for_meshes(source)
    with mujoco_errors(str(path)):
        compiler = source.spec.compiler
        compiler.balanceinertia, compiler.boundmass, compiler.boundinertia = True, LEAST_MASS, LEAST_MASS
        model = source.spec.compile()
    data = mujoco.MjData(model)
    for joint in range(model.njnt):
        if model.jnt_type[joint] in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            data.qpos[model.jnt_qposadr[joint]] = 0.0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    chain = choose_chain(source, model, columns, tip)
    files = MeshFiles(source.meshes, {place.file: place.scale for place in places}, source.notes)
    looks = tuple(joined(_looks(model, data, body, places, files)) for body in range(model.nbody))
    posed = _Posed(source, model, data, chain, looks)
    links = tuple(posed.link(k, faults) for k in range(len(chain.bodies)))
    joints = tuple(posed.joint(k) for k in range(len(chain.joints)))
    if not model.dof_damping.any():
        source.notes.append("no joint has damping: a fit estimates it")
    return ImportedArm(
        name=_word(source.spec.modelname or path.stem),
        base=posed.base(),
        links=tuple(map(_renamed, links, _distinct([link.name for link in links]))),
        joints=tuple(map(_renamed, joints, _distinct([joint.name for joint in joints]))),
        notes=tuple(dict.fromkeys(source.notes)),
    )


def _sites_for_meshes(source: Source) -> list[_MeshPlace]:
    """Mark where meshes are, and take them out where MuJoCo need not integrate over them: it refuses some."""
    spec, places = source.spec, list[_MeshPlace]()
    files = {mesh.name: (mesh.file, np.array(mesh.scale)) for mesh in spec.meshes}
    for number, geom in enumerate(list(spec.geoms)):
        if geom.type != mujoco.mjtGeom.mjGEOM_MESH:
            continue
        site = geom.parent.add_site(name=f"hydroid mesh {number}", pos=geom.pos, quat=geom.quat)
        for name in ("type", "axisangle", "xyaxes", "zaxis", "euler"):
            setattr(site.alt, name, getattr(geom.alt, name))
        if geom.frame is not None:
            site.set_frame(geom.frame)
        file, scale = files[geom.meshname]
        places.append(_MeshPlace(site.name, file, scale, not geom.contype and not geom.conaffinity))
        if source.urdf or geom.parent.explicitinertial or file not in source.meshes:
            spec.delete(geom)
    if all(geom.type != mujoco.mjtGeom.mjGEOM_MESH for geom in spec.geoms):
        for mesh in list(spec.meshes):
            spec.delete(mesh)
    return places


def _looks(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, places: list[_MeshPlace], files: MeshFiles
) -> Iterator[trimesh.Trimesh]:
    """Shapes of a body in the world's frame [m]: what is to be seen, or else what collides."""
    found: list[tuple[bool, trimesh.Trimesh, Array, Array]] = []
    for place in places:
        site = model.site(place.site)
        mesh = files.get(place.file, place.scale) if site.bodyid[0] == body else None
        if mesh is not None:
            found.append((place.visual, mesh, data.site_xmat[site.id], data.site_xpos[site.id]))
    for geom in np.flatnonzero(model.geom_bodyid == body):
        mesh = primitive(int(model.geom_type[geom]), model.geom_size[geom])
        visual = not model.geom_contype[geom] and not model.geom_conaffinity[geom]
        if mesh is not None:
            found.append((visual, mesh, data.geom_xmat[geom], data.geom_xpos[geom]))
    seen = any(visual for visual, *_ in found)
    for visual, mesh, turn, at in found:
        if visual or not seen:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = turn.reshape(3, 3), at
            yield mesh.apply_transform(pose)


@dataclass(frozen=True, eq=False)
class _Posed:
    """The model at joint angles 0, and what each body looks like in the world [m]."""

    source: Source
    model: mujoco.MjModel
    data: mujoco.MjData
    chain: Chain
    looks: tuple[trimesh.Trimesh | None, ...]

    def base(self) -> trimesh.Trimesh | None:
        """Return what carries the arm."""
        body, bodies = int(self.model.body_parentid[self.chain.bodies[0]]), list[int]()
        while body:
            bodies.append(body)
            body = int(self.model.body_parentid[body])
        return joined(look for b in bodies if (look := self.looks[b]) is not None)

    def link(self, k: int, faults: dict[str, str]) -> ImportedLink:
        """Return the chain's link k with all bodies that it carries."""
        notes, origin = self.source.notes, self.data.xanchor[self.chain.joints[k]]
        own = [body for body, carrier in enumerate(self.chain.carrier) if carrier == k]
        bodies = tuple(self.model.body(body).name for body in own)
        known = [body_mass(self.model, self.data, b, self.looks[b], faults, notes) for b in own]
        whole = fused([mass for mass in known if mass is not None], origin, bodies[0], notes)
        mesh = joined(look for body in own if (look := self.looks[body]) is not None)
        if mesh is not None:
            mesh.apply_translation(-origin)
        return ImportedLink(_word(bodies[0]), whole.mass, whole.centre - origin, whole.tensor, mesh, bodies)

    def joint(self, k: int) -> ImportedJoint:
        """Return the chain's joint k."""
        joint, model = self.chain.joints[k], self.model
        before = self.data.xanchor[self.chain.joints[k - 1]] if k else np.zeros(3)
        name = _word(model.joint(joint).name or f"{model.body(self.chain.bodies[k]).name}_joint")
        low, high = np.degrees(model.jnt_range[joint]).round(4).tolist()
        limited = bool(model.jnt_limited[joint]) and low < high
        if not limited:
            self.source.notes.append(
                f"joint {name} has no limits: it turns without stops, unless you set range and continuous"
            )
        axis, at = self.data.xaxis[joint].copy(), self.data.xanchor[joint] - before
        return ImportedJoint(name, axis, at, (low, high) if limited else DEFAULT_RANGE, not limited)


def _word(name: str) -> str:
    """A plain word from any name."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII) or "arm"
    return f"_{word}" if word[0].isdigit() else "base_" if word == "base" else word


def _distinct(names: list[str]) -> list[str]:
    return [name if name not in names[:k] else f"{name}_{k + 1}" for k, name in enumerate(names)]


def _renamed(part: Part, name: str) -> Part:
    return replace(part, name=name)
