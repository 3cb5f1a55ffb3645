"""The few solids that the arm's parts are cut and joined from; lengths in m."""

import math
from collections.abc import Sequence

import numpy as np
import trimesh
from trimesh import Trimesh

# [m]; vertices are put on it, so that the bytes do not depend on the last digits of a
# boolean
GRID = 1e-6
AXES = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}

Point = tuple[float, float]


def box(low: Sequence[float], high: Sequence[float]) -> Trimesh:
    """Block between two corners [m]."""
    return trimesh.creation.box(bounds=np.array([low, high], dtype=float))


def rod(axis: str, at: Point, span: tuple[float, float], radius: float) -> Trimesh:
    """Cylinder along `axis` from span[0] to span[1]; `at` is (y, z), (z, x) or (x, y)
    for axis x, y, z."""
    sections = 28 if radius > 0.03 else 16
    solid = trimesh.creation.cylinder(
        radius=radius, height=span[1] - span[0], sections=sections
    )
    solid.apply_translation((*at, 0.5 * (span[0] + span[1])))
    turned = np.eye(4)
    turned[:3, :3] = np.eye(3)[list(AXES[axis])].T
    return solid.apply_transform(turned)


def plate(
    axis: str, span: tuple[float, float], *discs: tuple[float, float, float]
) -> Trimesh:
    """Rounded plate across `axis`: the hull of discs (u, v, radius), u and v as in
    `rod`."""
    return trimesh.convex.convex_hull(
        np.vstack([rod(axis, (u, v), span, radius).vertices for u, v, radius in discs])
    )


def join(*solids: Trimesh) -> Trimesh:
    """Union."""
    return trimesh.boolean.union(list(solids), engine="manifold")


def cut(solid: Trimesh, *tools: Trimesh) -> Trimesh:
    """Difference."""
    return trimesh.boolean.difference([solid, *tools], engine="manifold")


def both(solid: Trimesh, axis: int = 1) -> Trimesh:
    """A solid and its mirror image across the plane normal to `axis` (0, 1, 2)."""
    mirror = np.eye(4)
    mirror[axis, axis] = -1.0
    return join(solid, solid.copy().apply_transform(mirror))


def tube(
    axis: str, at: Point, span: tuple[float, float], outer: float, inner: float
) -> Trimesh:
    """Open pipe."""
    return cut(
        rod(axis, at, span, outer),
        rod(axis, at, (span[0] - 0.01, span[1] + 0.01), inner),
    )


def beam(
    x: tuple[float, float], y: float, z: tuple[float, float], wall: float
) -> Trimesh:
    """Box section along x, half as wide as `y`, open at both ends."""
    outside = box((x[0], -y, z[0]), (x[1], y, z[1]))
    return cut(
        outside,
        box((x[0] - 0.01, wall - y, z[0] + wall), (x[1] + 0.01, y - wall, z[1] - wall)),
    )


def bolts(
    axis: str, span: tuple[float, float], circle: float, radius: float, count: int = 6
) -> Trimesh:
    """Bolt heads on a circle around `axis`."""
    turns = [2 * math.pi * (k + 0.5) / count for k in range(count)]
    heads = [
        trimesh.creation.cylinder(radius=radius, height=span[1] - span[0], sections=6)
        for _ in turns
    ]
    turned = np.eye(4)
    turned[:3, :3] = np.eye(3)[list(AXES[axis])].T
    for head, turn in zip(heads, turns, strict=True):
        head.apply_translation(
            (circle * math.cos(turn), circle * math.sin(turn), sum(span) / 2)
        )
        head.apply_transform(turned)
    return join(*heads)


def canonical(solid: Trimesh) -> Trimesh:
    """Vertices on a grid, faces sorted: equal solids give equal bytes."""
    corners = np.round(solid.triangles / GRID).astype(np.int64)
    edges = np.roll(corners, -1, axis=1) - corners
    corners = corners[np.any(np.cross(edges[:, 0], edges[:, 1]) != 0, axis=1)]
    keys = corners @ np.array([10**12, 10**6, 1])
    first = np.argmin(keys, axis=1)[:, None]
    turn = (first + np.arange(3)) % 3
    corners = np.take_along_axis(corners, turn[..., None], axis=1)
    keys = np.take_along_axis(keys, turn, axis=1)
    corners = corners[np.lexsort(keys.T[::-1])] * GRID
    return Trimesh(**trimesh.triangles.to_kwargs(corners))
