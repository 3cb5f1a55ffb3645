"""What a fit of several logs says about each parameter by log, beside the pooled standard deviation."""

from hydroid.posterior.by_log import FEW, ByLog
from hydroid.posterior.covariance import Uncertainty
from hydroid.problem.problem import Problem
from hydroid.report.table import Cell, Table, unless_nan


def by_log_table(problem: Problem, uncertainty: Uncertainty, found: ByLog) -> Table:
    """Return every free parameter with its pooled standard deviation and that by log."""
    rows: list[tuple[Cell, ...]] = []
    for i, parameter in enumerate(problem.parameters.parameters):
        if uncertainty.free[i]:
            deviations = uncertainty.standard_deviation[i], found.relative[i] * uncertainty.jacobian.scale[i]
            rough = found.freedom[i] < FEW
            words = (
                "differs from log to log" if parameter.name in found.differing else "",
                "rough: too few logs" if rough else "",
            )
            judged = (*deviations, *found.interval[i], found.freedom[i])
            flag = ", ".join(word for word in words if word)
            rows.append((parameter.name, parameter.unit, *(unless_nan(v) for v in judged), flag))
    note = (
        "pooled: as in the table of parameters, from the noise that the residuals show. by log: from the "
        "changes of the estimate when one log is left out, which hold errors of the model too. from, to: the "
        "95 % interval by log. degrees of freedom: of the standard deviation by log, at most the number of "
        f"logs less one. Below {FEW:g} it is rough, and its interval wide. A dash (–): one log alone "
        "determines the parameter, or it has no interval."
    )
    header = ("name", "unit", "pooled", "by log", "from", "to", "degrees of freedom", "flag")
    return Table("Standard deviation by log", header, tuple(rows), note, ("degrees of freedom",))
