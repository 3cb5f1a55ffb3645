"""Arms in motion: a simulated machine beside the measured one, or a plant under its
sliders."""

from collections.abc import Mapping

import mujoco
import numpy as np

from hydroid.arm.model import ALONE, Machine, load_machine
from hydroid.arrays import Array, Mask, record, rms
from hydroid.errors import SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.plant import Plant
from hydroid.prediction import predict_log

MOMENTS = 60
"""of a motion, at which it is looked where the machine is"""


@record
class Motion:
    """A machine under the commands of logs: times [s], (T,), and angles of all joints
    [rad], (T, nq).

    `measured` is None where the logs hold no motion; `error` is the rms difference of
    the driven joints that were measured [deg], NaN where there are none.
    """

    machine: Machine
    time: Array
    simulated: Array
    measured: Array | None
    error: float


def simulated_motion(model: IdentifiedModel, logs: Mapping[str, Log]) -> Motion:
    """Simulate the commands of logs, by the name of the arm that they move
    (`Machine.sides`)."""
    arm = model.settings.arm
    machine = load_machine(arm, pair=ALONE not in logs)
    for log in logs.values():
        if not log.driven.any():
            raise SettingsError(
                "commands nothing", log.source, "name a log with commands"
            )
    simulated = {side: predict_log(model, log).angle for side, log in logs.items()}
    rest = arm.pose(model.settings.start_pose)
    moved = {side: log.posed for side, log in logs.items() if _moves(log.angle).any()}
    measured = None
    if moved:
        measured = machine.joined(simulated | moved, rest)
    time = next(iter(logs.values())).time
    error = _rms_error(logs, simulated)
    return Motion(machine, time, machine.joined(simulated, rest), measured, error)


def _rms_error(logs: Mapping[str, Log], simulated: Mapping[str, Array]) -> float:
    """Return the rms difference [deg] of simulated angles [rad], (T, J), and the
    measured ones."""
    errors = list[Array]()
    for side, log in logs.items():
        compared = log.driven & _moves(log.angle)
        difference = log.angle - simulated[side]
        errors.append(difference[:, compared].ravel())
    error = np.concatenate(errors)
    if not error.size:
        return np.nan
    return float(np.degrees(rms(error)))


def _moves(angle: Array) -> Mask:
    """Return which measured angles, shape (T, J), move, (J,)."""
    return np.nan_to_num(np.ptp(angle, axis=0)) > 0


def place(model: mujoco.MjModel, data: mujoco.MjData, angle: Array) -> None:
    """Bring all that is drawn of a machine to joint angles [rad], shape (nq,)."""
    data.qpos[:] = angle
    for update in (
        mujoco.mj_kinematics,
        mujoco.mj_comPos,
        mujoco.mj_camlight,
        mujoco.mj_tendon,
    ):
        update(model, data)


@record
class Region:
    """A sphere around all that is drawn of a machine: its centre [m], shape (3,), and
    radius [m]."""

    centre: Array
    radius: float


def region_of(model: mujoco.MjModel, angles: Array) -> Region:
    """Return the region of a machine at angles of all joints [rad], (F, nq), without
    the floor."""
    data = mujoco.MjData(model)
    solid = model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    if not solid.any():
        return Region(model.stat.center.copy(), float(model.stat.extent))
    around = model.geom_rbound[solid]
    places = np.empty((len(angles), len(around), 3))
    for row, angle in zip(places, angles, strict=True):
        place(model, data, angle)
        row[:] = data.geom_xpos[solid]
    low = (places - around[:, None]).min(axis=(0, 1))
    high = (places + around[:, None]).max(axis=(0, 1))
    centre = (low + high) / 2
    away = np.linalg.norm(places - centre, axis=2) + around
    return Region(centre, float(away.max()))


class Sliders:
    """A plant with all joints on the viewer's sliders, from a named pose or the
    settings' start pose.
    """

    duration = np.inf
    ghost = None

    @property
    def region(self) -> Region:
        """Where the machine stands."""
        return region_of(self.model, self.data.qpos[None])

    def __init__(self, plant: Plant, pose: str | None = None) -> None:
        self.plant = plant
        self._start = pose
        self.restart()
        # a plant that locks joints has a model of its own in each pose: take it after
        # the reset
        self.model = plant.model
        self.data = plant.data

    def restart(self) -> None:
        """Go back to the start."""
        self.plant.reset(self._start)
        self.advance(0.0)

    def advance(self, until: float) -> None:
        """Step to the period before `until` [s]."""
        plant = self.plant
        while plant.time + plant.period <= until + 1e-9:
            plant.step(plant.command)
        # `mj_step` leaves what is drawn a step behind
        place(plant.model, plant.data, plant.data.qpos)
        self.time = plant.time


class Replay:
    """A simulated motion from its start to its end."""

    @property
    def region(self) -> Region:
        """Where the machine and its ghost are in the course of the motion."""
        motion = self._motion
        moments = np.unique(
            np.linspace(0, len(motion.time) - 1, MOMENTS).round().astype(int)
        )
        angles = [motion.simulated[moments]]
        if motion.measured is not None:
            angles.append(motion.measured[moments])
        return region_of(self.model, np.concatenate(angles))

    def __init__(self, motion: Motion) -> None:
        self._motion = motion
        self.model = motion.machine.model
        self.data = mujoco.MjData(self.model)
        self.duration = float(motion.time[-1])
        self.ghost = None if motion.measured is None else mujoco.MjData(self.model)
        self.restart()

    def restart(self) -> None:
        """Go back to the start."""
        self.advance(0.0)

    def advance(self, until: float) -> None:
        """Go on to the sample before `until` [s]."""
        motion = self._motion
        sample = max(0, np.searchsorted(motion.time, until + 1e-9) - 1)
        self.time = self.data.time = motion.time[sample]
        place(self.model, self.data, motion.simulated[sample])
        if self.ghost is not None and motion.measured is not None:
            place(self.model, self.ghost, motion.measured[sample])


Playback = Sliders | Replay
"""what is drawn (`model`, `data` and, where something was measured, `ghost`), the
`time` that is shown and the `duration` after which all stands still [s]"""
