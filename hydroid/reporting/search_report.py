"""How the search went: its learning curve, the Pareto set, and what each refinement took."""

from functools import partial

import numpy as np

from hydroid.arrays import Array
from hydroid.reporting.chart import SERIES, Chart, Mark, Panel, finite
from hydroid.reporting.page import Plot, Section
from hydroid.run.record import Record
from hydroid.settings.problem import ObjectiveSettings
from hydroid.words import two_digits


def search_section(record: Record) -> Section:
    """Return the section of a run's search, folded."""
    result, objective, points = record.result, record.settings.objective, list[str]()
    if len(result.history):
        _, tried, simulated, diverged = (f"{int(v):,}" for v in result.history[-1, :4])
        name = record.settings.search.algorithm
        points.append(f"{name}: {tried} candidates, {simulated} simulated, {diverged} of them diverged.")
    for one in result.refinements:
        points.append(
            f"{one.name}: {one.iterations} iterations, {one.simulations:,} simulations; {one.ending}."
        )
        rise, error = record.summary.estimates[one.name].gained or (None, None)
        if rise is not None and error is not None:
            better = f"by {two_digits(rise)} ± {two_digits(error)}"
            points[-1] += f" It foretells parts of the logs left out better {better} (log-likelihood)."
    final = str(record.summary.final)
    segments = {final: result.segments[final], **result.segments}
    plots = (
        Plot("learning", "Best candidate so far.", partial(learning, result.history, objective)),
        Plot(
            "pareto",
            "The Pareto set: lower fits that segment better.",
            partial(pareto, result.front[1], segments, objective),
        ),
    )
    return Section("How the search went", points=tuple(points), plots=plots, folded=True)


def learning(history: Array, objective: ObjectiveSettings) -> Chart:
    """Draw the best objective so far and the population's median against evaluations."""
    tried, (best, median) = history[:, 1], _shown(objective, history[:, 4:6].T)
    return _chart(
        "candidates evaluated",
        objective,
        Mark("line", tried, median, color="grey", label="median of the population"),
        Mark("line", tried, best, color="blue", label="best so far", width=2),
        Mark("points", tried, best, color="blue", width=5),
    )


def pareto(objectives: Array, estimates: dict[str, Array], objective: ObjectiveSettings) -> Chart:
    """Draw each candidate of the Pareto set, and the estimates, as a line over the segments' objectives.

    `objectives`, shape (n, S + 1), end with that over the whole record; the 100 lowest there are drawn.
    """
    front = _shown(objective, objectives[np.argsort(objectives[:, -1], kind="stable")[:100], :-1])
    at = np.arange(1.0, front.shape[1] + 1)
    # one line with gaps: a line each would be a legend entry and a glyph each
    gap = np.full((len(front), 1), np.nan)
    lines = (np.column_stack([one, gap]).ravel()[:-1] for one in (np.broadcast_to(at, front.shape), front))
    kind = "points" if len(at) == 1 else "line"
    marks = [Mark(kind, *lines, color="grey", label=f"Pareto set ({len(objectives)})", width=1, alpha=0.6)]
    for color, (name, segments) in zip(SERIES, estimates.items(), strict=False):
        one = _shown(objective, segments)
        marks.append(Mark("line", at, one, color=color, label=name, width=2))
        marks.append(Mark("points", at, one, color=color, width=6))
    return _chart("segment", objective, *marks)


def _chart(x: str, objective: ObjectiveSettings, *marks: Mark) -> Chart:
    label = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}[objective.norm]
    label = f"relative {label} [-]" if objective.relative else f"{label} [deg]"
    drawable = any(np.isfinite(mark.y).any() for mark in marks)
    return Chart((Panel(x, label, marks, height=280, log_y=drawable),))


def _shown(objective: ObjectiveSettings, values: Array) -> Array:
    return finite(values if objective.relative else np.degrees(values))
