"""Masses and inertias of bodies: those of the file, or those of their shapes where no rigid body has them."""

import mujoco
import numpy as np

from hydroid.cad.shapes import SHOWN, Array
from hydroid.mjcf import mujoco_errors

DENSITY = 1000.0
"""of a body without a mass [kg/m³], MuJoCo's; steel links are hollow"""
MASSLESS = 1e-6
"""mass up to which a body counts as a frame without mass [kg]"""
NO_INERTIAL = "it has no inertial"
NO_TENSOR = [np.nan, 0, 0, 0, 0, 0]
"""MuJoCo's word for a full inertia that is not given"""


def repair_inertias(spec: mujoco.MjSpec, urdf: bool, notes: list[str]) -> None:
    """Give every body a mass and an inertia that a rigid body can have.

    What the file says is kept where it is possible. Otherwise MuJoCo takes that of the shapes of group SHOWN
    at uniform density. A body without any mass becomes a mere frame.

    Raises:
        ModelError: MuJoCo refuses the file for another reason.
    """
    faults = {body.name: fault for body in spec.bodies[1:] if (fault := _stated_fault(body, urdf))}
    model = _compiled(spec)
    wide = {body.name: _too_wide(model, model.body(body.name).id) for body in spec.bodies[1:]}
    faults |= {name: fault for name, fault in wide.items() if fault and name not in faults}
    stated: dict[str, tuple[float, Array]] = {}
    for body in map(spec.body, faults):
        stated[body.name] = body.mass * body.explicitinertial, body.ipos.copy()
        body.explicitinertial, body.ipos, body.fullinertia = False, [np.nan] * 3, NO_TENSOR
        for geom in body.geoms:
            solid = geom.group == SHOWN and _kind(spec, geom) != mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            geom.mass, geom.density = np.nan, DENSITY if solid else 0.0
    model = _compiled(spec)
    for body in spec.bodies[1:]:
        number, fault = model.body(body.name).id, faults.get(body.name)
        if not model.body_weldid[number]:
            continue  # what cannot move
        mass, centre, turn = float(model.body_mass[number]), model.body_ipos[number].copy(), np.empty(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[number])
        axes = turn.reshape(3, 3)
        tensor = axes * model.body_inertia[number] @ axes.T
        if fault:
            given, place = stated[body.name]
            hull = any(
                _kind(spec, geom) == mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX for geom in body.geoms
            )
            what, weighed = "mesh's hull" if hull else "mesh", given > MASSLESS
            if mass > MASSLESS and weighed:
                mass, tensor = given, tensor * given / mass
                fault += f"; the inertia of its {what} at uniform density is taken"
            elif mass > MASSLESS:
                fault += f"; {mass:.4g} kg are taken, its {what} at {DENSITY:g} kg/m³"
            elif weighed:
                mass, centre, tensor = given, place, ball(given)
                fault += "; it has no shape, so a steel ball of its mass is taken"
            elif fault != NO_INERTIAL:
                fault += " and no shape: it is left out"
            if fault != NO_INERTIAL:  # a mere frame, such as a tool's centre point
                notes.append(f"link {body.name}: {fault}")
        elif body.explicitinertial and mass > MASSLESS:
            continue
        set_inertia(body, mass if mass > MASSLESS else 0.0, centre, tensor)


def _compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile without the refusals that are mended here."""
    compiler = spec.compiler
    compiler.balanceinertia, compiler.boundmass, compiler.boundinertia = True, 1e-9, 1e-9
    with mujoco_errors(spec.modelname):
        model = spec.compile()
    compiler.balanceinertia, compiler.boundmass, compiler.boundinertia = False, 0.0, 0.0
    return model


def _kind(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> int | None:
    """How MuJoCo takes the inertia of a shape's mesh; None: it has no mesh."""
    return int(spec.mesh(geom.meshname).inertia) if geom.meshname else None


def set_inertia(body: mujoco.MjsBody, mass: float, centre: Array, tensor: Array) -> None:
    """Give a body a mass [kg], centre [m], (3,), and inertia about it [kg·m²], (3, 3), in its frame."""
    body.explicitinertial, body.mass, body.ipos = True, mass, centre
    body.iquat, body.ialt.type = [1.0, 0.0, 0.0, 0.0], mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.inertia = [0.0] * 3
    body.fullinertia = [*tensor.diagonal(), tensor[0, 1], tensor[0, 2], tensor[1, 2]] if mass else NO_TENSOR


def ball(mass: float) -> Array:
    """Return the inertia of a steel ball about its centre [kg·m²], shape (3, 3)."""
    radius = (mass / 7850.0 / (4 / 3 * np.pi)) ** (1 / 3)
    return 0.4 * mass * radius**2 * np.eye(3)


def _stated_fault(body: mujoco.MjsBody, urdf: bool) -> str:
    """Say why no rigid body has the mass or inertia that a file states, and take it out; empty: one has."""
    if not body.explicitinertial:
        return NO_INERTIAL if urdf else ""
    xx, yy, zz, xy, xz, yz = body.fullinertia
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if np.isnan(xx):
        tensor = np.diag(np.array(body.inertia))
    fault = _tensor_fault(tensor) if body.mass > MASSLESS else "it has no mass"
    if fault:
        body.mass = max(body.mass, 0.0) if np.isfinite(body.mass) else 0.0
        body.inertia, body.fullinertia = [1.0] * 3, NO_TENSOR
    return fault


def _tensor_fault(tensor: Array) -> str:
    if not tensor.any():
        return "its inertia is 0"
    if not np.isfinite(tensor).all():
        return "its inertia is not finite"
    a, b, c = np.linalg.eigvalsh(tensor).tolist()
    if a <= 0:
        return f"its smallest moment of inertia is {a:.3g} kg·m², and must be above 0"
    if a + b < c * (1 - 1e-6):  # exports round
        return f"its moments of inertia {a:.3g}, {b:.3g} and {c:.3g} kg·m² break A + B ≥ C"
    return ""


def _too_wide(model: mujoco.MjModel, body: int) -> str:
    """Why an inertia belongs to a body of another size, as one in kg·mm² does; empty: it does not."""
    geoms = np.flatnonzero((model.geom_bodyid == body) & (model.geom_group == SHOWN))
    away = np.linalg.norm(model.geom_pos[geoms] - model.body_ipos[body], axis=1)
    size = 2 * float(np.max(away + model.geom_rbound[geoms], initial=0.0))
    width = 2 * float(np.sqrt(model.body_inertia[body].max() / max(model.body_mass[body], MASSLESS)))
    wide = f"its inertia is that of a body {width:.3g} m wide, but its shape is {size:.3g} m long"
    return wide if width > size > 0 else ""
