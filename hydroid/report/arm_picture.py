"""A picture of the arm as SVG: the outline of each link, seen from the side, without a renderer."""

from collections.abc import Collection

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from hydroid.arm.model import load_model
from hydroid.cad.shapes import geom_mesh
from hydroid.parameters import Array
from hydroid.settings.arm import Arm

_AZIMUTH, _ELEVATION = np.radians(-68.0), np.radians(16.0)
"""from where it is seen"""
_SIZE = 300
_MARGIN = 18


def arm_picture(arm: Arm, pose: Array, marked: Collection[int]) -> str:
    """Return the arm in a pose [rad], shape (J,), as SVG; `marked` joints, from 1, carry their numbers."""
    model = load_model(arm).compile()
    data = mujoco.MjData(model)
    joints = [model.joint(name) for name in arm.joint_names]
    data.qpos[[joint.qposadr[0] for joint in joints]] = pose
    mujoco.mj_kinematics(model, data)
    view = side_view()
    shapes: list[tuple[float, int, Array]] = []
    for geom in range(model.ngeom):
        points = corners(model, geom)
        if len(points):
            seen = (data.geom_xpos[geom] + points @ data.geom_xmat[geom].reshape(3, 3).T) @ view.T
            shapes.append((float(seen[:, 2].mean()), int(model.geom_bodyid[geom]), outline(seen[:, :2])))
    for body, points in () if shapes else sticks(model):
        seen = (data.xpos[body] + points @ data.xmat[body].reshape(3, 3).T) @ view.T
        shapes.append((float(seen[:, 2].mean()), body, seen[:, :2]))
    anchors = np.array([data.xanchor[joint.id] for joint in joints]) @ view.T
    every = np.concatenate([shape for *_, shape in shapes])
    low, high = every.min(axis=0), every.max(axis=0)
    scale = (_SIZE - 2 * _MARGIN) / float(max(high - low))
    width, height = (scale * (high - low) + 2 * _MARGIN).round().astype(int).tolist()

    def place(points: Array) -> Array:
        at = scale * (points[..., :2] - low) + _MARGIN
        return np.stack([at[..., 0], height - at[..., 1]], axis=-1).round(1)

    drawn = [
        f'<polygon points="{" ".join(f"{x:g},{y:g}" for x, y in place(shape))}" fill="var(--tint)" '
        f'stroke="var(--{"accent" if body else "grey"})" stroke-width="1.6" stroke-linejoin="round"/>'
        for _, body, shape in sorted(shapes, key=lambda each: each[0])
    ]
    for joint in sorted(marked):
        x, y = place(anchors[joint - 1])
        drawn.append(
            f'<circle cx="{x:g}" cy="{y:g}" r="9" fill="var(--orange)"/><text x="{x:g}" y="{y + 4:g}" '
            f'font-size="12" font-weight="700" text-anchor="middle" fill="var(--paper)">{joint}</text>'
        )
    words = f"The arm as it starts the first log; compared: joint {', '.join(map(str, sorted(marked)))}"
    return (
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{words}" '
        f'xmlns="http://www.w3.org/2000/svg">{"".join(drawn)}</svg>'
    )


def side_view() -> Array:
    """Rows: to the right, up, and towards the viewer, in the world's frame."""
    a, e = _AZIMUTH, _ELEVATION
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(towards, right), towards])


def corners(model: mujoco.MjModel, geom: int) -> Array:
    """Corners of a shape in its own frame, shape (n, 3); none of a plane."""
    shape = geom_mesh(model, geom)
    return np.empty((0, 3)) if shape is None else np.asarray(shape.vertices, float)


def sticks(model: mujoco.MjModel) -> list[tuple[int, Array]]:
    """Bodies of an arm without shapes: number, and a line in its frame to each body that it carries, (2, 3).

    The line of the last body leads to its centre of mass.
    """
    lines: list[tuple[int, Array]] = []
    for body in range(1, model.nbody):
        carried = model.body_pos[model.body_parentid == body]
        lines += [(body, np.stack([np.zeros(3), end])) for end in carried]
        lines += [] if len(carried) else [(body, np.stack([np.zeros(3), model.body_ipos[body]]))]
    return lines


def outline(points: Array) -> Array:
    """The convex outline of points, shape (n, 2)."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # all on one line
        return points
