"""What logs determine at some parameters: intervals, directions, noise; a page and a section of a fit's."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator
from numpy.typing import NDArray

from hydroid.parameters import Array
from hydroid.problem.problem import Problem
from hydroid.report import style
from hydroid.report.by_log_report import by_log_table, by_log_warning
from hydroid.report.page import Page, Plot, Section, log_names
from hydroid.report.phrases import direction_phrases, profile_warnings, rank_phrase, status_phrase
from hydroid.report.table import Cell, Table, unless_nan
from hydroid.uncertainty.by_log import by_log
from hydroid.uncertainty.covariance import Uncertainty
from hydroid.uncertainty.directions import Identifiability
from hydroid.uncertainty.flags import WEAK_ABOVE
from hydroid.uncertainty.intervals import THRESHOLD, Profile

_SHOWN = 0.1
"""parts of a direction below this are left out of its row"""
_FEW_REFITS = 40
"""refits below which a 2.5 % quantile lies between the two lowest"""
_CELL = 0.36  # [in]
_MOST_NUMBERS = 14
"""parameters up to which the cells of a map carry their numbers"""
_LEAST_DRAWN = 1e-6
"""singular values below this part of the largest are drawn at the foot"""
_PROFILE_MARGIN = 0.3
"""part of a profile's interval that is drawn beyond each end"""
_CAPTIONS = {
    "singular_values": "The inverse of the relative standard deviation of each direction, with the noise "
    "taken from the residuals. Below the dashed line the standard deviation is above "
    f"{100 * WEAK_ABOVE:.0f} %. A hollow mark at the bottom of the figure: a change along this direction "
    "does not change the simulated response.",
    "correlation": "Near ±1 only a combination of the two parameters is known. Parameters that are not "
    "identifiable are left out.",
    "profiles": "The error, in units of the noise, with one parameter held and the others fitted again. "
    "The interval is where it stays below the threshold; dashed: the linear approximation.",
}


@dataclass(frozen=True, eq=False)
class UncertaintyStudy:
    """What logs determine at some parameters.

    Attributes:
        problem: the logs and the model.
        source: where the parameters are from, in words.
        uncertainty: intervals there.
        identifiability: directions there.
        profiles: profile likelihoods, as far as they were asked for.
        refits: estimates of the bootstrap, shape (N, P); None where it was not asked for.
        moved: says that a better optimum was found, and that all this is about it; empty: it was not.
    """

    problem: Problem
    source: str
    uncertainty: Uncertainty
    identifiability: Identifiability
    profiles: tuple[Profile, ...] = ()
    refits: Array | None = None
    moved: str = ""


def uncertainty_page(study: UncertaintyStudy) -> Page:
    """Return the page of a study; its tables are `intervals`, `directions` and `noise`."""
    drawn = Plot("profiles", _CAPTIONS["profiles"], partial(draw_profiles, study))
    plots = (drawn,) if study.profiles else ()
    intervals = Section("Intervals", tables={"intervals": interval_table(study)}, plots=plots)
    determined = determined_section(study.problem, study.uncertainty, study.identifiability)
    lead = rank_phrase(study.identifiability)
    warnings = (
        *((study.moved,) if study.moved else ()),
        *profile_warnings(study.profiles),
        *by_log_warning(by_log(study.problem, study.uncertainty)),
    )
    return Page("identifiability", "What the logs determine", lead, (intervals, determined), warnings)


def determined_section(problem: Problem, uncertainty: Uncertainty, result: Identifiability) -> Section:
    """Return the section about directions and noise."""
    values = Plot("singular_values", _CAPTIONS["singular_values"], partial(singular_values, result))
    drawn = partial(correlation, uncertainty, result.names)
    points = direction_phrases(problem, result)
    correlations = Plot("correlation", _CAPTIONS["correlation"], drawn)
    logs = by_log(problem, uncertainty)
    several = {} if logs is None else {"by_log": by_log_table(problem, uncertainty, logs)}
    return Section(
        "What the logs do not determine",
        "" if points else "Nothing: every direction in the table is determined.",
        points=points,
        tables={
            "directions": direction_table(result),
            "noise": noise_table(problem, uncertainty),
            **several,
        },
        plots=(values, correlations) if np.sum(_correlated(uncertainty)) > 1 else (values,),
    )


