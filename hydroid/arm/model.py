"""An arm's compiled model: with a payload where a log has one,
or beside its mirror image on one carrier.

Which of its bodies meet along a trajectory, and how near they come otherwise: bodies
collide with the shapes that the MJCF makes collide; a mesh counts as its convex hull.
Distances are MuJoCo's (`mj_geomDistance`). As in MuJoCo a body is not held against the
one that it hangs on, nor against one that the model excludes; `hydroid init` excludes
bodies that touch in the pose `home`.
"""

from collections.abc import Mapping
from functools import cached_property
from itertools import product

import mujoco
import numpy as np

from hydroid.arm.tip import tip_of
from hydroid.arrays import Array, Mask, record
from hydroid.errors import ModelError, SettingsError
from hydroid.mjcf import mujoco_errors, quiet_mujoco, read_mjcf
from hydroid.settings.arm import TIP_LOAD, Arm

ALONE = "alone"  # the name of the arm that is not one of two
SIDES = ("right", "left")
"""the arms of a pair in the order of its joints;
the names of their parts begin with these and `_`"""


def load_model(arm: Arm) -> mujoco.MjSpec:
    """Read the arm's MJCF, which compiles, with the load that it always carries."""
    spec = read_mjcf(arm.model)
    with mujoco_errors(arm.model):
        spec.compile()
    if arm.load:
        return add_payload(spec, arm, arm.load, TIP_LOAD)
    return spec


def add_payload(
    spec: mujoco.MjSpec, arm: Arm, mass: float, name: str = "payload"
) -> mujoco.MjSpec:
    """Return a copy of the arm's model that carries `mass` [kg] at its tip, as a body
    of this name."""
    with quiet_mujoco():
        model = spec.compile()
    tip = tip_of(model, arm)
    loaded = spec.copy()
    # of a ball of 5 cm: its own inertia is small beside what its distance makes
    moment = 0.4 * mass * 0.05**2
    link = model.body(tip.body).name
    carrier = loaded.body(link) if link else loaded.joint(arm.joint_names[-1]).parent
    carrier.add_body(
        name=name,
        pos=tip.at,
        explicitinertial=True,
        mass=mass,
        ipos=[0.0] * 3,
        inertia=[moment] * 3,
    )
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

    `nearest` names the two bodies of each sample, `meetings` stand in the order of
    their beginnings; `excluded` are pairs that the model excludes, `checked` is the
    number of the others.
    """

    time: Array
    distance: Array
    nearest: tuple[tuple[str, str], ...]
    meetings: tuple[Meeting, ...]
    checked: int
    excluded: tuple[tuple[str, str], ...]


class CollisionChecker:
    """Distances between the bodies of a compiled model whose joints are all hinges or
    slides."""

    def __init__(self, model: mujoco.MjModel, source: str = "the model") -> None:
        self._model = model
        self._data = mujoco.MjData(model)
        self._pairs = _pairs(model)
        if not self._pairs:
            hint = "give bodies geoms with contype and conaffinity 1"
            raise ModelError("no two of its bodies can collide", source, hint)
        names = [_owner(model, geom) for geom in range(model.ngeom)]
        self.names = [(names[first], names[second]) for first, second in self._pairs]
        """of the bodies of each pair of shapes"""

    def clearance(self, time: Array, angle: Array) -> Clearance:
        """Return how near bodies come along a trajectory: time [s], (T,),
        and angles of all joints [rad]."""
        distance = np.stack([self._distances(pose, FARTHEST) for pose in angle])
        body = self._model.body
        # MuJoCo keeps a pair as one number, the first body in its upper half
        signatures = self._model.exclude_signature.tolist()
        excluded = [
            (body(pair >> 16).name, body(pair & 0xFFFF).name) for pair in signatures
        ]
        return Clearance(
            time=time,
            distance=distance.min(axis=1),
            nearest=tuple(self.names[pair] for pair in distance.argmin(axis=1)),
            meetings=self._meetings(time, distance),
            checked=len({*map(frozenset, self.names)}),
            excluded=tuple(excluded),
        )

    def _meetings(self, time: Array, distance: Array) -> tuple[Meeting, ...]:
        """Return when bodies are inside each other, by the distances of all pairs of
        shapes, (T, P)."""
        # of a body's shapes the deepest
        depths: dict[tuple[str, str], Array] = {}
        for pair in np.flatnonzero(distance.min(axis=0) < 0):
            inside = np.maximum(-distance[:, pair], 0.0)
            names = self.names[pair]
            depths[names] = np.maximum(depths.get(names, 0.0), inside)
        meetings = list[Meeting]()
        for names, depth in depths.items():
            samples = np.flatnonzero(depth)
            gaps = np.flatnonzero(np.diff(samples) > 1)
            for run in np.split(samples, gaps + 1):
                deepest = run[np.argmax(depth[run])]
                meetings.append(
                    Meeting(
                        bodies=[*names],
                        from_s=float(time[run[0]]),
                        to_s=float(time[run[-1]]),
                        depth_m=float(depth[deepest]),
                        deepest_at_s=float(time[deepest]),
                    )
                )
        meetings.sort(key=lambda meeting: meeting.from_s)
        return tuple(meetings)

    def first_below(
        self, angle: Array, margin: float, counted: Mask | None = None
    ) -> int | None:
        """Return the first sample of a motion [rad], (T, nq),
        with two bodies nearer than a margin [m].

        `counted` are the pairs of shapes that count, shape (P,); None: all.
        """
        for sample, pose in enumerate(angle):
            near = self._distances(pose, margin) < margin
            if np.any(near if counted is None else near[counted]):
                return sample
        return None

    def below(
        self, angle: Array, margin: float, counted: Mask
    ) -> tuple[tuple[str, str], float]:
        """Return which two bodies are nearer than a margin [m] most often,
        and in what part of a motion."""
        near = np.stack([self._distances(pose, margin) for pose in angle]) < margin
        share = np.where(counted, near.mean(axis=0), -1.0)
        return self.names[int(np.argmax(share))], float(share.max())

    def changing(self, poses: Array) -> Mask:
        """Return which pairs of shapes stand at different distances in some poses
        [rad], (n, nq): shape (P,).

        No joint moves the others nearer: a base and what turns on it.
        """
        distances = [self._distances(pose, FARTHEST) for pose in poses]
        return np.ptp(distances, axis=0) > STILL

    def _distances(self, pose: Array, within: float) -> Array:
        """Return distances of all pairs of shapes in a pose [m], shape (P,);
        farther than `within` they are that."""
        self._data.qpos[:] = pose
        mujoco.mj_kinematics(self._model, self._data)
        distances = [
            mujoco.mj_geomDistance(self._model, self._data, first, second, within, None)
            for first, second in self._pairs
        ]
        return np.array(distances)


def _owner(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of a shape's body; what stands in the world has its own,
    such as the floor."""
    body = int(model.geom_bodyid[geom])
    if body:
        return model.body(body).name
    return model.geom(geom).name or "world"


