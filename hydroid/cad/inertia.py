"""Mass, centre and inertia of bodies: those of the file, or those of their shapes where it has none."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import trimesh

from hydroid.cad.imported import Array
from hydroid.cad.shapes import DENSITY, ball, solid_properties
from hydroid.cad.source import Source
from hydroid.settings.parts import inertia_fault

MASSLESS = 1e-6
"""mass up to which a body counts as a frame without mass [kg]"""
NO_INERTIAL = "it has no inertial"


@dataclass(frozen=True, eq=False)
class BodyMass:
    """A body's mass [kg], its centre in the world [m], (3,), and the inertia about it [kg·m²], (3, 3)."""

    mass: float
    centre: Array
    tensor: Array


def stated_faults(source: Source) -> dict[str, str]:
    """Return the bodies whose mass or inertia no rigid body has, with what is wrong."""
    faults: dict[str, str] = {}
    for body in source.spec.bodies[1:]:
        if not body.explicitinertial:
            if source.urdf:
                faults[body.name] = NO_INERTIAL
            continue
        full = np.array(body.fullinertia)
        if np.isnan(full[0]):
            tensor = np.diag(np.array(body.inertia))
        else:
            xx, yy, zz, xy, xz, yz = full
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if not body.mass > MASSLESS:
            faults[body.name] = "it has no mass"
        elif not tensor.any():
            faults[body.name] = "its inertia is 0"
        elif fault := inertia_fault(tensor):
            faults[body.name] = fault
        if body.name in faults:
            body.mass = max(body.mass, 0.0) if np.isfinite(body.mass) else 0.0
            body.inertia, body.fullinertia = [1.0] * 3, [np.nan, 0, 0, 0, 0, 0]
    return faults


def body_mass(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    body: int,
    look: trimesh.Trimesh | None,
    faults: dict[str, str],
    notes: list[str],
) -> BodyMass | None:
    """Return what a body weighs, and note where it is not what the file states; None: it is a mere frame."""
    name, mass = model.body(body).name, float(model.body_mass[body])
    turn = data.ximat[body].reshape(3, 3)
    stated = BodyMass(mass, data.xipos[body].copy(), turn * model.body_inertia[body] @ turn.T)
    fault = faults.get(name, "")
    if not fault and look is not None and (wide := _too_wide(stated, look)):
        fault = wide
    if not fault:
        return stated if mass > MASSLESS else None
    solid = None if look is None else solid_properties(look)
    if mass <= MASSLESS and solid is None:
        if fault != NO_INERTIAL:  # without one it is a mere frame, such as a tool's centre point
            notes.append(f"link {name}: {fault} and no shape: it is left out")
        return None
    if solid is None:
        notes.append(f"link {name}: {fault}; it has no shape, so a steel ball of its mass is taken")
        return BodyMass(mass, stated.centre, ball(mass))
    volume, centre, unit, what = solid
    if mass <= MASSLESS:
        mass = DENSITY * volume
        notes.append(f"link {name}: {fault}; {mass:.4g} kg are taken, its {what} at {DENSITY:g} kg/m³")
    else:
        notes.append(f"link {name}: {fault}; the inertia of its {what} at uniform density is taken")
    return BodyMass(mass, centre, mass * unit)


def _too_wide(stated: BodyMass, look: trimesh.Trimesh) -> str:
    """Why an inertia belongs to a body of another size, as one in kg·mm² does; empty: it does not."""
    gyration = float(np.sqrt(np.linalg.eigvalsh(stated.tensor)[-1] / max(stated.mass, MASSLESS)))
    size = float(np.linalg.norm(look.extents))
    wide = f"its inertia is that of a body {2 * gyration:.3g} m wide, but its shape is {size:.3g} m long"
    return wide if gyration > size else ""


def fused(parts: Sequence[BodyMass], origin: Array, name: str, notes: list[str]) -> BodyMass:
    """Return several bodies as one; of none, a ball of 1 kg in the joint, at `origin` [m], shape (3,)."""
    if not parts:
        notes.append(f"link {name} has no mass and no shape: a steel ball of 1 kg in its joint is taken")
        return BodyMass(1.0, np.array(origin), ball(1.0))
    mass = sum(part.mass for part in parts)
    centre = np.sum([part.mass * part.centre for part in parts], axis=0) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        away = part.centre - centre
        tensor += part.tensor + part.mass * (away @ away * np.eye(3) - np.outer(away, away))
    return BodyMass(mass, centre, tensor)
