"""Parameters against their bounds: the estimates of one fit, or the spread over several runs."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array, Parameter, ParameterSet
from hydroid.problem.problem import Problem
from hydroid.report.phrases import status_phrase
from hydroid.report.plots.style import (
    GREY,
    MEASURED,
    OTHER_LOOKS,
    REFINED,
    SEARCH,
    estimate_looks,
    figure,
    finite,
    legend_below,
    styled,
    value_axis,
)
from hydroid.report.table import number, plain
from hydroid.report.tables import SeedResult
from hydroid.report.words import estimate_label, runs_flag
from hydroid.uncertainty.flags import Flag

_BAR = 0.36
_ROW = 0.44  # [in]
_TEXT_AT = 1.36


@styled
def estimates(problem: Problem, fit: Fit, truth: Mapping[str, float] | None = None) -> Figure:
    """Each parameter on a bar from its lower to its upper bound; grey where there is something to know."""
    parameters = problem.parameters.parameters
    drawing = figure(1.2 + _ROW * len(parameters))
    axes = drawing.subplots()
    _frame(axes, parameters, "Estimates within their bounds")
    looks = estimate_looks(fit)
    axes.text(_TEXT_AT, -0.7, estimate_label(fit, fit.final), fontsize=9, fontweight="bold", va="center")
    for row, (parameter, status) in enumerate(zip(parameters, fit.uncertainty.status, strict=True)):
        dull = status.flag in (Flag.NO_EFFECT, Flag.FIXED)
        if _bar(axes, row, parameter, dull=dull):
            beside = iter((-0.25, 0.25, -0.25, 0.25))  # compromises often coincide
            for depth, (name, (color, mark)) in enumerate(looks.items()):
                at = _normal(parameter, fit.estimates[name].theta[row])
                lane, size = (
                    (0.0, 8.5) if depth == 0 else (0.0, 6.5) if color == SEARCH else (next(beside), 5.0)
                )
                _mark(axes, at, row + lane, GREY if dull else color, mark, size, depth)
            _true(axes, row, parameter, truth)
        _text(axes, row, f"{number(float(fit.best.theta[row]))} {parameter.unit}", status_phrase(status))
    for name, (color, mark) in looks.items():  # in full colour, though every row may be grey
        axes.plot(
            [], [], mark, color=color, markeredgecolor="white", markersize=8, label=estimate_label(fit, name)
        )
    _name_truth(axes, truth)
    legend_below(drawing, axes, columns=5)
    return drawing


@styled
def runs(
    parameters: ParameterSet,
    results: Mapping[str, Sequence[SeedResult]],
    truth: Mapping[str, float] | None = None,
    ignore: Collection[str] = (),
) -> Figure:
    """Spread over seeds: each parameter within its bounds, and the output error, one dot a run.

    Args:
        parameters: the parameters.
        results: runs by the name of their estimate, such as `search` and `refined`, in that order.
        truth: true values by name.
        ignore: parameters without effect in any run, drawn grey.
    """
    rows = parameters.parameters
    drawing = figure(1.9 + _ROW * len(rows) + 0.25 * len(results))
    upper, lower = drawing.subplots(2, 1, height_ratios=(len(rows), 0.8 + 0.6 * len(results)))
    *_, (final, final_runs) = results.items()
    _frame(upper, rows, f"Spread over {len(final_runs)} runs with different seeds")
    upper.text(_TEXT_AT, -0.7, final, fontsize=9, fontweight="bold", va="center")
    looks = dict(zip(results, ((SEARCH, "o"), (REFINED, "D"), *OTHER_LOOKS), strict=False))
    for row, parameter in enumerate(rows):
        dull = parameter.name in ignore
        bounded = _bar(upper, row, parameter, dull=dull)
        for k, (name, found) in enumerate(results.items()):
            values = np.array([r.theta[row] for r in found])
            if bounded:
                at = _normal(parameter, values)
                color, mark = looks[name]
                _dots(upper, at, row + _lane(k, len(results)), GREY if dull else color, mark)
        if bounded:
            _true(upper, row, parameter, truth)
        _text(upper, row, *_median_and_range(parameter, np.array([r.theta[row] for r in final_runs]), ignore))
    for k, (name, found) in enumerate(results.items()):
        _dots(lower, finite(np.degrees([r.rms for r in found])), float(k), *looks[name])
        upper.plot([], [], looks[name][1], color=looks[name][0], markeredgecolor="white", label=name)
    _error_axis(lower, results)
    _name_truth(upper, truth)
    legend_below(drawing, upper)
    return drawing


def _frame(axes: Axes, parameters: Sequence[Parameter], title: str) -> None:
    """One row a parameter, from the top, with room for text at the right."""
    axes.set_title(title, x=0.0)
    axes.set_xlim(-0.36, 2.15)
    axes.set_ylim(len(parameters) - 0.4, -0.9)
    axes.set_yticks(range(len(parameters)), [p.name for p in parameters])
    axes.tick_params(length=0, axis="both")
    axes.set_xticks([])
    axes.grid(False)
    axes.spines[["left", "bottom"]].set_visible(False)


def _bar(axes: Axes, row: int, parameter: Parameter, *, dull: bool) -> bool:
    """Draw the range of a parameter; False where it has none."""
    if not parameter.lower < parameter.upper:
        return False
    axes.barh(row, 1.0, height=_BAR, color="#F0F0F0" if dull else "#DCE9F3", zorder=1)
    for x, bound, side in ((-0.055, parameter.lower, "right"), (1.055, parameter.upper, "left")):
        axes.text(x, row, plain(float(f"{bound:.4g}")), ha=side, va="center", fontsize=8, color="#555555")
    return True


def _text(axes: Axes, row: int, value: str, below: str) -> None:
    """Write beside a bar."""
    shift = -0.17 if below else 0.0
    axes.text(_TEXT_AT, row + shift, value, va="center", fontsize=9, color=MEASURED)
    axes.text(_TEXT_AT, row + 0.21, below, va="center", fontsize=8, color="#6A6A6A")


def _normal(parameter: Parameter, value: Array | float) -> Array:
    """Position within the bounds; a value beyond one is drawn on it."""
    return np.clip((np.asarray(value) - parameter.lower) / (parameter.upper - parameter.lower), 0.0, 1.0)


def _mark(axes: Axes, at: Array, row: float, color: str, mark: str, size: float, depth: int) -> None:
    axes.plot(
        at,
        row,
        mark,
        color=color,
        markersize=size,
        markeredgecolor="white",
        markeredgewidth=0.8,
        zorder=4 - depth / 10,
    )


def _dots(axes: Axes, at: Array, row: float, color: str, mark: str) -> None:
    """One dot a run, and a line at their median."""
    axes.plot(
        at, np.full(len(at), row), mark, color=color, alpha=0.55, markersize=4.5, markeredgewidth=0, zorder=3
    )
    if np.isfinite(at).any():
        middle = float(np.nanmedian(at))
        axes.plot([middle, middle], [row - 0.16, row + 0.16], color=color, linewidth=2.2, zorder=4)


def _lane(k: int, count: int) -> float:
    """Height of the k-th estimate within a row."""
    return 0.0 if count < 2 else (k / (count - 1) - 0.5) * 0.26


def _median_and_range(parameter: Parameter, values: Array, ignore: Collection[str]) -> tuple[str, str]:
    """Median, and below it what is to be known or else the range."""
    median = f"{number(float(np.median(values)))} {parameter.unit}"
    flag = runs_flag(parameter, values, ignore)
    if flag == Flag.FIXED:
        return median, flag
    return f"median {median}", flag or f"{number(float(values.min()))} to {number(float(values.max()))}"


def _true(axes: Axes, row: int, parameter: Parameter, truth: Mapping[str, float] | None) -> None:
    if truth and parameter.name in truth:
        at = float(_normal(parameter, truth[parameter.name]))
        axes.plot([at, at], [row - 0.3, row + 0.3], color=MEASURED, linewidth=1.6, zorder=2)


def _name_truth(axes: Axes, truth: Mapping[str, float] | None) -> None:
    if truth:
        axes.plot([], [], "|", color=MEASURED, markersize=10, markeredgewidth=1.6, label="true value")


def _error_axis(axes: Axes, results: Mapping[str, Sequence[SeedResult]]) -> None:
    axes.set_yticks(range(len(results)), list(results))
    axes.set_ylim(len(results) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("rms output error [deg]")
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    value_axis(axes.xaxis, np.degrees([r.rms for found in results.values() for r in found]))
