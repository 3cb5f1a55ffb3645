"""Masses and inertias of bodies: those of the file,
or those of their hulls where no machine has them."""

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from hydroid.arrays import Array
from hydroid.cad.source import SHOWN, Notes
from hydroid.mjcf import mujoco_errors

MASSLESS = 1e-6  # mass up to which a body counts as a frame without mass [kg]
USUAL = 1200.0
"""mass of a link over the volume of its hull [kg/m³]: compact parts of machines have 500 to 3,000.
A welded boom has less: 10 mm of steel around 0.4 m square make 770 of the box,
and a bend half empties its hull"""
LEAST, MOST = 100.0, 8000.0
"""outside these no link can be: a box around a boom of 400 kg/m³ that points up at 45 deg, four
times as large as the boom; and solid steel"""
BOXED = 500.0
"""the same of a link that is drawn as boxes, cylinders and balls around it: a bucket of 15 mm
plates fills 500 of its box, a bent boom 400"""
SLENDER = 0.015  # volume of a link without a shape, over the cube of its length: a box of 1 to 8
SLIGHT = 67.0
"""the least density of this box: that of a boom of 1 to 20 with 400 kg/m³,
1 kg for a length of 1 m"""
WATER = 1000.0  # MuJoCo's density of shapes without mass and density [kg/m³]
NO_TENSOR = [np.nan, 0, 0, 0, 0, 0]  # MuJoCo's word for a full inertia that is not given


class Inertial(NamedTuple):
    """Mass [kg], centre [m], (3,), and inertia about it [kg·m²], (3, 3), in the body's frame."""

    mass: float
    centre: Array
    tensor: Array


def repair_inertias(spec: mujoco.MjSpec, urdf: bool, notes: Notes) -> None:
    """Give every body a mass and an inertia that a rigid body can have;
    one without a mass is a mere frame.

    What the file says is kept where it is possible,
    else the mass with the inertia of the shape's hull.
    """
    faults = {body.name: _stated_fault(body, urdf) for body in spec.bodies[1:]}
    model, hulls = compiled(spec, notes.path), hull_model(spec, notes.path)
    for body in spec.bodies[1:]:
        number, fault = model.body(body.name).id, faults[body.name]
        if not model.body_weldid[number]:
            continue  # what cannot move
        mass, centre, tensor = inertial_of(model, number)
        hull = inertial_of(hulls, number)
        shaped = hull.mass > MASSLESS
        mass = 0.0 if mass <= MASSLESS or fault == "no mass" else mass
        if mass and shaped and not fault and _gyration(tensor, mass) > 2 * _gyration(hull.tensor, hull.mass):
            fault = "an inertia of a far larger body"
        if mass and fault:
            radius = (mass / 7850.0 / (4 / 3 * np.pi)) ** (1 / 3)
            tensor, what = 0.4 * mass * radius**2 * np.eye(3), "a steel ball of its mass is taken"
            if shaped:
                centre, tensor = hull.centre, mass / hull.mass * hull.tensor
                what = "that of its hull is taken"
            notes.add(f"{fault}: {what}", f"link {body.name}")
        set_inertia(body, mass, centre, tensor)


def weigh(spec: mujoco.MjSpec, notes: Notes, total: float | None, lost: Collection[str]) -> None:
    """Replace masses that no machine's link has, and scale all to a total [kg] that is known.

    The spec has moving bodies alone, with masses and inertias.
    Those that `lost` a mesh count as shapeless.
    """
    model, hulls = compiled(spec, notes.path), hull_model(spec, notes.path)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    links, lines = [body for body in spec.bodies[1:] if body.joints], list[str]()
    places = [data.joint(body.joints[0].name).xanchor for body in links]
    before = places[-2] if len(links) > 1 else places[-1] - [1.0, 0.0, 0.0]
    places.append(1.5 * places[-1] - 0.5 * before)
    longest = np.linalg.norm(np.diff(places, axis=0), axis=1).max()
    what = "MASSES THAT NO MACHINE HAS" if any(body.mass for body in links) else "no masses in the file"
    hull = {body.name: inertial_of(hulls, model.body(body.name).id) for body in links}
    filled = _filled([body for body in links if body.name not in lost], hull)
    densities = set[float]()
    for body, (here, there) in zip(links, pairwise(places), strict=True):
        usual, least, most, density = hull[body.name], LEAST, MOST, filled.get(body.name, USUAL)
        if body.name not in filled:
            # a slender link to the next joint; the last one goes on, half as long
            way = data.body(body.name).xmat.reshape(3, 3).T @ (there - here)
            length, least, most = max(float(np.linalg.norm(way)), 0.4 * longest, 0.1), SLIGHT, np.inf
            mass = USUAL * SLENDER * length**3
            usual = Inertial(mass, 0.5 * way, mass * length**2 / 12 * np.eye(3))
        if least <= USUAL * body.mass / usual.mass <= most:
            continue
        mass = density / USUAL * usual.mass
        lines.append(f"{body.name} {f'{body.mass:.2g}' if body.mass else 'none'} -> {mass:.3g}")
        set_inertia(body, mass, usual.centre, density / USUAL * usual.tensor)
        densities.add(density)
    if lines:
        of = " and ".join(f"{density:.0f}" for density in sorted(densities))
        notes.add(
            f"{what} [kg]: {', '.join(lines)} ({of} kg/m³ of hull is taken). Say "
            "what you know: --total-mass KG, or masses in arm.xml"
        )
    if total is not None:
        factor = total / sum(body.mass for body in links)
        for body in links:
            body.mass *= factor
            body.fullinertia = np.array(body.fullinertia) * factor
        notes.add(f"all masses times {factor:.3g}: what moves weighs {total:g} kg, as asked")


