"""A fit's result as `estimate.yaml` and `--json` hold it."""

import numpy as np

from hydroid.estimate import FitSummary, NamedEstimate, ParameterEstimate, finite
from hydroid.fitting.findings import fit_findings, parameter_findings
from hydroid.fitting.fit import Fit
from hydroid.parameters import Array
from hydroid.posterior.by_log import by_log
from hydroid.posterior.uncertainty import Identifiability, Uncertainty
from hydroid.problem.problem import Problem


def summarise(problem: Problem, fit: Fit) -> FitSummary:
    """Return the final estimate with its uncertainty, and the estimates it was chosen from."""
    last = problem.varied(problem.settings.of_estimate(fit.final))
    objective = 1.0 if problem.settings.objective.relative else 180 / np.pi
    known = account(last, fit.uncertainty, fit.identifiability)
    estimates = {
        e.name: NamedEstimate(
            values=problem.settings.of_estimate(e.name).parameter_set().mapping(e.theta),
            rms_deg=finite(np.degrees(e.rms)),
            objective=finite(objective * e.overall),
        )
        for e in fit.estimates.values()
    }
    own = {
        "joints": problem.active_joints,
        "final": fit.final,
        "converged": None if fit.refinement is None else fit.refinement.converged,
        "ending": None if fit.refinement is None else fit.refinement.ending.value,
        "rms_deg": finite(np.degrees(fit.best.rms)),
        "seed": problem.settings.search.seed,
        "simulations": int(fit.history[-1, 2]),
        "diverged": int(fit.history[-1, 3]),
        "findings": (*fit_findings(fit), *known.findings),
        "estimates": estimates,
        "quantities": fit.quantities.scalars,
        "curves": fit.quantities.curves,
    }
    return known.model_copy(update=own)


def account(problem: Problem, known: Uncertainty, directions: Identifiability | None = None) -> FitSummary:
    """Return an estimate with what its logs say about it, whatever led to it."""
    logs, scale, count = by_log(problem, known), known.linear.box.scale, len(known.theta)
    relative = np.full(count, np.nan) if logs is None else logs.relative
    by_logs = np.full((count, 2), np.nan) if logs is None else logs.interval
    estimate = {
        parameter.name: ParameterEstimate(
            value=float(known.theta[i]),
            unit=parameter.unit,
            sd=finite(known.standard_deviation[i]),
            sd_by_log=finite(relative[i] * scale[i]),
            interval=_ends(known.interval[i]),
            interval_by_log=_ends(by_logs[i]),
            flag=status.flag.value,
            source=status.source and status.source.value,
            data_share=status.share if known.free[i] else None,
            at_bound=status.at_bound,
            effect_deg=finite(np.degrees(known.sensitivity[i])),
        )
        for i, (parameter, status) in enumerate(zip(problem.parameters.parameters, known.status, strict=True))
    }
    squares: dict[str, list[float]] = {}
    for channel, noise in zip(problem.channels, known.noise, strict=True):
        if channel.quantity == "angle":
            squares.setdefault(f"q{channel.joint}", []).append((noise.level / channel.weight) ** 2)
    return FitSummary(
        stage=problem.settings.stage,
        estimate=estimate,
        findings=parameter_findings(problem, known, logs, directions),
        covariance=known.posterior.stored(problem.parameters),
        noise_deg={angle: float(np.degrees(np.sqrt(np.mean(each)))) for angle, each in squares.items()},
        left_out_deg={
            f"q{joint}": tuple(np.degrees(errors).tolist())
            for joint, errors in ({} if logs is None else logs.left_out).items()
        },
    )


def _ends(interval: Array) -> tuple[float | None, float | None]:
    low, high = interval.tolist()
    return finite(low), finite(high)