def _pairs(model: mujoco.MjModel) -> list[list[int]]:
    """Return the pairs of shapes that may collide, as MuJoCo chooses them."""
    first, second = np.triu_indices(model.ngeom, 1)
    kinds = model.geom_contype
    masks = model.geom_conaffinity
    meets_second = kinds[first] & masks[second]
    meets_first = kinds[second] & masks[first]
    meant = (meets_second | meets_first) != 0
    # bodies that no joint separates count as one, the weld
    bodies = (model.geom_bodyid[first], model.geom_bodyid[second])
    welds = [model.body_weldid[body] for body in bodies]
    above = [model.body_weldid[model.body_parentid[weld]] for weld in welds]
    apart = welds[0] != welds[1]
    neighbours = (welds[0] == above[1]) | (welds[1] == above[0])
    jointed = (welds[0] * welds[1] > 0) & neighbours
    signature = (np.minimum(*bodies) << 16) + np.maximum(*bodies)
    excluded = np.isin(signature, model.exclude_signature)
    chosen = meant & apart & ~jointed & ~excluded
    return np.stack([first, second], axis=1)[chosen].tolist()


@record
class Machine:
    """A whole machine, all joints free, to be put into poses.

    Its `sides` name its arms, `ALONE` or right and left; the compiled model's joints
    are theirs, arm by arm.
    """

    arm: Arm
    model: mujoco.MjModel
    sides: tuple[str, ...]

    @cached_property
    def checker(self) -> CollisionChecker:
        """Which of its bodies meet."""
        return CollisionChecker(self.model, self.arm.name)

    def joined(self, angle: Mapping[str, Array], rest: Array) -> Array:
        """Return all joints' angles [rad], (T, nq), of arms that move, (T, J) by name;
        others rest, (J,)."""
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
    wanted = [f"{side}_{name}" for side, name in product(SIDES, arm.joint_names)]
    if [joint.name for joint in spec.joints] != wanted:
        hint = f"the joints of two arms are {', '.join(wanted)}"
        raise ModelError("is not the model of two of the arm", arm.pair, hint)
    with mujoco_errors(arm.pair):
        return Machine(arm, spec.compile(), SIDES)
