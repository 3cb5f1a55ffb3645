"""Masses and inertias of bodies: those of the file,
or those of their hulls where no machine has them."""

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from hydroid.arrays import Array
from hydroid.cad.source import SHOWN, Notes
from hydroid.mjcf import mujoco_errors

MASSLESS = 1e-6  # mass up to which a body counts as a frame without mass [kg]
USUAL = 1200.0
"""mass of a link over the volume of its hull [kg/m³]: compact parts of machines have
500 to 3,000. A welded boom has less: 10 mm of steel around 0.4 m square make 770 of the
box, and a bend half empties its hull"""
LEAST = 100.0
"""no link has less: a box around a boom of 400 kg/m³ that points up at 45 deg is four
times as large as the boom"""
MOST = 8000.0
"""no link has more: solid steel"""
MOST_BOXED = 5000.0
"""no box that is drawn around a link has more: it stands around hollow parts"""
BOXED = 500.0
"""the same of a link that is drawn as boxes, cylinders and balls around it: a bucket of
15 mm plates fills 500 of its box, a bent boom 400"""
# volume of a link without a shape, over the cube of its length: a box of 1 to 8
SLENDER = 0.015
SLIGHT = 67.0
"""the least density of this box: that of a boom of 1 to 20 with 400 kg/m³,
1 kg for a length of 1 m"""
WATER = 1000.0  # MuJoCo's density of shapes without mass and density [kg/m³]
# MuJoCo's word for a full inertia that is not given
NO_TENSOR = [np.nan, 0, 0, 0, 0, 0]


class Inertial(NamedTuple):
    """Mass [kg], centre [m], (3,), and inertia about it [kg·m²], (3, 3), in the body's
    frame."""

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
    model = compiled(spec, notes.path)
    hulls = hull_model(spec, notes.path)
    for body in spec.bodies[1:]:
        number = model.body(body.name).id
        if not model.body_weldid[number]:
            continue  # what cannot move
        fault = faults[body.name]
        stated = inertial_of(model, number)
        hull = inertial_of(hulls, number)
        if stated.mass <= MASSLESS or fault == "no mass":
            set_inertia(body, 0.0, stated.centre, stated.tensor)
            continue
        shaped = hull.mass > MASSLESS
        if shaped and not fault and _gyration(stated) > 2 * _gyration(hull):
            fault = "an inertia of a far larger body"
        inertial = stated
        if fault and shaped:
            inertial = Inertial(
                stated.mass, hull.centre, stated.mass / hull.mass * hull.tensor
            )
            notes.add(f"{fault}: that of its hull is taken", f"link {body.name}")
        elif fault:
            inertial = Inertial(stated.mass, stated.centre, _steel_ball(stated.mass))
            notes.add(
                f"{fault}: a steel ball of its mass is taken", f"link {body.name}"
            )
        set_inertia(body, *inertial)


def _steel_ball(mass: float) -> Array:
    """Return the inertia of a ball of 7,850 kg/m³ about its centre [kg·m²], shape (3,
    3)."""
    radius = (mass / 7850.0 / (4 / 3 * np.pi)) ** (1 / 3)
    return 0.4 * mass * radius**2 * np.eye(3)


def weigh(
    spec: mujoco.MjSpec, notes: Notes, total: float | None, lost: Collection[str]
) -> None:
    """Replace masses that no machine's link has, and scale all to a total [kg] that is
    known.

    The spec has moving bodies alone, with masses and inertias.
    Those that `lost` a mesh count as shapeless.
    """
    model = compiled(spec, notes.path)
    links = [body for body in spec.bodies[1:] if body.joints]
    stated = {body.name: body.mass for body in links}
    every = _likely(links, model, hull_model(spec, notes.path), lost)
    what = "MASSES THAT NO MACHINE HAS"
    are_water = _are_water(every)
    if are_water:
        what = "MASSES OF SHAPES FULL OF WATER"
    elif not any(stated.values()):
        what = "no masses in the file"
    replaced = list[str]()
    densities = set[float]()
    for body, likely in every:
        density = USUAL * body.mass / likely.usual.mass
        if are_water or not likely.least <= density <= likely.most:
            replaced.append(_replace_mass(body, likely))
            densities.add(likely.density)
    if replaced:
        taken = " and ".join(f"{density:.0f}" for density in sorted(densities))
        notes.add(
            f"{what} [kg]: {', '.join(replaced)} ({taken} kg/m³ of hull is taken). Say "
            "what you know: --total-mass KG, or masses in arm.xml"
        )
    if total is None:
        _doubt_light(links, model, stated, notes)
    else:
        _scale_masses(links, total, notes)