def interval_table(study: UncertaintyStudy) -> Table:
    """Return every parameter with its standard deviation, its 95 % intervals by each method, and its flag."""
    found, refits = study.uncertainty, study.refits
    profiles = {p.name: p.interval for p in study.profiles}
    header = ["name", "unit", "value", "standard deviation", "from", "to"]
    header += ["profile from", "profile to"] if profiles else []
    header += ["bootstrap from", "bootstrap to"] if refits is not None else []
    rows: list[tuple[Cell, ...]] = []
    for i, parameter in enumerate(study.problem.parameters.parameters):
        row: list[Cell] = [parameter.name, parameter.unit, float(found.theta[i])]
        row += [unless_nan(v) for v in (found.standard_deviation[i], *found.interval[i])]
        if profiles:
            row += [unless_nan(v) for v in profiles.get(parameter.name, (np.nan, np.nan))]
        if refits is not None:
            identifiable = np.isfinite(found.relative[i])
            ends = np.quantile(refits[:, i], [0.025, 0.975]) if identifiable else (-np.inf, np.inf)
            row += [unless_nan(v) for v in ends] if found.free[i] else [None, None]
        rows.append((*row, status_phrase(found.status[i])))
    note = (
        f"At {study.source}. 95 % intervals. The noise is taken from the residuals, and the intervals are "
        "only right if the model is right. A dash (–): no limit. A parameter at a bound has no interval. "
        "If these parameters are not a fit to these logs, the residuals are no measure of the noise: set "
        "objective.noise_deg."
    )
    if refits is not None:
        few = ", too few for 95 %: about their lowest and highest" if len(refits) < _FEW_REFITS else ""
        note += f" bootstrap: {len(refits)} refits{few}; – for a parameter that is not identifiable."
    return Table("What the logs determine", (*header, "flag"), tuple(rows), note, ("standard deviation",))


def direction_table(result: Identifiability) -> Table:
    """Return every direction with its standard deviation and its largest parts, best determined first."""
    rows: list[tuple[Cell, ...]] = []
    for value, axis in zip(result.singular, result.axes, strict=True):
        order = [i for i in np.argsort(-np.abs(axis), kind="stable") if abs(axis[i]) >= _SHOWN]
        parts = ", ".join(f"{result.names[i]} {axis[i]:+.2f}".replace("-", "−") for i in order)
        rows.append((float(value), 100 / value if value > 0 else np.inf, parts))
    note = (
        "A direction changes several parameters together. The relative changes give the proportions: A "
        "+0.8, B −0.4 means that B falls by 1 % when A grows by 2 %. A large standard deviation means that "
        f"the logs hardly show such a change. {result.rank} of {len(result.names)} directions have a "
        f"relative standard deviation of {100 * WEAK_ABOVE:.0f} % or less."
    )
    header = ("singular value", "standard deviation [%]", "relative changes")
    return Table("Directions", header, tuple(rows), note, header[:1])


def noise_table(problem: Problem, uncertainty: Uncertainty) -> Table:
    """Return the noise of every channel, and where it was taken from."""
    names = log_names(problem.logs)
    rows: list[tuple[Cell, ...]] = []
    for channel, noise in zip(problem.channels, uncertainty.noise, strict=True):
        angle = channel.quantity == "angle"
        factor = (np.degrees(1) if angle else 1e-5) / channel.weight
        residual = factor * float(np.sqrt(np.mean(uncertainty.jacobian.residual[channel.rows] ** 2)))
        signal = f"{channel.quantity.replace('_', ' ')} [{'deg' if angle else 'bar'}]"
        seconds = noise.correlation_time * problem.logs[channel.log].period
        found = residual, factor * noise.level, seconds, noise.effective_sample_size, noise.source
        rows.append((names[channel.log], channel.joint, signal, *found))
    found = "rms residual", "noise", "correlation time [s]", "effective sample size", "source"
    note = (
        "rms residual: of the measured minus the simulated signal. noise: standard deviation of the noise "
        "that the intervals use, and where it comes from (source): the residual, corrected for what the fit "
        "absorbed; the settings; or the smallest value allowed. correlation time: after it the noise's "
        "autocorrelation is below 1/e. effective sample size: the number of independent samples that would "
        "determine the noise level equally well."
    )
    return Table("Noise", ("log", "joint", "signal", *found), tuple(rows), note, ("rms residual", "source"))


