"""Whether the residuals are white and owe nothing to the command: what an engineer asks
of any model.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import FitSummary
from hydroid.fitting.validation import Prediction
from hydroid.posterior.stored_errors import stored_error_model
from hydroid.posterior.whiteness import ResidualTest, residual_tests
from hydroid.problem.problem import Problem
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.page import Cell, Plot, Section, Table
from hydroid.settings.fit import FitSettings
from hydroid.words import listed, two_digits

_TEXT = (
    "Tested is what the past of a log does not foretell of each sample: the innovation. If the model is "
    "right, innovations are white and owe nothing to the command, and 95 % of both correlations lie within "
    "the grey band. With many samples the band is narrow: what counts is how large a correlation is."
)
_HEADER = (
    "joint",
    "autocorrelations outside [%]",
    "with the command outside [%]",
    "largest with the command",
)


def residual_section(
    settings: FitSettings, summary: FitSummary, fitted: Sequence[Prediction]
) -> Section | None:
    """Return the section of the residuals' correlations, a tab per joint.

    None: nothing can be tested.
    """
    usable = [one for one in fitted if np.isfinite(one.response).all()]
    if not usable or any(
        f"q{joint}" not in summary.errors for joint in settings.outputs
    ):
        return None
    tests = _tests(settings, summary, usable)
    tabs = list[Plot]()
    rows = list[tuple[Cell, ...]]()
    lasting = list[str]()
    for joint, test in tests.items():
        name = settings.arm.joint_names[joint - 1]
        drawing = partial(_correlations, name, test)
        tabs.append(
            Plot(
                f"residual_{len(tabs) + 1}",
                f"{name}: correlations",
                drawing,
                button=name,
            )
        )
        own, command = (100 * part for part in test.outside)
        largest = float(np.abs(test.with_command).max())
        rows.append((name, two_digits(own), two_digits(command), two_digits(largest)))
        if seconds := summary.errors[f"q{joint}"].lasts_s:
            lasting.append(f"{name} (for {two_digits(seconds)} s)")
    answer = f"an error lasts in {listed(lasting)}" if lasting else "white"
    title = "Are the residuals white?"
    table = Table("", _HEADER, tuple(rows))
    tables = {"residuals": table}
    return Section(
        title, _TEXT, tables=tables, tabs=tuple(tabs), folded=True, answer=answer
    )


def _tests(
    settings: FitSettings, summary: FitSummary, fitted: Sequence[Prediction]
) -> dict[int, ResidualTest]:
    logs = [one.log for one in fitted]
    problem = Problem(settings, logs)
    errors = stored_error_model(problem, summary.errors)
    row = np.zeros((1, len(problem.measured)))
    for channel in problem.channels:
        if channel.quantity == "angle":
            error = fitted[channel.log].error(channel.joint)
            row[0, channel.rows] = channel.weight * error
    return residual_tests(errors, errors.innovations(row)[0], logs)


def _correlations(name: str, test: ResidualTest) -> Chart:
    return Chart(
        (
            _panel(
                f"{name}: autocorrelation",
                "lag [s]",
                test.lags,
                test.autocorrelation,
                test.bound,
            ),
            _panel(
                f"{name}: correlation with the command",
                "lag behind the command [s]",
                test.command_lags,
                test.with_command,
                test.bound,
            ),
        )
    )


def _panel(title: str, x: str, lags: Array, values: Array, bound: float) -> Panel:
    ends = lags[[0, -1]]
    largest = max(1.2 * float(np.abs(values).max()), 2.0 * bound, 0.1)
    marks = (
        Mark(
            "band",
            ends,
            np.full(2, -bound),
            np.full(2, bound),
            color="pale",
            label="95 % by chance",
            alpha=0.6,
        ),
        Mark("rule", y=np.zeros(1), color="grey", width=1),
        Mark("line", lags, values, color="blue", width=1.2),
    )
    return Panel(x, "correlation [-]", marks, title, 200, (-largest, largest))
