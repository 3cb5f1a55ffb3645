"""Fits made by hand for the report's tests: any shape of problem, no simulation."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hydroid.estimate import CurveEstimate, QuantityEstimate
from hydroid.fitting.fit import Estimate, Fit
from hydroid.fitting.summary import summarise
from hydroid.fitting.validation import Prediction, fitted
from hydroid.fitting.verdict import baselines_of
from hydroid.log import Log
from hydroid.posterior.band import Band
from hydroid.posterior.error_model import make_likelihood
from hydroid.posterior.linear import Linear, estimate_box
from hydroid.posterior.quantities import Quantities
from hydroid.posterior.uncertainty import Uncertainty, uncertainty_from
from hydroid.problem.problem import Problem
from hydroid.run.record import FinishedRun, fit_record
from hydroid.search.descent import Descent, Ending
from hydroid.settings.fit import FitSettings
from hydroid.settings.problem import ParameterSettings

WHAT = {"K": "gain", "D": "damping"}
MODEL = {"K": (0.05, 0.5), "D": (50.0, 500.0), "M1": (1.0, 10.0), "M2": (1.5, 12.75)}


def make_problem(
    sources: tuple[str, ...] = ("a.csv",),
    outputs: tuple[int, ...] = (2,),
    segments: int = 4,
    parameters: dict[str, tuple[float, float]] = MODEL,
    fixed: dict[str, float] | None = None,
    samples: int = 120,
    **objective: Any,
) -> Problem:
    """A problem of noise and waves that no model explains; nothing of it is
    simulated."""
    fixed, own = fixed or {}, dict[str, ParameterSettings]()
    for name, ends in parameters.items():
        what = (
            {"quantity": "mass", "link": f"link{name[1]}"}
            if name[0] == "M"
            else {"quantity": WHAT[name]}
        )
        bounds = ends if ends[0] < ends[1] else None
        own[name] = ParameterSettings(bounds=bounds, fixed=fixed.get(name), **what)
    how = {"segments": segments} | objective
    settings = FitSettings(
        parameters=own, outputs=list(outputs), objective=how, scale="linear"
    )
    rng, logs = np.random.default_rng(3), list[Log]()
    for number, source in enumerate(sources):
        time = np.arange(samples + 10 * number) * 0.01
        command = np.repeat(rng.uniform(-90, 90, (len(time) // 10 + 1, 7)), 10, axis=0)[
            : len(time)
        ]
        angle = (
            np.cumsum(command, axis=0) * 1e-4 + 0.3 + 0.05 * np.sin(20 * time)[:, None]
        )
        logs.append(Log(source, time, command, angle, 0.01))
    return Problem(settings, logs)


def make_fit(
    problem: Problem,
    names: tuple[str, ...] = ("average", "utopia", "best", "refined"),
    diverged: tuple[str, ...] = (),
    effects: tuple[float, ...] | None = None,
    front: int = 6,
) -> Fit:
    """A fit whose estimates are the measured angles with a smooth error, or NaN where
    diverged."""
    rng = np.random.default_rng(0)
    parameters = problem.parameters
    free = int(parameters.free.sum())
    estimates = {}
    for name in names:
        size = np.nan if name in diverged else rng.uniform(0.002, 0.03)
        waves = [
            size
            * np.sin(log.time * rng.uniform(2, 9))[:, None]
            * np.ones(len(problem.outputs))
            for log in problem.logs
        ]
        pairs = zip(problem.logs, waves, strict=True)
        responses = tuple(log.angle[:, problem.outputs] - wave for log, wave in pairs)
        error = np.concatenate([wave.T.ravel() for wave in waves])[None]
        norms = problem.norms(error)[0]
        estimates[name] = Estimate(
            name,
            parameters.from_unit(rng.uniform(0.1, 0.9, (1, free)))[0],
            norms[:-1],
            float(norms[-1]),
            float(np.sqrt(np.mean(error**2))),
            responses,
        )
    final = "refined" if "refined" in names else names[0]
    uncertain = make_uncertainty(problem, estimates[final].theta, effects)
    segments = rng.uniform(0.005, 0.2, (front, len(problem.bounds)))
    evaluations = np.arange(1, 8) * 20.0
    best = np.minimum.accumulate(rng.uniform(0.02, 0.3, 7))
    history = np.column_stack(
        [np.arange(1, 8), evaluations, evaluations - 3, [2.0] * 7, best, best * 1.5]
    )
    ended: dict[str, Any] = {"evaluations": 40, "iterations": 5, "ending": Ending.GAIN}
    refined = Descent(
        np.full(free, 0.5), np.empty(0), 0.1, 1.0, np.empty((0, free)), **ended
    )
    sets = parameters.from_unit(rng.uniform(0, 1, (front, free)))
    return Fit(
        problem,
        estimates,
        final,
        (sets, np.column_stack([segments, segments.max(axis=1, initial=0)])),
        history,
        {"refined": refined} if "refined" in names else {},
        {},
        uncertain,
        make_quantities(problem),
        {"search": 2.0, "refinement": 1.0, "uncertainty": 0.5},
    )


def make_quantities(problem: Problem) -> Quantities:
    """Of each joint a speed that is known, one that is not, and a curve of speed that
    ends without limits."""
    scalars, curves = {}, {}
    for joint in problem.settings.outputs:
        joint_name = problem.settings.arm.joint_names[joint - 1]
        name = f"{joint_name}_speed"
        one = {"joint": joint, "unit": "deg/s"}
        known = QuantityEstimate(
            label="speed at 50 %", value=12.0, sd=0.3, interval=(11.4, 12.6), **one
        )
        lost = QuantityEstimate(
            label="dead band", value=3.0, interval=(0.0, None), joint=joint, unit="%"
        )
        scalars |= {f"{name}_50": known, f"{joint_name}_dead_band": lost}
        curves[name] = CurveEstimate(
            label="speed",
            along="command [%]",
            at=(-100.0, -50.0, 50.0, 100.0),
            value=(-24.0, -12.0, 12.0, 24.0),
            interval=((None, None), (-13.0, -11.0), (11.0, 13.0), (None, None)),
            **one,
        )
    return scalars, curves


def make_record(
    problem: Problem,
    fit: Fit,
    unseen: Mapping[str, Prediction] | None = None,
    folder: str = "RUN",
) -> FinishedRun:
    logs = {log.source: "f" * 64 for log in problem.logs}
    identity = {"hydroid": "0", "mujoco": "4", "logs": logs}
    predictions, baselines = fitted(fit), baselines_of(problem.settings, problem.logs)
    result = fit_record(fit, predictions, baselines)
    return FinishedRun(
        folder,
        identity,
        problem.settings,
        summarise(problem, fit),
        result,
        unseen or {},
    )


def make_prediction(
    log: Log,
    joints: tuple[int, ...] = (2,),
    fit: str = "hyd",
    error: float = 0.01,
    band: bool = True,
) -> Prediction:
    """An unseen log that is predicted with a constant error [rad], as the fit leads to
    expect."""
    response = log.angle[:, [joint - 1 for joint in joints]] - error
    bands = {
        j: Band(0.01, np.full(len(log.time), 0.02), 1.0, error, 0.01)
        for j in joints
        if band
    }
    return Prediction(fit, log, joints, response, bands, unseen=True)


def make_uncertainty(
    problem: Problem, theta: np.ndarray, effects: tuple[float, ...] | None = None
) -> Uncertainty:
    """What a problem with independent parameters of these effects [rad] would say, its
    noise 0.1 deg."""
    rng = np.random.default_rng(1)
    size = np.array(effects) if effects else np.linspace(1e-3, 2e-3, len(theta))
    waves = np.linalg.qr(rng.normal(size=(len(problem.measured), len(theta))))[0].T
    slopes = 100 * size[:, None] * waves * np.sqrt(len(problem.measured))
    free = problem.parameters.free
    errors = rng.normal(0, np.deg2rad(0.1), len(problem.measured))
    likelihood = make_likelihood(problem).estimated(errors)
    at = Linear(
        estimate_box(problem.parameters, theta),
        likelihood.errors.innovations(errors[None])[0],
        likelihood.errors.innovations(np.nan_to_num(slopes[free])),
        np.zeros((free.sum(), 0)),
        diverging=np.isnan(slopes[free]).any(axis=1),
    )
    return uncertainty_from(likelihood, at)