def singular_values(result: Identifiability) -> Figure:
    """Draw how well each combination is determined, and which are not determined to WEAK_ABOVE."""
    values, limit = result.singular, 1 / WEAK_ABOVE
    top = max(float(values.max(initial=0.0)), limit)
    foot = top * _LEAST_DRAWN
    drawing = style.figure(3.0, left=0.9)
    axes = drawing.subplots()
    axes.set_yscale("log")
    axes.set_ylim(foot / 3, 3 * top)
    at, height = np.arange(1, len(values) + 1), np.maximum(values, foot)
    for chosen, color, mark in ((values >= limit, style.SEARCH, "o"), (values < limit, style.REFINED, "D")):
        axes.vlines(at[chosen], foot / 3, height[chosen], color=color, linewidth=1.0, alpha=0.5)
        for fill, part in ((color, chosen & (values > foot)), ("white", chosen & (values <= foot))):
            axes.plot(at[part], height[part], mark, color=color, markerfacecolor=fill, markersize=6)
    axes.axhline(limit, color=style.GREY, linestyle="--", linewidth=1.0)
    note = f"standard deviation {100 * WEAK_ABOVE:.0f} %"
    axes.text(len(values) + 0.45, 1.2 * limit, note, color=style.GREY, fontsize=8, ha="right", va="bottom")
    axes.set_xlim(0.5, len(values) + 0.5)
    axes.set_xticks(at)
    axes.grid(axis="x", visible=False)
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(style.tick))
    axes.set_title("How well the logs determine each combination")
    axes.set_xlabel("direction, best determined first")
    axes.set_ylabel("1 / relative standard deviation")
    return drawing


def correlation(uncertainty: Uncertainty, names: Sequence[str]) -> Figure:
    """Draw the correlation of the estimates that are identifiable, with numbers where there is room."""
    shown = _correlated(uncertainty)
    names = [name for name, each in zip(names, shown, strict=True) if each]
    values = uncertainty.correlation[np.ix_(shown, shown)]
    room = style.room_for(names)
    drawing = style.figure(1.5 + _CELL * len(names), left=room, right=0.1, bottom=0.2 + 0.7 * room)
    axes = drawing.subplots()
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    axes.set_yticks(range(len(names)), names)
    axes.set_xticks(range(len(names)), names, rotation=45, ha="right", rotation_mode="anchor", fontsize=8)
    axes.tick_params(length=0)
    axes.grid(False)
    axes.spines[["left", "bottom"]].set_visible(False)
    if len(names) <= _MOST_NUMBERS:
        for (i, j), value in np.ndenumerate(values):
            color = "white" if abs(value) > 0.6 else style.MEASURED
            text = f"{round(value, 2) + 0.0:.2f}".replace("-", "−")
            axes.text(j, i, text, ha="center", va="center", fontsize=7, color=color)
    drawing.colorbar(image, ax=axes, shrink=0.8, pad=0.02)
    axes.set_title("Correlation of the estimates")
    return drawing


def _correlated(uncertainty: Uncertainty) -> NDArray[np.bool_]:
    """Return the free parameters that are identifiable: the others have no correlation."""
    return np.isfinite(np.diag(uncertainty.correlation))


def draw_profiles(study: UncertaintyStudy) -> Figure:
    """Draw the deviance around each profiled parameter's interval, with the linear approximation."""
    results, uncertainty, parameters = study.profiles, study.uncertainty, study.problem.parameters
    drawing = style.figure(2.3 * len(results) + 0.9)
    panels = np.atleast_1d(drawing.subplots(len(results), 1, gridspec_kw={"hspace": 0.45}))
    for axes, profile in zip(panels, results, strict=True):
        i = parameters.names.index(profile.name)
        centre, deviation = uncertainty.theta[i], uncertainty.standard_deviation[i]
        low, high = np.clip(profile.interval, profile.values[0], profile.values[-1])
        margin = _PROFILE_MARGIN * (high - low)
        ends = max(low - margin, profile.values[0]), min(high + margin, profile.values[-1])
        fine = np.union1d(np.linspace(*ends, 201), profile.values)
        # between its points the square root is taken for linear, as in the interval
        root = np.sqrt(np.maximum(profile.deviance, 0.0)) * np.sign(profile.values - centre)
        axes.axvspan(low, high, color="#DCE9F3", zorder=0.5, label="95 % interval")
        axes.plot(fine, np.interp(fine, profile.values, root) ** 2, color=style.SEARCH, label="profile")
        axes.plot(profile.values, profile.deviance, "o", color=style.SEARCH, markersize=4)
        if np.isfinite(deviation) and deviation > 0:
            parabola = ((fine - centre) / deviation) ** 2
            axes.plot(fine, parabola, "--", color=style.GREY, linewidth=1.0, label="linear approximation")
        axes.axhline(THRESHOLD, color=style.REFINED, linewidth=1.0, label="threshold of 95 %")
        axes.set_xlim(*ends)
        axes.set_ylim(min(-0.2, 1.2 * float(profile.deviance.min())), 2.5 * THRESHOLD)
        unit = parameters.parameters[i].unit
        axes.set_xlabel(f"{profile.name} [{unit}]" if unit else profile.name)
        axes.set_ylabel("deviance")
    panels[0].set_title("Error with one parameter held and the others fitted again")
    style.legend_below(drawing, panels[0], columns=4)
    return drawing