def _replace_mass(body: mujoco.MjsBody, likely: "_Likely") -> str:
    """Give a link its likely mass; return what changed."""
    usual = likely.usual
    scale = likely.density / USUAL
    mass = scale * usual.mass
    was = "none"
    if body.mass:
        was = f"{float(f'{body.mass:.2g}'):g}"
    set_inertia(body, mass, usual.centre, scale * usual.tensor)
    return f"{body.name} {was} -> {mass:.3g}"


def _doubt_light(
    links: Sequence[mujoco.MjsBody],
    model: mujoco.MjModel,
    stated: Mapping[str, float],
    notes: Notes,
) -> None:
    """Say which links keep a mass, that the file `stated`, which is less than a link
    without a shape might weigh, for the way to the next joint."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for body, after in pairwise(links):
        ends = [data.joint(one.joints[0].name).xanchor for one in (body, after)]
        length = float(np.linalg.norm(ends[1] - ends[0]))
        least = SLIGHT * SLENDER * length**3
        if body.mass == stated[body.name] and body.mass < least:
            notes.add(
                f"weighs {body.mass:.3g} kg and is {length:.3g} m long, where machines' links "
                f"have {least:.3g} kg or more: kept. Say what you know: --total-mass KG",
                body.name,
            )


class _Likely(NamedTuple):
    """What a link may weigh: its inertia at the USUAL density, and the least, largest
    and likeliest density [kg/m³]."""

    usual: Inertial
    least: float
    most: float
    density: float


def _likely(
    links: Sequence[mujoco.MjsBody],
    model: mujoco.MjModel,
    hulls: mujoco.MjModel,
    lost: Collection[str],
) -> list[tuple[mujoco.MjsBody, _Likely]]:
    """Return what links may weigh, by the hulls of those that have a shape."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hull_of = {
        body.name: inertial_of(hulls, model.body(body.name).id) for body in links
    }
    filled = _filled([body for body in links if body.name not in lost], hull_of)
    places = _joints_and_end(links, data)
    longest = np.linalg.norm(np.diff(places, axis=0), axis=1).max()
    likely = list[tuple[mujoco.MjsBody, _Likely]]()
    for body, (here, there) in zip(links, pairwise(places), strict=True):
        if body.name in filled:
            most = MOST if _is_meshed(body) else MOST_BOXED
            shape = _Likely(hull_of[body.name], LEAST, most, filled[body.name])
        else:
            shape = _slender(data.body(body.name), there - here, 0.4 * longest)
        likely.append((body, shape))
    return likely


def _is_meshed(body: mujoco.MjsBody) -> bool:
    """Return whether a link is drawn by a mesh, and not as boxes around it."""
    return any(geom.meshname for geom in body.geoms if geom.group == SHOWN)


def _are_water(likely: Sequence[tuple[mujoco.MjsBody, _Likely]]) -> bool:
    """Return whether all links are boxes that weigh what water in them would: CAD and
    simulators fill them with it where nobody names a material."""
    if len(likely) < 2:
        return False
    for body, one in likely:
        density = USUAL * body.mass / one.usual.mass
        if _is_meshed(body) or abs(density / WATER - 1) > 0.01:
            return False
    return True


def _joints_and_end(
    links: Sequence[mujoco.MjsBody], data: mujoco.MjData
) -> list[Array]:
    """Return the places of the links' joints in the world [m], and of the end of the
    last link.

    The last link goes on as the one before it, half as long.
    """
    places = [data.joint(body.joints[0].name).xanchor for body in links]
    before = places[-2] if len(links) > 1 else places[-1] - [1.0, 0.0, 0.0]
    return [*places, 1.5 * places[-1] - 0.5 * before]


def _slender(body: Any, to_next: Array, shortest: float) -> _Likely:
    """Return what a link without a shape may weigh: a slender one to the next joint,
    `to_next` in the world [m]."""
    along = body.xmat.reshape(3, 3).T @ to_next
    length = max(float(np.linalg.norm(along)), shortest, 0.1)
    mass = USUAL * SLENDER * length**3
    rod = Inertial(mass, 0.5 * along, mass * length**2 / 12 * np.eye(3))
    return _Likely(rod, SLIGHT, np.inf, USUAL)


def _scale_masses(links: Sequence[mujoco.MjsBody], total: float, notes: Notes) -> None:
    factor = total / sum(body.mass for body in links)
    for body in links:
        body.mass *= factor
        body.fullinertia = np.array(body.fullinertia) * factor
    notes.add(
        f"all masses times {factor:.3g}: what moves weighs {total:g} kg, as asked"
    )


