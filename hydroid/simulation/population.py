"""A population of arms on `mujoco.batch`: each candidate with its own masses, dampers and springs.

Every candidate starts at rest in the log's first pose, in static balance with gravity. Its springs are
slack there, and a constant torque tau0 = g(q0), computed anew for every candidate, holds it.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from hydroid.arm.locked import LockedArm
from hydroid.arm.quiet import quiet_mujoco
from hydroid.hydraulics.records import Records
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

    def __getitem__(self, rows: slice | NDArray[np.intp]) -> "ArmParameters":
        return ArmParameters(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


@dataclass(frozen=True)
class Candidates:
    """A population: its arms, and in stage 2 their actuators, (n, J) for all joints of the arm."""

    arm: ArmParameters
    actuators: Records | None = None

    def __len__(self) -> int:
        return len(self.arm)

    def __getitem__(self, rows: slice | NDArray[np.intp]) -> "Candidates":
        actuators = None if self.actuators is None else self.actuators[rows]
        return Candidates(self.arm[rows], actuators)  # pyright: ignore[reportArgumentType]  # still a recarray


@dataclass(frozen=True)
class Response:
    """Simulated angles [rad], shape (n, T, K), of the K output joints.

    A candidate that diverged has `feasible` False, shape (n,), and NaN throughout. `pressure` [Pa], shape
    (n, T, L, 2), are those of chambers A and B of L joints, where they were asked for.
    """

    angle: Array
    feasible: NDArray[np.bool_]
    pressure: Array | None = None


def in_chunks(simulate: Callable[[Candidates], Response], candidates: Candidates, size: int) -> Response:
    """Simulate candidates `size` at a time: memory for the steps does not grow with their number."""
    parts = [simulate(candidates[i : i + size]) for i in range(0, len(candidates), size)]
    pressures = [p.pressure for p in parts if p.pressure is not None]
    return Response(
        np.concatenate([p.angle for p in parts]),
        np.concatenate([p.feasible for p in parts]),
        np.concatenate(pressures) if pressures else None,
    )


class Population:
    """Up to `size` candidates of one arm, stepped together on a thread pool.

    Args:
        arm: the arm with the joints that do not move left out.
        size: candidates of one call.
        threads: threads that step them; 0 is one a core. Results do not depend on it.
        prescribed: joints that follow a log; they keep no damper and spring of their own.

    Attributes, live arrays over the candidates:
        position [rad], velocity [rad/s], applied torque [N·m], damping [N·m·s/rad]: shape (size, V).
    """

    def __init__(self, arm: LockedArm, size: int, threads: int, prescribed: Prescribed | None = None) -> None:
        self.arm, self.size, self._prescribed = arm, size, prescribed
        self._batch = Batch(arm.model, nsim=size, nthread=threads)
        expand, bind = self._batch.expand, self._batch.bind
        self._failed = np.zeros(size, dtype=bool)
        self._mass, self._inertia = expand("body_mass"), expand("body_inertia")
        self._centre, self._axes = expand("body_ipos"), expand("body_iquat")
        self._stiffness, self._friction = expand("jnt_stiffness"), expand("dof_frictionloss")
        self.damping = expand("dof_damping")
        self._bias = bind(
            "qfrc_bias"
        )  # before the first call: a derived field bound between calls reads zero
        self.position, self.velocity, self.applied = bind("qpos"), bind("qvel"), bind("qfrc_applied")

    def start(self, parameters: ArmParameters, joints: NDArray[np.intp], pose: Array) -> Array:
        """Put the candidates into `pose` at rest and return what holds them there.

        Args:
            parameters: n <= size candidates.
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
        self.damping[:n] = parameters.damping[:, joints]
        self._stiffness[:n] = parameters.stiffness[:, joints]
        self._friction[:n] = parameters.friction[:, joints]
        if self._prescribed is not None:
            columns = self._prescribed.columns
            self.damping[:n, columns] = self._prescribed.damping
            self._stiffness[:n, columns] = self._prescribed.stiffness
            self._friction[:n, columns] = 0.0
        with quiet_mujoco():
            self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
            self._batch.set_const(ids)
            self.position[:n] = pose
            self.applied[:n] = 0.0
            self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_VEL.value)
        self._batch.warning[:n], self._failed[:n] = 0, False
        return self._bias[:n].copy()

    def copy(self, candidate: int, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write a candidate into a copy of the arm's model and its data; M is that of its pose."""
        self._batch.get_model(candidate, model)
        self._batch.get_data(candidate, data)
        data.warning.number[:] = 0
        mujoco.mj_fwdPosition(model, data)

    @property
    def healthy(self) -> NDArray[np.bool_]:
        """Candidates that are finite and drew no warning of MuJoCo's since their start, shape (size,)."""
        finite = np.isfinite(self.position).all(axis=1) & np.isfinite(self.velocity).all(axis=1)
        return finite & ~self._failed & ~self._batch.warning[:, :, 1].any(axis=1)

    def roll(self, torque: Array, out: Array) -> NDArray[np.bool_]:
        """Step candidates from their start under the given joint torques.

        Args:
            torque: applied at each step [N·m], shape (n, steps, V), C-contiguous.
            out: receives the angles after each step [rad], shape (n, steps, V).

        Returns:
            Which candidates stayed healthy, shape (n,).
        """
        n, steps, _ = torque.shape
        spec = mujoco.mjtState.mjSTATE_QFRC_APPLIED.value
        with quiet_mujoco():
            try:
                self._batch.rollout(steps, torque, spec, ("qpos",), np.arange(n), {"qpos": out})
            except SimulationError as error:
                self._failed[error.ids] = True
        # a candidate whose warnings rose stopped there; what it recorded after that is no simulation
        return self.healthy[:n] & np.isfinite(out[:, -1]).all(axis=-1)
