"""Which bodies of an arm meet along a trajectory, and how near they come otherwise.

Bodies collide with the shapes that the MJCF makes collide; a mesh counts as its convex hull. Distances are
MuJoCo's (`mj_geomDistance`). As in MuJoCo a body is not held against the one that it hangs on, nor against
one that the model excludes; `hydroid init` excludes bodies that touch in the pose `home`.
"""

from collections.abc import Generator

import mujoco
import numpy as np

from hydroid.arrays import Array, record
from hydroid.errors import ModelError

FARTHEST = 100.0  # distance beyond which MuJoCo need not look [m]


@record
class Meeting:
    """Two bodies inside each other, from one sample to another; at most by a depth, reached at a time."""

    bodies: list[str]
    from_s: float
    to_s: float
    depth_m: float
    deepest_at_s: float


@record
class Clearance:
    """The smallest distance between any two bodies along a trajectory of T samples.

    Attributes:
        time: [s], shape (T,).
        distance: smallest of all [m], shape (T,); negative: the depth at which bodies are inside each other.
        nearest: names of the two bodies at each sample, T pairs.
        meetings: every time that two bodies met, in the order of their beginnings.
        checked: number of pairs of bodies that were checked.
        excluded: pairs that the model excludes.
    """

    time: Array
    distance: Array
    nearest: tuple[tuple[str, str], ...]
    meetings: tuple[Meeting, ...]
    checked: int
    excluded: tuple[tuple[str, str], ...]


class CollisionChecker:
    """Distances between the bodies of a compiled model whose joints are all hinges or slides.

    Contacts may be switched off.
    """

    def __init__(self, model: mujoco.MjModel, source: str = "the model") -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._pairs = _pairs(model)
        if not self._pairs:
            hint = "give bodies geoms with contype and conaffinity 1"
            raise ModelError("no two of its bodies can collide", source, hint)
        self.names = [(_name(model, first), _name(model, second)) for first, second in self._pairs]
        """of the bodies of each pair of shapes"""

    def clearance(self, time: Array, angle: Array) -> Clearance:
        """Return how near bodies come along a trajectory: time [s], (T,), and angles of all joints [rad]."""
        distance = np.stack([self._distances(pose, FARTHEST) for pose in angle])
        depths: dict[tuple[str, str], Array] = {}
        for pair in np.flatnonzero(distance.min(axis=0) < 0):
            inside = np.maximum(-distance[:, pair], 0.0)
            depths[self.names[pair]] = np.maximum(depths.get(self.names[pair], 0.0), inside)
        meetings = [meeting for names, depth in depths.items() for meeting in _meetings(names, time, depth)]
        meetings.sort(key=lambda meeting: meeting.from_s)
        nearest = tuple(self.names[pair] for pair in distance.argmin(axis=1))
        checked = len({*map(frozenset, self.names)})
        pairs = [(s >> 16, s & 0xFFFF) for s in self._model.exclude_signature.tolist()]
        excluded = tuple((self._model.body(a).name, self._model.body(b).name) for a, b in pairs)
        return Clearance(time, distance.min(axis=1), nearest, tuple(meetings), checked, excluded)

    def first_below(self, angle: Array, margin: float) -> int | None:
        """Return the first sample of a trajectory [rad], (T, nq), with two bodies nearer than a margin [m].

        None where every distance keeps the margin, 0 or more.
        """
        near = (k for k, pose in enumerate(angle) if self._distances(pose, margin).min() < margin)
        return next(near, None)

    def _distances(self, pose: Array, within: float) -> Array:
        """Distances of all pairs of shapes in a pose [m], shape (P,); farther than `within` they are that."""
        self._data.qpos[:] = pose
        mujoco.mj_kinematics(self._model, self._data)
        here = self._model, self._data
        return np.array([mujoco.mj_geomDistance(*here, *pair, within, None) for pair in self._pairs])


def _name(model: mujoco.MjModel, geom: int) -> str:
    """A body's name; of what stands in the world the shape's, such as the floor's."""
    body = int(model.geom_bodyid[geom])
    return model.body(body).name if body else model.geom(geom).name or "world"


def _pairs(model: mujoco.MjModel) -> list[list[int]]:
    g, h = np.triu_indices(model.ngeom, 1)
    kinds, masks, bodies = model.geom_contype, model.geom_conaffinity, model.geom_bodyid
    weld, parent = model.body_weldid, model.body_weldid[model.body_parentid[model.body_weldid]]
    a, b = bodies[g], bodies[h]
    jointed = (weld[a] * weld[b] > 0) & ((weld[a] == parent[b]) | (weld[b] == parent[a]))
    meant = (kinds[g] & masks[h] | kinds[h] & masks[g]) != 0
    excluded = np.isin((np.minimum(a, b) << 16) + np.maximum(a, b), model.exclude_signature)
    return np.stack([g, h], axis=1)[meant & (weld[a] != weld[b]) & ~jointed & ~excluded].tolist()


def _meetings(names: tuple[str, str], time: Array, depth: Array) -> Generator[Meeting]:
    """Yield every time that two bodies met from how deep they were inside each other [m], shape (T,)."""
    samples = np.flatnonzero(depth)
    for run in np.split(samples, np.flatnonzero(np.diff(samples) > 1) + 1):
        begins, ends, worst = run[0], run[-1], run[np.argmax(depth[run])]
        yield Meeting([*names], *map(float, (time[begins], time[ends], depth[worst], time[worst])))
