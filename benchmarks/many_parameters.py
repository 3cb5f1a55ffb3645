"""27 parameters (K, D, S of each joint, six masses) from one noisy log of all joints, from far-off starts.

    python benchmarks/many_parameters.py [--starts 10] [--peer-starts 3]

The log: 60 s simulated at the article's true parameters, every joint driven by pseudo-random commands that
keep it off its stops, 0.1 deg of white noise on every angle but the first sample, which is known. The total
mass is known to 0.5 kg. Each start is a factor of 0.1 to 10 off each true value, uniform in the logarithm;
these are the bounds too.

hydroid's row is a complete fit of one start: search, refinement, intervals. mujoco.sysid gets the same arm,
log, bounds, start and prior, and its own defaults: pip install 'mujoco[sysid]'.
"""

import argparse
import copy
import io
from collections.abc import Sequence
from contextlib import redirect_stdout
from typing import Any

import mujoco
import numpy as np
from common import Clock, row, table, true_log

import hydroid
from hydroid.arm.model import load_model
from hydroid.fitting.fit import Fit, fit
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

JOINTS = range(1, 8)
MASSES = {"M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
SHARED = {"K": 0.2, "D": 231.8, "S": 53.4}
TRUTH = {f"{name}{j}": value for name, value in SHARED.items() for j in JOINTS} | MASSES
QUANTITIES = {"K": "gain", "D": "damping", "S": "stiffness"}
FACTOR = 10.0
NOISE = np.deg2rad(0.1)
REACHED = 0.01
"""of the lowest cost: what is no further above it has reached the optimum"""


def make_settings(seed: int) -> FitSettings:
    """Settings of one start."""
    parameters: dict[str, Any] = {}
    for name, value in TRUTH.items():
        what = {"quantity": "mass", "link": f"link{name[1:]}"}
        if name not in MASSES:
            what = {"quantity": QUANTITIES[name[0]], "joints": [int(name[1:])]}
        parameters[name] = what | {"bounds": [value / FACTOR, value * FACTOR]}
    changes = {
        "outputs": list(JOINTS),
        "parameters": parameters,
        "priors": {"total mass": {"of": list(MASSES), "value": sum(MASSES.values()), "sd": 0.5}},
        "objective": {"norm": 2, "segments": {"equal": 1}},
        "search": {"algorithm": "multistart", "seed": seed, "multistart": {"starts": 1}},
    }
    return hydroid.load_settings("article-mech", changes)


def cost_of(problem: Problem, theta: np.ndarray) -> tuple[float, float]:
    """Return the cost with the true noise, and the rms error [deg]."""
    rows = problem.residuals(theta[None])
    scores = problem.priors.scores(theta[None])[0]
    cost = float(np.sum((rows / NOISE) ** 2) + np.sum(scores**2))
    return cost, float(np.rad2deg(problem.rms(rows)[0]))


class Peer:
    """The arm as mujoco.sysid's user would set it up.

    Every candidate is a copy of one compiled model without shapes: compiling it anew, as its examples do,
    would cost more time.
    """

    def __init__(self, problem: Problem, log: Log) -> None:
        from mujoco import sysid

        arm, self._problem, self._pose = problem.settings.arm, problem, log.angle[0]
        self.rollouts = 0
        spec = load_model(arm)
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
        # sysid divides the error of a joint by the norm of its angle; the prior gets the middle weight
        self._weight = NOISE / np.exp(np.mean(np.log(np.linalg.norm(log.angle, axis=0) / np.sqrt(2))))

    def fit(self, start: np.ndarray) -> np.ndarray:
        """Run `mujoco.sysid.optimize` from start, shape (P,), and return what it finds."""
        from mujoco import sysid

        parameters, known = sysid.ParameterDict(), self._problem.parameters
        for name, value, low, high in zip(known.names, start, known.lower, known.upper, strict=True):
            parameters.add(sysid.Parameter(name, value, low, high))
        with redirect_stdout(io.StringIO()):  # it prints every iteration
            found, _ = sysid.optimize(parameters, self.residual, verbose=False)
        return found.as_vector()

    def residual(self, x: np.ndarray, parameters: Any) -> tuple[Sequence[np.ndarray], ...]:
        """Return sysid's residuals and those of the prior; x has shape (P,) or (P, n)."""
        self.rollouts += 1 if x.ndim == 1 else x.shape[1]
        rows, predicted, measured = self._residual(x, parameters)
        scores = self._weight * self._problem.priors.scores(np.atleast_2d(x.T)).T
        return [*rows, scores[:, 0] if x.ndim == 1 else scores], predicted, measured

    def _build(self, parameters: Any, _: mujoco.MjSpec) -> mujoco.MjModel:
        model = copy.copy(self._model)
        for name, value in zip(self._problem.parameters.names, parameters.as_vector(), strict=True):
            place = int(name[1:]) - 1
            match name[0]:
                case "K":
                    model.actuator_gainprm[place, 0] = value
                case "D":
                    model.dof_damping[place] = value
                case "S":
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


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--peer-starts", type=int, default=3)
    parser.add_argument("--duration", type=float, default=60.0)
    given = parser.parse_args()
    log = true_log(make_settings(1), TRUTH, list(JOINTS), given.duration, seed=0)
    log.angle[1:] += np.random.default_rng(1).normal(0.0, NOISE, log.angle[1:].shape)
    problem = Problem(make_settings(1), [log])
    truth = problem.parameters.vector(TRUTH, "truth")
    print(f"rms error at the true parameters: {cost_of(problem, truth)[1]:.5g} deg")
    table(("program", "start", "rms [deg]", "simulations", "time"))
    costs: dict[str, list[float]] = {"hydroid": [], "mujoco.sysid": []}
    best: Fit | None = None
    for seed in range(1, given.starts + 1):
        clock = Clock()
        result = fit(Problem(make_settings(seed), [log]))
        assert result.refinement is not None
        cost, rms = cost_of(problem, result.best.theta)
        simulated = int(result.history[-1, 2]) + result.refinement.evaluations
        row(("hydroid", seed, f"{rms:.5g}", simulated, clock))
        best = result if cost < min(costs["hydroid"], default=np.inf) else best
        costs["hydroid"].append(cost)
    for seed in range(1, given.peer_starts + 1):
        peer, clock = Peer(problem, log), Clock()
        start = problem.theta(np.random.default_rng([seed, 0]).random((1, len(TRUTH))))[0]
        try:
            cost, rms = cost_of(problem, peer.fit(start))
        except Exception as error:  # what its user would see
            cost, rms = np.inf, f"{type(error).__name__}: {error}"
        row(("mujoco.sysid", seed, rms if isinstance(rms, str) else f"{rms:.5g}", peer.rollouts, clock))
        costs["mujoco.sysid"].append(cost)
    lowest = min(min(each, default=np.inf) for each in costs.values())
    for who, each in costs.items():
        reached = sum(cost <= (1 + REACHED) * lowest for cost in each)
        print(
            f"{who}: {reached} of {len(each)} reached the optimum (cost within {REACHED:.0%} of the lowest)"
        )
    if best is not None:
        known = best.uncertainty
        inside = (known.interval[:, 0] <= truth) & (truth <= known.interval[:, 1])
        stated = np.isfinite(known.interval).all(axis=1)
        print(f"{int(inside[stated].sum())} of {int(stated.sum())} 95 % intervals hold the truth")


if __name__ == "__main__":
    main()