def _filled(
    links: Sequence[mujoco.MjsBody], hull: Mapping[str, Inertial]
) -> dict[str, float]:
    """Return the likely mass of links over the volume of their hulls [kg/m³], by name;
    some have none.

    That of the file's links that have a mass and are drawn alike tells it,
    where it is lower than usual.
    """
    usual = dict[str, float]()
    stated: dict[float, list[float]] = {USUAL: [], BOXED: []}
    for body in links:
        if hull[body.name].mass <= MASSLESS:
            continue
        usual[body.name] = USUAL if _is_meshed(body) else BOXED
        density = USUAL * body.mass / hull[body.name].mass
        if LEAST <= density <= MOST:
            stated[usual[body.name]].append(density)
    filled = dict[str, float]()
    for name, density in usual.items():
        alike = stated[density] or [density]
        filled[name] = min(density, float(np.median(alike)))
    return filled


def compiled(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile without the refusals that are mended here; others name the file."""
    compiler = spec.compiler
    compiler.balanceinertia = True
    compiler.boundmass = compiler.boundinertia = 1e-9
    with mujoco_errors(path):
        model = spec.compile()
    compiler.balanceinertia = False
    compiler.boundmass = compiler.boundinertia = 0.0
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
    hulls = spec.copy()
    hulls.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    hulls.compiler.inertiagrouprange = [SHOWN, SHOWN]
    # shapes that are no mesh name none
    solid = {""}
    for mesh in hulls.meshes:
        if mesh.inertia != mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
            solid.add(mesh.name)
    for geom in hulls.geoms:
        geom.mass = np.nan
        geom.density = USUAL if geom.meshname in solid else 0.0
    return compiled(hulls, path)


def inertial_of(model: mujoco.MjModel, body: int) -> Inertial:
    """Return mass, centre and inertia of a body of a model."""
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    axes = turn.reshape(3, 3)
    tensor = axes * model.body_inertia[body] @ axes.T
    return Inertial(model.body_mass[body], model.body_ipos[body].copy(), tensor)


def set_inertia(
    body: mujoco.MjsBody, mass: float, centre: Array, tensor: Array
) -> None:
    """Give a body a mass [kg], centre [m], (3,), and inertia about it [kg·m²], (3, 3),
    in its frame."""
    body.explicitinertial = True
    body.mass = mass
    body.ipos = centre
    body.iquat = [1.0, 0.0, 0.0, 0.0]
    body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.inertia = [0.0] * 3
    if mass:
        products = (tensor[0, 1], tensor[0, 2], tensor[1, 2])
        body.fullinertia = [*tensor.diagonal(), *products]
    else:
        body.fullinertia = NO_TENSOR


def _stated_fault(body: mujoco.MjsBody, urdf: bool) -> str:
    """Say why no rigid body has the mass or inertia that a file states, and take it
    out; empty: one has."""
    if not body.explicitinertial:
        # MuJoCo fills every shape with water of which the file says nothing
        unsaid = all(
            np.isnan(geom.mass) and geom.density == WATER for geom in body.geoms
        )
        return "no mass" if urdf or unsaid else ""
    has_mass = body.mass > MASSLESS and np.isfinite(body.mass)
    fault = "no mass"
    if has_mass:
        fault = _tensor_fault(_stated_tensor(body))
    if fault:
        if not has_mass:
            body.mass = 0.0
        body.inertia = [1.0] * 3
        body.fullinertia = NO_TENSOR
    return fault


def _stated_tensor(body: mujoco.MjsBody) -> Array:
    """Return the inertia that a file states [kg·m²], shape (3, 3)."""
    # in MuJoCo's order: xx, yy, zz, xy, xz, yz
    full = np.array(body.fullinertia)
    if np.isnan(full[0]):
        return np.diag(body.inertia)
    return full[[0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(3, 3)


def _tensor_fault(tensor: Array) -> str:
    """Say why no rigid body has an inertia, (3, 3); empty: one has."""
    if not np.isfinite(tensor).all():
        return "an inertia that is not finite"
    a, b, c = np.linalg.eigvalsh(tensor).tolist()
    # the sides of a triangle, but for what exports round
    possible = a > 0 and a + b >= c * (1 - 1e-6)
    return "" if possible else "an inertia that no rigid body has"


def _gyration(inertial: Inertial) -> float:
    """Return the largest radius of gyration of a body [m]."""
    return np.sqrt(np.linalg.eigvalsh(inertial.tensor)[-1] / inertial.mass)
