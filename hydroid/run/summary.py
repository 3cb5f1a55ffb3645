"""A fit's result as `estimate.yaml` and `--json` hold it."""

import numpy as np

from hydroid.estimate import FitSummary, NamedEstimate, ParameterEstimate, finite
from hydroid.fitting.fit import Fit
from hydroid.posterior.by_log import by_log
from hydroid.posterior.covariance import Uncertainty
from hydroid.posterior.left_out import left_out_errors
from hydroid.problem.problem import Problem


def summarise(problem: Problem, fit: Fit) -> FitSummary:
    """Return the final estimate with its uncertainty, and the estimates it was chosen from."""
    objective = 1.0 if problem.settings.objective.relative else 180 / np.pi
    ending = None if fit.refinement is None else fit.refinement.ending
    return FitSummary(
        stage=problem.settings.stage,
        estimate=parameter_estimates(problem, fit.uncertainty),
        joints=problem.active_joints,
        final=fit.final,
        converged=None if ending is None else fit.converged,
        ending=None if ending is None else ending.value,
        rms_deg=finite(np.degrees(fit.best.rms)),
        seed=problem.settings.search.seed,
        simulations=int(fit.history[-1, 2]),
        diverged=int(fit.history[-1, 3]),
        strained_priors={strain.prior: strain.score for strain in fit.strains},
        estimates={
            e.name: NamedEstimate(
                values=problem.parameters.mapping(e.theta),
                rms_deg=finite(np.degrees(e.rms)),
                objective=finite(objective * e.overall),
            )
            for e in fit.estimates.values()
        },
        quantities=fit.quantities.scalars,
        curves=fit.quantities.curves,
        covariance=fit.quantities.precision.covariance(),
        noise_deg=noise_levels(problem, fit.uncertainty),
        left_out_deg=left_out_levels(problem, fit.uncertainty),
    )


def noise_levels(problem: Problem, uncertainty: Uncertainty) -> dict[str, float]:
    """Standard deviation of each angle's noise over all logs [deg]."""
    squares: dict[str, list[float]] = {}
    for channel, noise in zip(problem.channels, uncertainty.noise, strict=True):
        if channel.quantity == "angle":
            squares.setdefault(f"q{channel.joint}", []).append((noise.level / channel.weight) ** 2)
    return {angle: float(np.degrees(np.sqrt(np.mean(each)))) for angle, each in squares.items()}


def left_out_levels(problem: Problem, uncertainty: Uncertainty) -> dict[str, tuple[float, ...]]:
    """Rms error of each angle on each log if it is left out [deg]; empty for one log."""
    errors = left_out_errors(problem, uncertainty)
    return {f"q{joint}": tuple(np.degrees(each).tolist()) for joint, each in errors.items()}


def parameter_estimates(problem: Problem, uncertainty: Uncertainty) -> dict[str, ParameterEstimate]:
    """Return each parameter with its uncertainty, by name."""
    logs = by_log(problem, uncertainty)
    by_logs = np.full(len(uncertainty.theta), np.nan) if logs is None else logs.relative
    return {
        parameter.name: ParameterEstimate(
            value=float(uncertainty.theta[i]),
            unit=parameter.unit,
            sd=finite(uncertainty.standard_deviation[i]),
            sd_by_log=finite(by_logs[i] * uncertainty.jacobian.scale[i]),
            interval=(finite(uncertainty.interval[i, 0]), finite(uncertainty.interval[i, 1])),
            flag=status.flag.value,
            source=None if status.source is None else status.source.value,
            data_share=status.share if uncertainty.free[i] else None,
            at_bound=status.at_bound,
        )
        for i, (parameter, status) in enumerate(
            zip(problem.parameters.parameters, uncertainty.status, strict=True)
        )
    }
