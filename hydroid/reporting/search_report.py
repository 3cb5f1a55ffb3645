"""Whether the optimum was reached: the learning curve, the Pareto set, and what each refinement
took."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from hydroid.arrays import Array
from hydroid.reporting.chart import SERIES, Chart, Mark, Panel, finite
from hydroid.reporting.page import Plot, Section
from hydroid.run.record import Effort, FinishedRun
from hydroid.settings.problem import ObjectiveSettings
from hydroid.words import listed, time_words, two_digits

_NORMS = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}
"""names of the objective's norms"""


def search_section(run: FinishedRun) -> Section:
    """Return the section of a run's search, folded.

    Only a search over generations has curves of it.
    """
    result = run.result
    objective = run.settings.objective
    points = list[str]()
    if len(result.history):
        _, tried, simulated, diverged = map(int, result.history[-1, :4])
        points.append(
            f"{run.settings.search.algorithm}: {tried:,} candidates, "
            f"{simulated:,} simulated, {diverged:,} of them diverged."
        )
    points += [_refined(run, effort) for effort in result.refinements]
    names = run.settings.arm.joint_names
    counts = list[str]()
    for joint, costs in result.starts.items():
        counts.append(f"{names[joint - 1] if joint else 'all joints'} {len(costs)}")
    if counts:
        points.append(f"Starts of the search: {listed(counts)}.")
    plots = list[Plot]()
    if len(result.history) > 1:
        final = str(run.summary.final)
        segments = {final: result.segments[final], **result.segments}
        draw = partial(learning, result.history, objective)
        plots.append(Plot("learning", "Best candidate so far.", draw))
        draw = partial(pareto, result.front[1], segments, objective)
        caption = "The Pareto set: a lower point fits that segment better."
        plots.append(Plot("pareto", caption, draw))
    if any(len(costs) > 1 for costs in result.starts.values()):
        caption = "Where each start of the search ended. 0 = the best start; further right = worse."
        draw = partial(starts, names, result.starts)
        plots.append(Plot("starts", caption, draw))
    if run.seconds:
        steps = [f"{step} {time_words(took)}" for step, took in run.seconds.items()]
        points.append(f"Time: {listed(steps)}.")
    return Section(
        "Was the optimum reached?",
        points=tuple(points),
        plots=tuple(plots),
        folded=True,
        answer=_answer(run),
    )


def _answer(run: FinishedRun) -> str:
    """Say whether the optimum was reached, and what the fit took in all."""
    answers = [_reached(run)]
    if run.seconds:
        answers.append(f"it took {time_words(sum(run.seconds.values()))}")
    return "; ".join(answers)


def _reached(run: FinishedRun) -> str:
    """Say whether a fit ended at an optimum: no, where its end, its starts or simple
    models speak against it."""
    summary = run.summary
    if summary.converged is None:
        return "not known: the search alone was run"
    if not summary.converged:
        return f"no: {summary.ending}"
    by_kind = {finding.kind: listed(finding.subjects) for finding in summary.findings}
    for kind, joints in by_kind.items():
        if kind.startswith("behind nine numbers"):
            return f"no, or the model is wrong: nine numbers fit the logs better in {joints}"
    if joints := by_kind.get("several optima"):
        return (
            f"not known: starts of {joints} ended at different optima; the best is kept"
        )
    said = f"yes: {summary.ending}"
    if any(len(ended) > 1 for ended in run.result.starts.values()):
        said += "; all starts ended there"
    return said


def _refined(run: FinishedRun, effort: Effort) -> str:
    """Say what a refinement took, and what it brought."""
    said = (
        f"{effort.name}: {effort.iterations} iterations, "
        f"{effort.simulations:,} simulations; {effort.ending}."
    )
    rise, error = run.summary.estimates[effort.name].gained or (None, None)
    if rise is None or error is None:
        return said
    better = f"by {two_digits(rise)} ± {two_digits(error)}"
    return f"{said} It predicts parts of the logs that it did not use better {better} (log-likelihood)."


def starts(names: Sequence[str], costs: Mapping[int, Sequence[float]]) -> Chart:
    """Draw how far above the best optimum each start ended, by joint (from 1; 0: all
    joints together)."""
    rows = list[str]()
    x = list[float]()
    y = list[float]()
    for joint, ended in costs.items():
        reached = [cost for cost in ended if np.isfinite(cost)]
        if not reached:
            continue
        best = min(reached)
        x += [cost - best for cost in reached]
        y += [float(len(rows))] * len(reached)
        rows.append(names[joint - 1] if joint else "all joints")
    ends = Mark("points", np.array(x), np.array(y), color="blue", width=8, alpha=0.6)
    label = "negative log-likelihood above the best start's"
    height = 80 + 30 * len(rows)
    return Chart((Panel(label, "", (ends,), height=height, rows=tuple(rows)),))


def learning(history: Array, objective: ObjectiveSettings) -> Chart:
    """Draw the best objective so far and the population's median against
    evaluations."""
    tried = history[:, 1]
    best, median = _shown(objective, history[:, 4:6].T)
    return _chart(
        "candidates evaluated",
        objective,
        Mark("line", tried, median, color="grey", label="median of the population"),
        Mark("line", tried, best, color="blue", label="best so far", width=2),
        Mark("points", tried, best, color="blue", width=5),
    )


def pareto(
    objectives: Array, estimates: dict[str, Array], objective: ObjectiveSettings
) -> Chart:
    """Draw each candidate of the Pareto set, and the estimates, as a line over the
    segments' objectives.

    `objectives`, shape (n, S + 1), end with that over all logs; the 100 lowest
    there are drawn.
    """
    lowest = np.argsort(objectives[:, -1], kind="stable")[:100]
    front = _shown(objective, objectives[lowest, :-1])
    at = np.arange(1.0, front.shape[1] + 1)
    kind = "points" if len(at) == 1 else "line"
    x = _with_gaps(np.broadcast_to(at, front.shape))
    y = _with_gaps(front)
    label = f"Pareto set ({len(objectives)})"
    marks = [Mark(kind, x, y, color="grey", label=label, width=1, alpha=0.6)]
    for color, (name, segments) in zip(SERIES, estimates.items(), strict=False):
        values = _shown(objective, segments)
        marks.append(Mark("line", at, values, color=color, label=name, width=2))
        marks.append(Mark("points", at, values, color=color, width=6))
    return _chart("segment", objective, *marks)


def _with_gaps(rows: Array) -> Array:
    """Return rows, shape (n, m), as one line with gaps: a line each would be a legend
    entry and a glyph each."""
    gap = np.full((len(rows), 1), np.nan)
    return np.column_stack([rows, gap]).ravel()[:-1]


def _chart(x: str, objective: ObjectiveSettings, *marks: Mark) -> Chart:
    name = _NORMS[objective.norm]
    label = f"relative {name} [-]" if objective.relative else f"{name} [deg]"
    drawable = any(np.isfinite(mark.y).any() for mark in marks)
    return Chart((Panel(x, label, marks, height=280, log_y=drawable),))


def _shown(objective: ObjectiveSettings, values: Array) -> Array:
    return finite(values if objective.relative else np.degrees(values))
