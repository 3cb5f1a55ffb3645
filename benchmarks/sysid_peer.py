"""mujoco.sysid on a problem of hydroid: the same arm, log, bounds, start, statement; its own defaults."""

import copy
import io
from collections.abc import Sequence
from contextlib import redirect_stdout

import mujoco
import numpy as np
from mujoco import sysid

from hydroid.arm.model import load_model
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.settings.arm import Arm

CODES = {"K": "gain", "D": "damping", "S": "stiffness", "M": "mass"}


class Peer:
    """The arm as mujoco.sysid's user would set it up.

    Parameters are named by a letter of CODES and the number of the joint or link. Every candidate is a copy
    of one compiled model without shapes: compiling it anew, as its examples do, would cost more time.

    Args:
        arm: the arm's settings.
        problem: hydroid's problem, for names, bounds and what is known.
        log: the record.
        noise: of an angle [rad], to weigh what is known against the angles.
    """

    def __init__(self, arm: Arm, problem: Problem, log: Log, noise: float) -> None:
        self._arm, self._problem, self._pose = arm, problem, log.angle[0]
        self._names = problem.parameters.names
        self.rollouts = 0
        spec = load_model(arm.model, arm)
        for geom in list(spec.geoms):
            spec.delete(geom)
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        spec.option.timestep = log.period
        self._model = spec.compile()
        self._model.qpos_spring[:] = self._pose
        self._model.actuator_biastype[:] = mujoco.mjtBias.mjBIAS_AFFINE
        self._links = [self._model.body(name).id for name in arm.link_names]
        # the state, not a sensor: MuJoCo evaluates a sensor at the beginning of a step
        angles = [(f"{name}_qpos", sysid.SignalType.MjStateQPos) for name in arm.joint_names]
        sequence = sysid.ModelSequences(
            arm.name,
            spec,
            "log",
            sysid.create_initial_state(self._model, self._pose),
            sysid.TimeSeries(log.time, log.command),
            sysid.TimeSeries.from_names(log.time, log.angle, self._model, angles),
            allow_missing_sensors=True,
        )
        self._residual = sysid.build_residual_fn(models_sequences=[sequence], build_model=self._build)
        # sysid divides the error of a joint by the norm of its angle; a statement gets the middle weight
        self._weight = noise / np.exp(np.mean(np.log(np.linalg.norm(log.angle, axis=0) / np.sqrt(2))))

    def fit(self, start: np.ndarray) -> np.ndarray:
        """Run `mujoco.sysid.optimize` from start, shape (P,), and return what it finds."""
        parameters = sysid.ParameterDict()
        bounds = self._problem.parameters
        for name, value, low, high in zip(self._names, start, bounds.lower, bounds.upper, strict=True):
            parameters.add(sysid.Parameter(name, value, low, high))
        with redirect_stdout(io.StringIO()):  # it prints every iteration
            found, _ = sysid.optimize(parameters, self.residual, verbose=False)
        return found.as_vector()

    def residual(self, x: np.ndarray, parameters: sysid.ParameterDict) -> tuple[Sequence[np.ndarray], ...]:
        """Return sysid's residuals and those of what is known; x has shape (P,) or (P, n)."""
        self.rollouts += 1 if x.ndim == 1 else x.shape[1]
        rows, predicted, measured = self._residual(x, parameters)
        scores = self._weight * self._problem.priors.scores(np.atleast_2d(x.T)).T
        return [*rows, scores[:, 0] if x.ndim == 1 else scores], predicted, measured

    def _build(self, parameters: sysid.ParameterDict, _: mujoco.MjSpec) -> mujoco.MjModel:
        model = copy.copy(self._model)
        for name, value in zip(self._names, parameters.as_vector(), strict=True):
            place = int(name[1:]) - 1
            match CODES[name[0]]:
                case "gain":
                    model.actuator_gainprm[place, 0] = value
                case "damping":
                    model.dof_damping[place] = value
                case "stiffness":
                    model.jnt_stiffness[place] = value
                case _:
                    body = self._links[place]
                    model.body_inertia[body] *= value / model.body_mass[body]
                    model.body_mass[body] = value
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        data.qpos[:] = self._pose
        mujoco.mj_forward(model, data)
        model.actuator_biasprm[:, 0] = data.qfrc_bias  # the oil that holds the arm at the start
        return model
