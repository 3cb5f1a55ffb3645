"""An arm's compiled model: with a payload where a log has one,
or beside its mirror image on one carrier.

Which of its bodies meet along a trajectory, and how near they come otherwise: bodies collide with
the shapes that the MJCF makes collide; a mesh counts as its convex hull. Distances are MuJoCo's
(`mj_geomDistance`). As in MuJoCo a body is not held against the one that it hangs on, nor against
one that the model excludes; `hydroid init` excludes bodies that touch in the pose `home`.
"""

from collections.abc import Mapping
from functools import cached_property

import mujoco
import numpy as np

from hydroid.arrays import Array, Mask, record
from hydroid.errors import ModelError, SettingsError
from hydroid.mjcf import mujoco_errors, read_mjcf
from hydroid.settings.arm import Arm

ALONE = "alone"  # the name of the arm that is not one of two
SIDES = ("right", "left")
"""the arms of a pair in the order of its joints;
the names of their parts begin with these and `_`"""


def load_model(arm: Arm) -> mujoco.MjSpec:
    """Read the arm's MJCF, which compiles."""
    spec = read_mjcf(arm.model)
    with mujoco_errors(arm.model):
        spec.compile()
    return spec


def add_payload(spec: mujoco.MjSpec, arm: Arm, mass: float) -> mujoco.MjSpec:
    """Return a copy of the arm's model that carries `mass` [kg] at the site of its payload."""
    if arm.payload is None:
        hint = "name the site of the model that holds it in the arm's file, payload: SITE"
        raise SettingsError(f"{arm.name} has no place for a payload", "payloads", hint)
    loaded = spec.copy()
    # of a ball of 5 cm: its own inertia is small beside what its distance makes
    site, moment = loaded.site(arm.payload), 0.4 * mass * 0.05**2
    body = site.parent.add_body(
        name="payload", pos=site.pos, explicitinertial=True, mass=mass, ipos=[0.0] * 3, inertia=[moment] * 3
    )
    if site.frame is not None:
        body.set_frame(site.frame)
    return loaded


STILL = 1e-4  # change of a distance that is none [m]
FARTHEST = 100.0  # distance beyond which MuJoCo need not look [m]


@record
class Meeting:
    """Two bodies inside each other, from one sample to another; at most by a depth,
    reached at a time."""

    bodies: list[str]
    from_s: float
    to_s: float
    depth_m: float
    deepest_at_s: float


@record
class Clearance:
    """The smallest distance of any two bodies [m], (T,), along a trajectory;
    negative inside each other.

    `nearest` names the two bodies of each sample, `meetings` stand in the order of their
    beginnings; `excluded` are pairs that the model excludes, `checked` is the number of the others.
    """

    time: Array
    distance: Array
    nearest: tuple[tuple[str, str], ...]
    meetings: tuple[Meeting, ...]
    checked: int
    excluded: tuple[tuple[str, str], ...]