def _filled(links: Sequence[mujoco.MjsBody], hull: Mapping[str, Inertial]) -> dict[str, float]:
    """Return the likely mass of links over the volume of their hulls [kg/m³], by name;
    some have none.

    That of the file's links that have a mass and are drawn alike tells it,
    where it is lower than usual.
    """
    usual, stated = dict[str, float](), dict[float, list[float]]()
    for body in links:
        if hull[body.name].mass <= MASSLESS:
            continue
        meshed = any(geom.meshname for geom in body.geoms if geom.group == SHOWN)
        usual[body.name] = USUAL if meshed else BOXED
        density = USUAL * body.mass / hull[body.name].mass
        if LEAST <= density <= MOST:
            stated.setdefault(usual[body.name], []).append(density)
    return {
        name: min(density, float(np.median(stated.get(density, [density]))))
        for name, density in usual.items()
    }


def compiled(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile without the refusals that are mended here; others name the file."""
    compiler = spec.compiler
    compiler.balanceinertia, compiler.boundmass, compiler.boundinertia = True, 1e-9, 1e-9
    with mujoco_errors(path):
        model = spec.compile()
    compiler.balanceinertia, compiler.boundmass, compiler.boundinertia = False, 0.0, 0.0
    return model


def bare_model(spec: mujoco.MjSpec, path: Path) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compile without meshes, and pose as the file stands:
    where bodies and joints are is all that counts."""
    bare = spec.copy()
    bare.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    for body in bare.bodies[1:]:
        set_inertia(body, 1.0, np.zeros(3), np.eye(3))
    meshed = [geom for geom in bare.geoms if geom.meshname]
    for part in (*meshed, *bare.meshes, *bare.keys, *bare.actuators, *bare.tendons):
        bare.delete(part)
    model = compiled(bare, path)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def hull_model(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile with the USUAL mass of the hulls of what is shown of each body."""
    hulls, kinds = spec.copy(), mujoco.mjtMeshInertia
    hulls.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    hulls.compiler.inertiagrouprange = [SHOWN, SHOWN]
    solid = [mesh for mesh in hulls.meshes if mesh.inertia != kinds.mjMESH_INERTIA_SHELL]
    for mesh in solid:
        mesh.inertia = kinds.mjMESH_INERTIA_CONVEX
    names = {"", *(mesh.name for mesh in solid)}
    for geom in hulls.geoms:
        geom.mass, geom.density = np.nan, USUAL if geom.meshname in names else 0.0
    return compiled(hulls, path)


def inertial_of(model: mujoco.MjModel, body: int) -> Inertial:
    """Return mass, centre and inertia of a body of a model."""
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    axes = turn.reshape(3, 3)
    tensor = axes * model.body_inertia[body] @ axes.T
    return Inertial(model.body_mass[body], model.body_ipos[body].copy(), tensor)


def set_inertia(body: mujoco.MjsBody, mass: float, centre: Array, tensor: Array) -> None:
    """Give a body a mass [kg], centre [m], (3,), and inertia about it [kg·m²], (3, 3),
    in its frame."""
    body.explicitinertial, body.mass, body.ipos = True, mass, centre
    body.iquat, body.ialt.type = [1.0, 0.0, 0.0, 0.0], mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.inertia = [0.0] * 3
    body.fullinertia = [*tensor.diagonal(), tensor[0, 1], tensor[0, 2], tensor[1, 2]] if mass else NO_TENSOR


def _stated_fault(body: mujoco.MjsBody, urdf: bool) -> str:
    """Say why no rigid body has the mass or inertia that a file states, and take it out; empty:
    one has."""
    if not body.explicitinertial:
        # MuJoCo fills every shape with water of which the file says nothing
        unsaid = all(np.isnan(geom.mass) and geom.density == WATER for geom in body.geoms)
        return "no mass" if urdf or unsaid else ""
    full = np.array(body.fullinertia)  # xx, yy, zz, xy, xz, yz
    tensor = np.diag(body.inertia) if np.isnan(full[0]) else full[[0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(3, 3)
    fault = "no mass"
    if body.mass > MASSLESS and np.isfinite(body.mass):
        fault = "an inertia that is not finite"
        if np.isfinite(tensor).all():
            a, b, c = np.linalg.eigvalsh(tensor).tolist()  # exports round
            fault = "" if a > 0 and a + b >= c * (1 - 1e-6) else "an inertia that no rigid body has"
    if fault:
        body.mass = body.mass if fault != "no mass" else 0.0
        body.inertia, body.fullinertia = [1.0] * 3, NO_TENSOR
    return fault


def _gyration(tensor: Array, mass: float) -> float:
    return np.sqrt(np.linalg.eigvalsh(tensor)[-1] / mass)
