"""Which bodies of an arm meet along a trajectory, and how near they come otherwise.

Bodies collide with the shapes that the MJCF makes collide; a mesh counts as its convex hull. Distances are
MuJoCo's (`mj_geomDistance`). As in MuJoCo a body is not held against the one that it hangs on, nor against
one that the model excludes; `hydroid init` excludes bodies that touch in the pose `home`.

Most distances need no computing. When the joints turn by dq, no point of a body moves farther than the sum of
|dq_j| times its greatest distance from joint j; so a known distance is a lower bound for some time
(conservative advancement: B. Mirtich, 1996).
"""

from collections.abc import Generator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from hydroid.errors import ModelError

Array = NDArray[np.float64]

FARTHEST = 100.0
"""distance beyond which MuJoCo need not look [m]"""


@dataclass(frozen=True)
class Meeting:
    """Two bodies inside each other, from one sample to another."""

    first: str
    second: str
    begins: float
    """[s]"""
    ends: float
    """[s]"""
    depth: float
    """how far they are inside each other at most [m]"""
    deepest: float
    """when [s]"""


@dataclass(frozen=True, eq=False)
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

    @property
    def smallest(self) -> int:
        """The sample at which bodies are nearest, or deepest inside each other."""
        return int(np.argmin(self.distance))


class CollisionChecker:
    """Distances between the bodies of a compiled model whose joints are all hinges or slides.

    Args:
        model: compiled; contacts may be switched off.
        source: for messages.

    Raises:
        ModelError: nothing in the model can collide.
    """

    def __init__(self, model: mujoco.MjModel, source: str = "the model") -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._pairs = _pairs(model)
        if not len(self._pairs):
            hint = "give bodies geoms with contype and conaffinity 1"
            raise ModelError("no two of its bodies can collide", where=source, hint=hint)
        self._sweep = _sweep(model, self._pairs)
        self.names = [(_name(model, first), _name(model, second)) for first, second in self._pairs.tolist()]
        """of the bodies of each pair of shapes"""

    @property
    def excluded(self) -> tuple[tuple[str, str], ...]:
        """Pairs of bodies that the model excludes and that could collide otherwise."""
        m = self._model
        solid = set(m.geom_bodyid[(m.geom_contype | m.geom_conaffinity) > 0].tolist())
        pairs = [(s >> 16, s & 0xFFFF) for s in m.exclude_signature.tolist()]
        return tuple((m.body(a).name, m.body(b).name) for a, b in pairs if {a, b} <= solid)

    def clearance(self, time: Array, angle: Array) -> Clearance:
        """Return how near bodies come along a trajectory.

        Args:
            time: [s], shape (T,).
            angle: of all joints in the model's order [rad], shape (T, nq).
        """
        distance, nearest = np.empty(len(time)), list[tuple[str, str]]()
        depths: dict[tuple[str, str], Array] = {}
        for sample, (near, least, which) in enumerate(self._walk(angle, FARTHEST)):
            distance[sample] = least
            nearest.append(self.names[which])
            for pair, here in near:
                if here < 0:
                    depth = depths.setdefault(self.names[pair], np.zeros(len(time)))
                    depth[sample] = max(depth[sample], -here)
        meetings = [meeting for names, depth in depths.items() for meeting in _meetings(names, time, depth)]
        meetings.sort(key=lambda meeting: meeting.begins)
        checked = len({tuple(sorted(pair)) for pair in self.names})
        return Clearance(time, distance, tuple(nearest), tuple(meetings), checked, self.excluded)

    def first_below(self, angle: Array, margin: float) -> tuple[int, tuple[str, str]] | None:
        """Return the first sample of a trajectory [rad], (T, nq), with two bodies nearer than a margin [m].

        Returns:
            The sample and the names of the bodies; None where every distance keeps the margin.
        """
        for sample, (_, least, which) in enumerate(self._walk(angle, margin)):
            if least < margin:
                return sample, self.names[which]
        return None

    def _walk(self, angle: Array, within: float) -> Generator[tuple[list[tuple[int, float]], float, int]]:
        """Yield of each sample the pairs looked at with their distances [m], the least, and whose it is.

        Pairs farther apart than `within` [m] are not looked for, and where there are none nearer it is the
        least. All pairs inside each other are looked at.
        """
        known = np.full(len(self._pairs), -np.inf)  # lower bounds of the distances
        turned = np.abs(np.diff(angle, axis=0, prepend=angle[:1]))
        for pose, change in zip(angle, turned, strict=True):
            known -= change @ self._sweep
            near, least, which = list[tuple[int, float]](), within, 0
            if known.min() < max(within, 0.0):
                self._data.qpos[:] = pose
                mujoco.mj_kinematics(self._model, self._data)
            for pair in np.argsort(known).tolist():
                if known[pair] >= max(least, 0.0):
                    break
                first, second = self._pairs[pair].tolist()
                here = mujoco.mj_geomDistance(self._model, self._data, first, second, FARTHEST, None)
                known[pair] = here
                near.append((pair, here))
                if here < least:
                    least, which = here, pair
            yield near, least, which