class CollisionChecker:
    """Distances between the bodies of a compiled model whose joints are all hinges or slides."""

    def __init__(self, model: mujoco.MjModel, source: str = "the model") -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._pairs = _pairs(model)
        if not self._pairs:
            hint = "give bodies geoms with contype and conaffinity 1"
            raise ModelError("no two of its bodies can collide", source, hint)
        # what stands in the world has the shape's name, such as the floor's
        owners = enumerate(model.geom_bodyid.tolist())
        names = [model.body(b).name if b else model.geom(g).name or "world" for g, b in owners]
        self.names = [(names[first], names[second]) for first, second in self._pairs]
        """of the bodies of each pair of shapes"""

    def clearance(self, time: Array, angle: Array) -> Clearance:
        """Return how near bodies come along a trajectory: time [s], (T,),
        and angles of all joints [rad]."""
        distance = np.stack([self._distances(pose, FARTHEST) for pose in angle])
        depths: dict[tuple[str, str], Array] = {}
        for pair in np.flatnonzero(distance.min(axis=0) < 0):
            inside = np.maximum(-distance[:, pair], 0.0)
            depths[self.names[pair]] = np.maximum(depths.get(self.names[pair], 0.0), inside)
        meetings = list[Meeting]()
        for names, depth in depths.items():
            samples = np.flatnonzero(depth)
            for run in np.split(samples, np.flatnonzero(np.diff(samples) > 1) + 1):
                begins, ends, worst = run[0], run[-1], run[np.argmax(depth[run])]
                numbers = map(float, (time[begins], time[ends], depth[worst], time[worst]))
                meetings.append(Meeting([*names], *numbers))
        meetings.sort(key=lambda meeting: meeting.from_s)
        nearest = tuple(self.names[pair] for pair in distance.argmin(axis=1))
        checked = len({*map(frozenset, self.names)})
        body, signatures = self._model.body, self._model.exclude_signature.tolist()
        excluded = tuple((body(pair >> 16).name, body(pair & 0xFFFF).name) for pair in signatures)
        return Clearance(time, distance.min(axis=1), nearest, tuple(meetings), checked, excluded)

    def first_below(self, angle: Array, margin: float, counted: Mask | None = None) -> int | None:
        """Return the first sample of a motion [rad], (T, nq),
        with two bodies nearer than a margin [m].

        `counted` are the pairs of shapes that count, shape (P,); None: all.
        """
        for k, pose in enumerate(angle):
            if np.any(self._distances(pose, margin)[... if counted is None else counted] < margin):
                return k
        return None

    def below(self, angle: Array, margin: float, counted: Mask) -> tuple[tuple[str, str], float]:
        """Return which two bodies are nearer than a margin [m] most often,
        and in what part of a motion."""
        near = np.stack([self._distances(pose, margin) for pose in angle]) < margin
        share = np.where(counted, near.mean(axis=0), -1.0)
        return self.names[int(np.argmax(share))], float(share.max())

    def changing(self, poses: Array) -> Mask:
        """Return which pairs of shapes stand at different distances in some poses [rad], (n, nq):
        shape (P,).

        No joint moves the others nearer: a base and what turns on it.
        """
        return np.ptp([self._distances(pose, FARTHEST) for pose in poses], axis=0) > STILL

    def _distances(self, pose: Array, within: float) -> Array:
        """Distances of all pairs of shapes in a pose [m], shape (P,);
        farther than `within` they are that."""
        self._data.qpos[:] = pose
        mujoco.mj_kinematics(self._model, self._data)
        return np.array(
            [mujoco.mj_geomDistance(self._model, self._data, *pair, within, None) for pair in self._pairs]
        )


def _pairs(model: mujoco.MjModel) -> list[list[int]]:
    g, h = np.triu_indices(model.ngeom, 1)
    kinds, masks, bodies = model.geom_contype, model.geom_conaffinity, model.geom_bodyid
    weld, parent = model.body_weldid, model.body_weldid[model.body_parentid[model.body_weldid]]
    a, b = bodies[g], bodies[h]
    jointed = (weld[a] * weld[b] > 0) & ((weld[a] == parent[b]) | (weld[b] == parent[a]))
    meant = (kinds[g] & masks[h] | kinds[h] & masks[g]) != 0
    excluded = np.isin((np.minimum(a, b) << 16) + np.maximum(a, b), model.exclude_signature)
    return np.stack([g, h], axis=1)[meant & (weld[a] != weld[b]) & ~jointed & ~excluded].tolist()


@record
class Machine:
    """A whole machine, all joints free, to be put into poses.

    Its `sides` name its arms, `ALONE` or right and left; the compiled model's joints are theirs,
    arm by arm.
    """

    arm: Arm
    model: mujoco.MjModel
    sides: tuple[str, ...]

    @cached_property
    def checker(self) -> CollisionChecker:
        """Which of its bodies meet."""
        return CollisionChecker(self.model, self.arm.name)

    def joined(self, angle: Mapping[str, Array], rest: Array) -> Array:
        """Return all joints' angles [rad], (T, nq), of arms that move, (T, J) by name; others rest,
        (J,)."""
        still = np.tile(rest, (max(map(len, angle.values())), 1))
        return np.hstack([angle.get(side, still) for side in self.sides])


def load_machine(arm: Arm, *, pair: bool) -> Machine:
    """Read the model of an arm alone, or that of two of them."""
    if not pair:
        return Machine(arm, load_model(arm).compile(), (ALONE,))
    if arm.pair is None:
        hint = "name its MJCF in the arm's file, pair: MODEL.xml"
        raise SettingsError(f"{arm.name} stands alone", "--arm", hint)
    spec = read_mjcf(arm.pair)
    wanted = [f"{side}_{name}" for side in SIDES for name in arm.joint_names]
    if [joint.name for joint in spec.joints] != wanted:
        hint = f"the joints of two arms are {', '.join(wanted)}"
        raise ModelError("is not the model of two of the arm", arm.pair, hint)
    with mujoco_errors(arm.pair):
        return Machine(arm, spec.compile(), SIDES)
