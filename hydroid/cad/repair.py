"""Masses and inertias of bodies: those of the file, or those of their shapes where no rigid body has them."""

import mujoco
import numpy as np
import trimesh

from hydroid.cad.shapes import SHOWN, Array, ball, geom_mesh, solid_properties
from hydroid.mjcf import mujoco_errors

DENSITY = 1000.0
"""of a body without a mass [kg/m³], MuJoCo's; steel links are hollow"""
MASSLESS = 1e-6
"""mass up to which a body counts as a frame without mass [kg]"""
NO_INERTIAL = "it has no inertial"

_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""of xx, yy, zz, xy, xz, yz in an inertia tensor"""


def repair_inertias(spec: mujoco.MjSpec, urdf: bool, notes: list[str]) -> None:
    """Give every body a mass and an inertia that a rigid body can have.

    What the file says is kept where it is possible. Otherwise it is that of the shapes of group 2 at uniform
    density. A body without any mass becomes a mere frame.

    Raises:
        ModelError: MuJoCo refuses the file for another reason.
    """
    faults = {body.name: fault for body in spec.bodies[1:] if (fault := _stated_fault(body, urdf))}
    compiler = spec.compiler
    compiler.balanceinertia, compiler.boundmass, compiler.boundinertia = True, 1e-9, 1e-9  # or it refuses
    with mujoco_errors(spec.modelname):
        model = spec.compile()
    compiler.balanceinertia, compiler.boundmass, compiler.boundinertia = False, 0.0, 0.0
    for body in spec.bodies[1:]:
        number = model.body(body.name).id
        if not model.body_weldid[number]:
            continue  # what cannot move
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[number])
        axes = turn.reshape(3, 3)
        tensor = axes * model.body_inertia[number] @ axes.T
        mass, centre = float(model.body_mass[number]), model.body_ipos[number].copy()
        look, fault = _look(model, number), faults.get(body.name, "")
        if not fault and look is not None:
            fault = _too_wide(mass, tensor, look)
        if fault:
            mass, centre, tensor = _of_the_shape(body.name, mass, centre, look, fault, notes)
        elif body.explicitinertial and mass > MASSLESS:
            continue
        set_inertia(body, mass if mass > MASSLESS else 0.0, centre, tensor)


def set_inertia(body: mujoco.MjsBody, mass: float, centre: Array, tensor: Array) -> None:
    """Give a body a mass [kg], centre [m], (3,), and inertia about it [kg·m²], (3, 3), in its frame."""
    body.explicitinertial, body.mass, body.ipos = True, mass, centre
    body.iquat, body.ialt.type = [1.0, 0.0, 0.0, 0.0], mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.inertia = [0.0] * 3
    body.fullinertia = tensor[_ROWS, _COLUMNS] if mass else [np.nan, 0, 0, 0, 0, 0]


def _stated_fault(body: mujoco.MjsBody, urdf: bool) -> str:
    """Say why no rigid body has the mass or inertia that a file states, and take it out; empty: one has."""
    if not body.explicitinertial:
        return NO_INERTIAL if urdf else ""
    full, tensor = np.array(body.fullinertia), np.diag(np.array(body.inertia))
    if not np.isnan(full[0]):
        tensor[_ROWS, _COLUMNS] = tensor[_COLUMNS, _ROWS] = full
    if not body.mass > MASSLESS:
        fault = "it has no mass"
    elif not tensor.any():
        fault = "its inertia is 0"
    else:
        fault = inertia_fault(tensor)
    if fault:
        body.mass = max(body.mass, 0.0) if np.isfinite(body.mass) else 0.0
        body.inertia, body.fullinertia = [1.0] * 3, [np.nan, 0, 0, 0, 0, 0]
    return fault


def inertia_fault(tensor: Array) -> str:
    """Return why no rigid body has this inertia [kg·m²], shape (3, 3); empty: one has."""
    if not np.isfinite(tensor).all():
        return "its inertia is not finite"
    a, b, c = np.linalg.eigvalsh(tensor).tolist()
    if a <= 0:
        return f"its smallest moment of inertia is {a:.3g} kg·m², and must be above 0"
    if a + b < c * (1 - 1e-6):  # exports round
        return f"its moments of inertia {a:.3g}, {b:.3g} and {c:.3g} kg·m² break A + B ≥ C"
    return ""


def _look(model: mujoco.MjModel, body: int) -> trimesh.Trimesh | None:
    """What is to be seen of a body, in its frame [m]."""
    parts: list[trimesh.Trimesh] = []
    for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_group == SHOWN)):
        mesh = geom_mesh(model, int(geom))
        if mesh is not None:
            pose, turn = np.eye(4), np.empty(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            pose[:3, :3], pose[:3, 3] = turn.reshape(3, 3), model.geom_pos[geom]
            parts.append(mesh.apply_transform(pose))
    whole = trimesh.util.concatenate(parts) if parts else None  # overlaps and all
    return whole if isinstance(whole, trimesh.Trimesh) else None


def _of_the_shape(
    name: str, mass: float, centre: Array, look: trimesh.Trimesh | None, fault: str, notes: list[str]
) -> tuple[float, Array, Array]:
    """Mass, centre and inertia of a body in place of those that it cannot have."""
    solid = None if look is None else solid_properties(look)
    if solid is None and mass <= MASSLESS:
        if fault != NO_INERTIAL:  # without one it is a mere frame, such as a tool's centre point
            notes.append(f"link {name}: {fault} and no shape: it is left out")
        return 0.0, centre, np.zeros((3, 3))
    if solid is None:
        notes.append(f"link {name}: {fault}; it has no shape, so a steel ball of its mass is taken")
        return mass, centre, ball(mass)
    volume, centre, unit, what = solid
    if mass <= MASSLESS:
        mass = DENSITY * volume
        notes.append(f"link {name}: {fault}; {mass:.4g} kg are taken, its {what} at {DENSITY:g} kg/m³")
    else:
        notes.append(f"link {name}: {fault}; the inertia of its {what} at uniform density is taken")
    return mass, centre, mass * unit


def _too_wide(mass: float, tensor: Array, look: trimesh.Trimesh) -> str:
    """Why an inertia belongs to a body of another size, as one in kg·mm² does; empty: it does not."""
    gyration = float(np.sqrt(np.linalg.eigvalsh(tensor)[-1] / max(mass, MASSLESS)))
    size = float(np.linalg.norm(look.extents))
    wide = f"its inertia is that of a body {2 * gyration:.3g} m wide, but its shape is {size:.3g} m long"
    return wide if gyration > size else ""
