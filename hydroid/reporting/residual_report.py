"""Whether the residuals are white and owe nothing to the command: what an engineer asks
of any model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hydroid.arrays import Array
from hydroid.estimate import FitSummary
from hydroid.fitting.validation import Prediction
from hydroid.posterior.stored_errors import stored_error_model
from hydroid.posterior.whiteness import FAINT, ResidualTest, residual_tests
from hydroid.problem.problem import Problem
from hydroid.reporting.chart import Chart, Mark, Panel, zero_line
from hydroid.reporting.page import Cell, Plot, Section, Table
from hydroid.settings.fit import FitSettings
from hydroid.words import two_digits

NOTABLE = 0.5
"""for how long a new error lasts that a heading states [s]"""
_TEXT = (
    "The 95 % confidence intervals hold only if the model is right. This test can show that it is "
    "not. It takes the innovations: the part of each sample that earlier samples do not predict. "
    "If the model is right, they are correlated neither with themselves nor with the command, and "
    "95 % of the correlations lie in the grey band. With many samples the band is narrow: a "
    f"correlation of {FAINT:g} or less does not matter. Table: the largest correlations, and the "
    "share of them outside the band."
)
_HEADER = (
    "joint",
    "autocorrelation up to",
    "with the command up to",
    "autocorrelation outside [%]",
    "with the command outside [%]",
)


def residual_section(
    settings: FitSettings, summary: FitSummary, fitted: Sequence[Prediction]
) -> Section | None:
    """Return the section of the residuals' correlations, a tab per joint.

    None: nothing can be tested.
    """
    usable = [p for p in fitted if np.isfinite(p.response).all()]
    has_errors = all(f"q{joint}" in summary.errors for joint in settings.outputs)
    if not usable or not has_errors:
        return None
    tests = _tests(settings, summary, usable)
    tabs = list[Plot]()
    rows = list[tuple[Cell, ...]]()
    by_itself = dict[str, float]()
    by_command = dict[str, float]()
    for joint, test in tests.items():
        name = settings.arm.name_of(joint)
        draw = partial(_correlations, name, test)
        caption = f"{name}: correlations"
        tabs.append(Plot(f"residual_{len(tabs) + 1}", caption, draw, button=name))
        in_time = float(np.abs(test.autocorrelation).max())
        with_command = float(np.abs(test.with_command).max())
        shares = [100 * part for part in test.outside]
        rows.append((name, *map(two_digits, (in_time, with_command, *shares))))
        by_itself[name] = in_time
        by_command[name] = with_command
    return Section(
        "Confidence intervals: are the residuals white?",
        _TEXT,
        tables={"residuals": Table("", _HEADER, tuple(rows))},
        tabs=tuple(tabs),
        folded=True,
        answer=_answer(by_itself, by_command, _lasting(settings, summary)),
    )


def _answer(
    by_itself: Mapping[str, float], by_command: Mapping[str, float], lasting: str
) -> str:
    """Say whether all correlations are below FAINT, and if not, how long the error lasts,
    or how large the largest ones are."""
    said = list[str]()
    for what, sizes in (
        ("autocorrelation", by_itself),
        ("with the command", by_command),
    ):
        joint = max(sizes, key=sizes.__getitem__)
        if sizes[joint] > FAINT:
            said.append(f"{what} up to {two_digits(sizes[joint])} ({joint})")
    if said:
        return f"no, so intervals may be too narrow; {lasting or ', '.join(said)}"
    return f"yes, on the fitted logs: no correlation is above {FAINT:g}"


def _lasting(settings: FitSettings, summary: FitSummary) -> str:
    """Say of the joint whose error lasts longest how long what is left of it does; nothing
    where that is over within NOTABLE: a reader would take the drift for quick noise."""
    times = {joint: summary.errors[f"q{joint}"].lasts_s for joint in settings.outputs}
    joint = max(times, key=times.__getitem__)
    if times[joint] < NOTABLE:
        return ""
    name = settings.arm.name_of(joint)
    return f"what is left of the {name}'s error lasts {two_digits(times[joint])} s"


def _tests(
    settings: FitSettings, summary: FitSummary, fitted: Sequence[Prediction]
) -> dict[int, ResidualTest]:
    logs = [prediction.log for prediction in fitted]
    problem = Problem(settings, logs)
    errors = stored_error_model(problem, summary.errors)
    row = np.zeros((1, len(problem.measured)))
    for channel in problem.channels:
        if channel.quantity == "angle":
            error = fitted[channel.log].error(channel.joint)
            row[0, channel.rows] = channel.weight * error
    return residual_tests(errors, errors.innovations(row)[0], logs)


def _correlations(name: str, test: ResidualTest) -> Chart:
    itself = _panel(test.lags, test.autocorrelation, test.bound)
    command = _panel(test.command_lags, test.with_command, test.bound)
    return Chart(
        (
            replace(itself, x="lag [s]", title=f"{name}: autocorrelation"),
            replace(
                command,
                x="lag behind the command [s]",
                title=f"{name}: correlation with the command",
            ),
        )
    )


def _panel(lags: Array, values: Array, bound: float) -> Panel:
    """Draw correlations over lags [s], and what chance makes of them."""
    ends = lags[[0, -1]]
    low = np.full(2, -bound)
    label = "95 % by chance"
    marks = (
        Mark("band", ends, low, -low, color="pale", label=label, alpha=0.6),
        zero_line(),
        Mark("line", lags, values, color="blue", width=1.2),
    )
    largest = max(1.2 * float(np.abs(values).max()), 2.0 * bound, 0.1)
    limits = (-largest, largest)
    return Panel("", "correlation [-]", marks, height=200, y_limits=limits)
