"""A population of arms on `mujoco.batch`: each member with its own masses, dampers and springs.

Every member starts at rest in the log's first pose, in static balance with gravity. Its springs are
slack there, and a constant torque tau0 = g(q0), computed anew for every member, holds it.
"""

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, fields

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from hydroid.arm.locked import LockedArm
from hydroid.simulation.prescribed import Prescribed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ArmParameters:
    """Physical values of a population; J joints and L links in the arm's order.

    gain [N·m/%], damping [N·m·s/rad], stiffness [N·m/rad], friction [N·m]: shape (n, J).
    mass [kg]: shape (n, L).
    """

    gain: Array
    damping: Array
    stiffness: Array
    friction: Array
    mass: Array

    def __len__(self) -> int:
        return len(self.mass)

    def __getitem__(self, rows: slice) -> "ArmParameters":
        return ArmParameters(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


@dataclass(frozen=True)
class Response:
    """Simulated angles [rad], shape (n, T, K), of the K output joints.

    A member that diverged has `feasible` False, shape (n,), and NaN throughout.
    """

    angle: Array
    feasible: NDArray[np.bool_]


@contextmanager
def quiet_mujoco() -> Generator[None]:
    """Keep MuJoCo from printing a warning for every diverged member, and from writing MUJOCO_LOG.TXT."""
    before = mujoco.MjLogConfig.get()
    silent = mujoco.MjLogConfig.get()
    silent.logto_console = False
    silent.logto_file = False
    mujoco.MjLogConfig.set(silent)
    try:
        yield
    finally:
        mujoco.MjLogConfig.set(before)


class Population:
    """Up to `size` members of one arm, stepped together on a thread pool.

    Args:
        arm: the arm with the joints that do not move left out.
        size: members of one call.
        threads: threads that step them; 0 is one a core. Results do not depend on it.
    """

    def __init__(self, arm: LockedArm, size: int, threads: int) -> None:
        self.arm, self.size = arm, size
        self._prescribed: Prescribed | None = None
        self._batch = Batch(arm.model, nsim=size, nthread=threads)
        expand = self._batch.expand
        self._mass, self._inertia = expand("body_mass"), expand("body_inertia")
        self._centre, self._axes = expand("body_ipos"), expand("body_iquat")
        self._damping, self._stiffness = expand("dof_damping"), expand("jnt_stiffness")
        self._friction = expand("dof_frictionloss")
        self._applied = self._batch.bind("qfrc_applied")
        self._position = self._batch.bind("qpos")
        # bound before the first call: a derived field bound between calls reads zero
        self._bias = self._batch.bind("qfrc_bias")

    def follow(self, prescribed: Prescribed) -> None:
        """Let some joints follow a log; they keep no damper and spring of their own."""
        self._prescribed = prescribed

    def start(self, parameters: ArmParameters, joints: NDArray[np.intp], pose: Array) -> Array:
        """Put the members into `pose` at rest and return what holds them there.

        Args:
            parameters: n <= size members.
            joints: the moving joints among the arm's, 0-based, shape (V,).
            pose: angles of the moving joints [rad], shape (V,).

        Returns:
            tau0 = g(q0) of equation (1) [N·m], shape (n, V).
        """
        n = len(parameters)
        ids = np.arange(n)
        inertials = self.arm.inertials(parameters.mass)
        self._mass[:n], self._inertia[:n] = inertials.mass, inertials.inertia
        self._centre[:n], self._axes[:n] = inertials.ipos, inertials.iquat
        self._damping[:n] = parameters.damping[:, joints]
        self._stiffness[:n] = parameters.stiffness[:, joints]
        self._friction[:n] = parameters.friction[:, joints]
        if self._prescribed is not None:
            columns = self._prescribed.columns
            self._damping[:n, columns] = self._prescribed.damping
            self._stiffness[:n, columns] = self._prescribed.stiffness
            self._friction[:n, columns] = 0.0
        with quiet_mujoco():
            self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
            self._batch.set_const(ids)
            self._position[:n] = pose
            self._applied[:n] = 0.0
            self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_VEL.value)
        self._batch.warning[:n] = 0
        return self._bias[:n].copy()

    def roll(self, torque: Array, out: Array) -> NDArray[np.bool_]:
        """Step the members under the given joint torques.

        Args:
            torque: applied at each step [N·m], shape (n, steps, V), C-contiguous.
            out: receives the angles after each step [rad], shape (n, steps, V).

        Returns:
            Which members stayed finite and without a warning of MuJoCo's, shape (n,).
        """
        n, steps, _ = torque.shape
        spec = mujoco.mjtState.mjSTATE_QFRC_APPLIED.value
        failed = np.zeros(n, dtype=bool)
        with quiet_mujoco():
            try:
                self._batch.rollout(steps, torque, spec, ("qpos",), np.arange(n), {"qpos": out})
            except SimulationError as error:
                failed[error.ids] = True
        # a member whose warnings rose stopped there; what it recorded after that is no simulation
        failed |= self._batch.warning[:n, :, 1].any(axis=1)
        return ~failed & np.isfinite(out[:, -1]).all(axis=-1)
