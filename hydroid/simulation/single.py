"""One arm in MuJoCo, which candidates take in turn."""

from copy import copy

import mujoco
import numpy as np

from hydroid.simulation.candidates import Array


class SingleArm:
    """MuJoCo's model and data of one arm.

    Args:
        model: of the arm; it is copied.

    Attributes:
        model: the copy, with the values of the candidate that was started last.
        data: its state.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.data = copy(model), mujoco.MjData(model)
        self._armature = model.dof_armature.copy()

    def start(self, values: dict[str, Array], row: int, pose: Array) -> Array:
        """Put one candidate into `pose` at rest, as `ArmBatch.start` does, and return what holds it there.

        Call it within `quiet_mujoco`.

        Args:
            values: what candidates change in the model, as `Scenario.values` returns it.
            row: the candidate.
            pose: angles of the moving joints [rad], shape (V,).

        Returns:
            tau0 = g(q0) of equation (1) [N·m], shape (V,).
        """
        model, data = self.model, self.data
        for name, value in values.items():
            getattr(model, name)[:] = value[row]
        model.dof_armature[:] = self._armature  # stage 2 steps with another
        mujoco.mj_setConst(model, data)
        mujoco.mj_resetData(model, data)
        data.qpos[:] = pose
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        data.warning.number[:] = 0
        return data.qfrc_bias.copy()

    @property
    def healthy(self) -> bool:
        """Whether the arm is finite and drew no warning of MuJoCo's since its start."""
        finite = np.isfinite([self.data.qpos, self.data.qvel]).all()
        return bool(finite) and not self.data.warning.number.any()