def _name(model: mujoco.MjModel, geom: int) -> str:
    """A body's name; of what stands in the world the shape's, such as the floor's."""
    body = int(model.geom_bodyid[geom])
    return model.body(body).name if body else model.geom(geom).name or "world"


def _pairs(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Pairs of geoms that MuJoCo would let collide, shape (P, 2)."""
    weld, parent = model.body_weldid, model.body_weldid[model.body_parentid[model.body_weldid]]
    excluded = set(model.exclude_signature.tolist())
    kinds, masks, bodies = model.geom_contype, model.geom_conaffinity, model.geom_bodyid

    def collide(g: int, h: int) -> bool:
        a, b = int(bodies[g]), int(bodies[h])
        adjacent = weld[a] and weld[b] and (weld[a] == parent[b] or weld[b] == parent[a])
        apart = weld[a] != weld[b] and not adjacent
        seen = bool(kinds[g] & masks[h] or kinds[h] & masks[g])
        return seen and apart and (min(a, b) << 16) + max(a, b) not in excluded

    found = [(g, h) for g in range(model.ngeom) for h in range(g + 1, model.ngeom) if collide(g, h)]
    return np.array(found, np.intp).reshape(-1, 2)


def _sweep(model: mujoco.MjModel, pairs: NDArray[np.intp]) -> Array:
    """How far two geoms approach at most when a joint turns by 1 rad or slides by 1 m, shape (nq, P)."""
    reach = np.zeros((model.nq, model.ngeom))
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        far = float(np.linalg.norm(model.geom_pos[geom]) + model.geom_rbound[geom])
        while body:
            for joint in np.flatnonzero(model.jnt_bodyid == body):
                slides = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
                reach[joint, geom] = 1.0 if slides else far + np.linalg.norm(model.jnt_pos[joint])
            far += float(np.linalg.norm(model.body_pos[body]))
            body = int(model.body_parentid[body])
    first, second = reach[:, pairs[:, 0]], reach[:, pairs[:, 1]]
    # a joint that carries both moves them as one
    return np.where((first > 0) & (second > 0), 0.0, first + second)


def _meetings(names: tuple[str, str], time: Array, depth: Array) -> Generator[Meeting]:
    """Yield every time that two bodies met from how deep they were inside each other [m], shape (T,)."""
    samples = np.flatnonzero(depth)
    for run in np.split(samples, np.flatnonzero(np.diff(samples) > 1) + 1):
        begins, ends, worst = run[0], run[-1], run[np.argmax(depth[run])]
        when = float(time[begins]), float(time[ends])
        yield Meeting(*names, *when, float(depth[worst]), float(time[worst]))
