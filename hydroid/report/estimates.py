"""Parameters within their bounds: the estimates of one fit, or the spread over several runs."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hydroid.fitting.fit import Fit
from hydroid.parameters import Array, Parameter, ParameterSet
from hydroid.posterior.flags import Flag
from hydroid.problem.problem import Problem
from hydroid.report import style
from hydroid.report.phrases import estimate_label, runs_phrase, status_phrase
from hydroid.words import number, plain

_BAR = 0.36
_ROW = 0.44  # [in]
_TEXT_AT = 1.36
_LIGHT = "#6A6A6A"


def estimates(problem: Problem, fit: Fit) -> Figure:
    """Draw each parameter on a bar from its lower to its upper bound, grey where fixed or without effect."""
    parameters = problem.parameters.parameters
    drawing, axes = _frame(1.2 + _ROW * len(parameters), parameters)
    axes.set_title(f"Estimates within their bounds (values: {estimate_label(fit, fit.final)})", x=0.0)
    looks = style.estimate_looks(fit)
    for row, (parameter, status) in enumerate(zip(parameters, fit.uncertainty.status, strict=True)):
        grey = status.flag in (Flag.NO_EFFECT, Flag.FIXED)
        if _bar(axes, row, parameter, grey=grey):
            beside = iter((-0.25, 0.25, -0.25, 0.25))  # the search's estimates often coincide
            for depth, (name, (color, mark)) in enumerate(looks.items()):
                main = depth == 0 or color == style.SEARCH
                lane, size = (0.0, 6.5 if depth else 8.5) if main else (next(beside), 5.0)
                at = _normal(parameter, fit.estimates[name].theta[row])
                look: dict[str, Any] = {
                    "color": style.GREY if grey else color,
                    "markersize": size,
                    "zorder": 4 - depth / 10,
                }
                axes.plot(at, row + lane, mark, markeredgecolor="white", markeredgewidth=0.8, **look)
        _text(axes, row, f"{number(float(fit.best.theta[row]))} {parameter.unit}", status_phrase(status))
    for name, (color, mark) in looks.items():  # in full colour, though every row may be grey
        label = estimate_label(fit, name)
        axes.plot([], [], mark, color=color, markeredgecolor="white", markersize=8, label=label)
    style.legend_below(drawing, axes, columns=5, axis=0.1)
    return drawing


def spread(
    parameters: ParameterSet,
    results: Mapping[str, tuple[Array, Array]],
    without_effect: Collection[str] = (),
) -> Figure:
    """Draw the spread over several runs: parameters within their bounds and output error, a dot per run.

    `results` has, by the estimate's name, theta of N runs, shape (N, P), and their rms output errors [rad],
    shape (N,). Parameters without effect in any run are grey.
    """
    rows = parameters.parameters
    lanes = len(results)
    height = 1.9 + _ROW * len(rows) + 0.25 * lanes
    drawing, upper = _frame(height, rows, below=0.8 + 0.6 * lanes, names=list(results))
    *_, (final, _) = results.values()
    upper.set_title(f"Spread over {len(final)} runs with different seeds", x=0.0)
    looks = dict(zip(results, ((style.SEARCH, "o"), (style.REFINED, "D"), *style.OTHER_LOOKS), strict=False))
    for row, parameter in enumerate(rows):
        grey = parameter.name in without_effect
        if _bar(upper, row, parameter, grey=grey):
            for k, (name, (theta, _)) in enumerate(results.items()):
                lane = 0.0 if lanes < 2 else (k / (lanes - 1) - 0.5) * 0.26
                color, mark = looks[name]
                at = _normal(parameter, theta[:, row])
                _dots(upper, at, row + lane, style.GREY if grey else color, mark)
        values = final[:, row]
        median = f"median {number(float(np.median(values)))} {parameter.unit}"
        between = f"{number(float(values.min()))} to {number(float(values.max()))}"
        _text(upper, row, median, runs_phrase(parameter, values, without_effect) or between)
    lower = drawing.axes[1]
    for k, (name, (_, rms)) in enumerate(results.items()):
        _dots(lower, style.finite(np.degrees(rms)), float(k), *looks[name])
        upper.plot([], [], looks[name][1], color=looks[name][0], markeredgecolor="white", label=name)
    lower.set_yticks(range(lanes), list(results))
    lower.set_ylim(lanes - 0.5, -0.5)
    lower.grid(axis="y", visible=False)
    lower.set_xlabel("rms output error [deg]")
    lower.spines["left"].set_visible(False)
    lower.tick_params(axis="y", length=0)
    style.value_axis(lower.xaxis, np.degrees(np.concatenate([rms for _, rms in results.values()])))
    style.legend_below(drawing, upper)
    return drawing


def _frame(
    height: float, parameters: Sequence[Parameter], below: float = 0.0, names: Sequence[str] = ()
) -> tuple[Figure, Axes]:
    """Return a figure with one row per parameter, and a second panel of `below` rows for `names` if any."""
    labels = [p.name for p in parameters]
    drawing = style.figure(height, left=style.room_for([*labels, *names]), right=0.1)
    ratios = (len(parameters) + 0.5, below) if below else (1,)
    panels = drawing.subplots(
        len(ratios), 1, squeeze=False, gridspec_kw={"height_ratios": ratios, "hspace": 0.12}
    )
    axes: Axes = panels[0, 0]
    axes.set_xlim(-0.36, 2.15)
    axes.set_ylim(len(parameters) - 0.4, -0.7)
    axes.set_yticks(range(len(parameters)), labels)
    axes.tick_params(length=0, axis="both")
    axes.set_xticks([])
    axes.grid(False)
    axes.spines[["left", "bottom"]].set_visible(False)
    return drawing, axes


def _bar(axes: Axes, row: int, parameter: Parameter, *, grey: bool) -> bool:
    """Draw the range of a parameter; return False where it has none."""
    if not parameter.lower < parameter.upper:
        return False
    axes.barh(row, 1.0, height=_BAR, color="#F0F0F0" if grey else "#DCE9F3", zorder=1)
    for x, bound, side in ((-0.055, parameter.lower, "right"), (1.055, parameter.upper, "left")):
        axes.text(x, row, plain(float(f"{bound:.4g}")), ha=side, va="center", fontsize=8, color="#555555")
    return True


def _text(axes: Axes, row: int, value: str, below: str) -> None:
    """Write a value and a remark beside a bar."""
    where: dict[str, Any] = {"va": "center"}
    axes.text(_TEXT_AT, row - (0.17 if below else 0.0), value, fontsize=9, color=style.MEASURED, **where)
    if below:
        axes.text(_TEXT_AT, row + 0.21, below, fontsize=8, color=_LIGHT, **where)


def _normal(parameter: Parameter, value: Array | float) -> Array:
    """Return the position within the bounds; a value beyond one is drawn on it."""
    return np.clip(parameter.position(value), 0.0, 1.0)


def _dots(axes: Axes, at: Array, row: float, color: str, mark: str) -> None:
    """Draw one dot per run, and a line at their median."""
    look: dict[str, Any] = {"alpha": 0.55, "markersize": 4.5, "markeredgewidth": 0, "zorder": 3}
    axes.plot(at, np.full(len(at), row), mark, color=color, **look)
    if np.isfinite(at).any():
        middle = float(np.nanmedian(at))
        axes.plot([middle, middle], [row - 0.16, row + 0.16], color=color, linewidth=2.2, zorder=4)
