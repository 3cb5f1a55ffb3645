"""The verdict on fits as a terminal and a page show it: one row a joint, beside the
baselines."""

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from hydroid.estimate import FitSummary
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.fitting.baselines import NAMES
from hydroid.fitting.comparison import BLOCK, LEAST_BLOCKS
from hydroid.fitting.validation import HORIZONS, Prediction
from hydroid.fitting.verdict import JUDGED, THE_FIT, WORSE
from hydroid.joint_verdict import Comparison, JointVerdict, Outcome, Verdict
from hydroid.reporting.page import Cell, Given, Section, Table, short_name
from hydroid.search.descent import Ending
from hydroid.settings.arm import Arm
from hydroid.settings.log import log_file
from hydroid.units import Display, display
from hydroid.words import listed, told_apart, two_digits

_RIVALS = (
    "Simple models: standing still; speed tables (mean speed at each command); nine numbers (one "
    "delay, and for each direction dead band, exponent, top speed and lag)."
)
_FITTED = (
    "Rms errors{unit} on the fitted logs. No other log has tested the fit yet. "
    "The last three columns are simple models."
)
_TESTED = (
    "Rms errors{unit} on {count} unseen log{s}{lengths}, which the fit did not use: 1, 5 and 10 s "
    "ahead, and over whole logs. In brackets: the error of the best simple model. Better, worse: "
    "than it. Cannot be told: the difference may be chance. "
    "Allowed error: over whole logs, by default 2 % of travel."
)
_HOLDS = "Holds for free motion with the loads, the oil temperature and the engine speed of these logs. "
_MARKS = "✗ and ! say which rule holds, not which error is larger: compare whole logs with what is allowed. "
_RULES = {
    Verdict.PREDICTS: "within the allowed error over whole logs",
    Verdict.MISFIT: "errs on the fitted logs by more than is allowed, and more than a simple model",
    Verdict.NO_BETTER: "after 1, 5 or 10 s worse than this simple model, and never better",
    Verdict.WORSE_THAN_FITTED: "no better than a simple model, and twice the error of the fitted logs",
    Verdict.LITTLE: "errs by more than half of what standing still does",
    Verdict.UNTOLD: "after 1, 5 and 10 s neither better nor worse than this simple model",
    Verdict.ROUGHLY: "no other rule holds, and after 1, 5 or 10 s it is better than each simple model",
}
"""when a joint has a verdict, the rule that is asked first in front"""
_NO_WORD = (
    f" Without a word there is too little to compare: it takes {LEAST_BLOCKS} unseen logs, "
    f"or for 1, 5 and 10 s ahead {LEAST_BLOCKS * BLOCK:g} s of them."
)
WHOLE = "whole logs"
"""name of a column"""
FITTED = "whole fitted logs"
"""name of the column of errors on the logs that the fit used"""
ALLOWED = "allowed error"
"""name of the column of tolerances"""
_BEYOND = "Furthest beyond its allowed error"

_LEFT_OUT = "By joint: the rms error [deg] on parts of the logs, each predicted by a fit without it."

Verdicts = Mapping[str, Sequence[JointVerdict]]  # by fit


def verdict_table(fits: Verdicts, lengths: str = "") -> Table:
    """Return the verdicts on each joint of each fit.

    Where unseen logs test a joint, its errors stand beside those of the best simple
    model there. `lengths` says how long these logs are.
    """
    every = [*chain.from_iterable(fits.values())]
    count = max(verdict.unseen_logs for verdict in every)
    slides = any(verdict.slides for verdict in every)
    names = ["joint", "verdict"]
    if len(fits) > 1:
        names.insert(0, "fit")
    unit = " [deg]"
    if slides:
        # joints differ in their units: each row says its own
        unit = ""
        names.append("unit")
    if count:
        names += [*map(column_of, JUDGED), WHOLE, FITTED, ALLOWED]
        optional = (ALLOWED, FITTED, column_of(JUDGED[1]), WHOLE)
        s = "s" if count > 1 else ""
        note = _TESTED.format(unit=unit, count=count, s=s, lengths=lengths)
        if count < LEAST_BLOCKS:
            note += _NO_WORD
    else:
        names += [FITTED, *NAMES]
        optional = NAMES[:2]
        note = _FITTED.format(unit=unit)
    rows = list[dict[str, Cell]]()
    for fit, verdicts in fits.items():
        for verdict in verdicts:
            row = _tested_row(verdict) if count else _fitted_row(verdict)
            rows.append(row | {"fit": short_name(fit)})
    return Table.of("", {name: name for name in names}, rows, note, optional)


def column_of(seconds: float) -> str:
    """Return the name of the column of a prediction time."""
    return f"{seconds:g} s"


def _row(verdict: JointVerdict) -> dict[str, Cell]:
    """Return what every row of the table of verdicts has, by columns."""
    return {
        "joint": verdict.name,
        "verdict": f"{verdict.verdict.sign} {verdict.text}",
        "unit": verdict.shown.unit,
        FITTED: _shown(verdict.fitted_deg, verdict.shown),
        ALLOWED: _shown(verdict.tolerance_deg, verdict.shown),
    }


def _fitted_row(verdict: JointVerdict) -> dict[str, Cell]:
    """Return a row of the table of verdicts where no unseen log tests any joint."""
    row = _row(verdict)
    for name, error in verdict.baselines_deg.items():
        row[name] = _shown(error, verdict.shown)
    return row


def _tested_row(verdict: JointVerdict) -> dict[str, Cell]:
    """Return a row of the table of verdicts where unseen logs test this joint or
    another."""
    row = _row(verdict)
    if not verdict.unseen_logs:
        return row
    whole = _whole_errors(verdict)
    row[WHOLE] = _beside_best(whole, verdict.compared_whole, verdict.shown)
    for i, seconds in enumerate(HORIZONS):
        errors = {name: errors[i] for name, errors in verdict.horizons_deg.items()}
        compared = {name: outcomes[i] for name, outcomes in verdict.compared.items()}
        beside = _beside_best(errors, compared, verdict.shown)
        row[column_of(seconds)] = beside
    return row


def _whole_errors(verdict: JointVerdict) -> dict[str, float | None]:
    """Return the errors over whole logs [deg], of the fit and of simple models."""
    return {THE_FIT: verdict.unseen_deg} | verdict.baselines_deg


def _beside_best(
    errors: Mapping[str, float | None],
    compared: Mapping[str, Comparison],
    shown: Display,
) -> str | None:
    """Return the fit's error beside that of the best simple model, as "2.1 (2.3) cannot
    be told".

    Nothing where the logs are too short for the prediction time; no word where a log,
    or a few, cannot tell.
    """
    simple = dict[str, float]()
    for name, error in errors.items():
        if name in compared and error is not None:
            simple[name] = error
    if not simple:
        return None
    best = min(simple, key=simple.__getitem__)
    comparison = compared[best]
    fit = errors[THE_FIT]
    scale = shown.of_degrees(1.0)
    if fit is None:
        return f"diverged ({two_digits(scale * simple[best])})"
    ours, theirs = told_apart(scale * fit, scale * simple[best])
    if comparison.blocks < LEAST_BLOCKS:
        return f"{ours} ({theirs})"
    return f"{ours} ({theirs}) {comparison.outcome}"


def _shown(error: float | None, shown: Display) -> Cell:
    """Return an error [deg] as a table shows it, in the unit in which its joint is
    shown."""
    if error is None:
        return None
    return Given(two_digits(shown.of_degrees(error)))


def left_out_table(
    title: str, columns: dict[str, str], rows: Sequence[Plain], arm: Arm, note: str = ""
) -> Table:
    """Return a table of rows by key, with a further column for each joint of their
    `left_out_deg`."""
    # of the joints' columns: a joint may be called as one of `columns`
    keys = dict[str, str]()
    sliding = {joint.name for joint in arm.joints if joint.slides}
    cells = list[dict[str, Cell]]()
    for row in rows:
        cells.append(dict(row))
        for name, error in row.get("left_out_deg", {}).items():
            key = f"left_out_deg.{name}"
            keys[key] = name
            shown = display(slides=name in sliding)
            cell = _shown(error, shown)
            # the note says that the others are in deg
            if cell is not None and name in sliding:
                cell = f"{cell:g} {shown.unit}"
            cells[-1][key] = cell
    return Table.of(title, columns | keys, cells, note + _LEFT_OUT)


def verdict_sections(
    fits: Verdicts,
    predictions: Sequence[Prediction],
    *steps: Finding,
    points: tuple[str, ...] = (),
) -> tuple[Section, ...]:
    """Return the sections that every page of predictions begins with: the verdicts, and
    what to do next, with further `points`.
    """
    table = verdict_table(fits, _lengths(predictions))
    note = f"{_rules(fits)}{_HOLDS}{table.note} {_RIVALS}"
    table = replace(table, note=note)
    verdict = Section("Verdict", tables={"verdict": table})
    if not steps:
        return (verdict,)
    return verdict, Section("Next", points=points, steps=steps)


def _rules(fits: Verdicts) -> str:
    """Say by which rules joints have the verdicts that the table shows."""
    shown = {verdict.verdict for verdicts in fits.values() for verdict in verdicts}
    # a joint that fails a rule may err by less than one that predicts roughly
    marks = _MARKS if {"✗", "!"} <= {verdict.sign for verdict in shown} else ""
    said = [
        f"{verdict.capitalize()}: {rule}. "
        for verdict, rule in _RULES.items()
        if verdict in shown
    ]
    return "".join(said) + marks


def _lengths(predictions: Sequence[Prediction]) -> str:
    """Say how long the unseen logs are that a verdict counts, as " of 20 to 25 s"."""
    counted = {
        prediction.log.source: prediction.log.duration
        for prediction in predictions
        if prediction.unseen and not prediction.apart
    }
    if not counted:
        return ""
    low, high = round(min(counted.values())), round(max(counted.values()))
    return f" of {low} s" if low == high else f" of {low} to {high} s"


def horizon_section(fits: Verdicts) -> Section | None:
    """Return the rms error of each angle's change over some times, of fits and
    baselines, if known."""
    rows = list[dict[str, Cell]]()
    for fit, verdicts in fits.items():
        fit_name = short_name(fit) if len(fits) > 1 else THE_FIT
        for verdict in verdicts:
            for row in _horizon_rows(verdict, fit_name):
                # the simple models of fits to the same logs are the same
                if row not in rows:
                    rows.append(row)
    names = ("joint", "of", "unit", *map(column_of, HORIZONS), WHOLE)
    columns = {name: name for name in names}
    note = (
        "How far the joint moves in this time: the rms error, over starts every 2 s along "
        "the unseen logs. A simulation begins at the measured angles, 2 s before its start. "
        "Last column: error of the angle over whole logs."
    )
    table = Table.of("Error by prediction time", columns, rows, note)
    if not rows:
        return None
    answer = f"the fit beside simple models over {HORIZONS[0]:g} to {HORIZONS[-1]:g} s"
    return Section(table.title, tables={"horizons": table}, folded=True, answer=answer)


def _horizon_rows(verdict: JointVerdict, fit_name: str) -> Iterator[dict[str, Cell]]:
    """Yield a joint's errors by prediction time: of the fit, and of each simple
    model."""
    whole = _whole_errors(verdict)
    for name, errors in verdict.horizons_deg.items():
        row: dict[str, Cell] = {
            "joint": verdict.name,
            "of": fit_name if name == THE_FIT else name,
            "unit": verdict.shown.unit,
        }
        for seconds, error in zip(HORIZONS, errors, strict=True):
            row[column_of(seconds)] = _shown(error, verdict.shown)
        row[WHOLE] = _shown(whole[name], verdict.shown)
        yield row


def ordered(fits: Verdicts) -> Verdicts:
    """Return the fits, the smallest errors first: in parts of the tolerances of the
    joints that all compare.

    Where there is no such joint, each fit counts by the mean of its own ones.
    """
    joints = [_joints(verdicts) for verdicts in fits.values()]
    shared = set.intersection(*joints)

    def size(fit: str) -> float:
        verdicts = fits[fit]
        compared = shared or _joints(verdicts)
        sizes = [_size(verdict) for verdict in verdicts if verdict.joint in compared]
        return float(np.mean(sizes))

    return {fit: fits[fit] for fit in sorted(fits, key=size)}


def _joints(verdicts: Sequence[JointVerdict]) -> set[int]:
    return {verdict.joint for verdict in verdicts}


def _error(verdict: JointVerdict) -> float:
    """Return the error on the unseen logs, or of a joint that they do not test on the
    fitted ones [deg]; infinite where the simulation diverged."""
    error = verdict.unseen_deg if verdict.unseen_logs else verdict.fitted_deg
    return np.inf if error is None else error


def _size(verdict: JointVerdict) -> float:
    """Return the error in parts of the tolerance.

    0 of a joint that no log drives, which has none.
    """
    is_fitted = verdict.fitted_deg is not None
    is_tested = verdict.verdict is not Verdict.UNTESTED
    if verdict.unseen_logs or is_fitted or is_tested:
        return _error(verdict) / verdict.tolerance_deg
    return 0.0


def verdict_lines(fits: Verdicts) -> list[Table | str]:
    """Return the verdicts as a terminal shows them: the table, and what is worst about
    the first fit.
    """
    first = next(iter(fits.values()))
    return [verdict_table(fits), *filter(None, [worst(first)]), *outside(first)]


def next_lines(step: Finding) -> tuple[str, str]:
    """Return what to do next as a terminal shows it."""
    return f"Next: {step}", f"  {step.numbers['command']}"


def lead(fits: Verdicts) -> str:
    """Say of the first of the fits which joints it predicts, what is wrong with the
    others, and the worst.
    """
    name, verdicts = next(iter(fits.items()))
    best = f"{short_name(name)} is best. " if len(fits) > 1 else ""
    by_word = dict[str, list[str]]()
    for verdict in verdicts:
        by_word.setdefault(verdict.text, []).append(verdict.name)
    said = "; ".join(f"{listed(names)}: {word}" for word, names in by_word.items())
    count = max(verdict.unseen_logs for verdict in verdicts)
    over = ""
    if count:
        over = f" ({count} unseen log{'s' if count > 1 else ''})"
    return f"{best}{said}{over}. {worst(verdicts)}".strip()


def outside(verdicts: Sequence[JointVerdict]) -> tuple[str, ...]:
    """Say of which joints the prediction bands are too narrow.

    Nothing where all hold their samples.
    """
    missed = list[str]()
    for verdict in verdicts:
        percent = verdict.inside_percent
        # a right model's bands hold somewhat less than 95 % where the start of a log is
        # off
        if percent is not None and percent < 80:
            missed.append(f"{percent:.0f} % of the {verdict.name}'s")
    if not missed:
        return ()
    return (
        f"The 95 % bands are too narrow: they hold only {listed(missed)} unseen samples.",
    )


def worst(verdicts: Sequence[JointVerdict]) -> str:
    """Say which of several joints errs most, in parts of its tolerance; nothing of one
    joint."""
    if len(verdicts) < 2:
        return ""
    verdict = max(verdicts, key=_size)
    if not np.isfinite(_error(verdict)):
        return f"{_BEYOND}: {verdict.name}, whose simulation diverges."
    scale = verdict.shown.of_degrees(1.0)
    unit = verdict.shown.unit
    tolerance = two_digits(scale * verdict.tolerance_deg)
    # a joint without simple models has no logs either, and nothing beside it
    simple = min(verdict.baselines_deg.values(), default=0.0)
    error, least = told_apart(scale * _error(verdict), scale * simple)
    where = _BEYOND
    if _size(verdict) <= 1.0:
        where = "Nearest to its allowed error"
    errs = "The best simple model errs by"
    chance = ""
    if _is_by_chance(verdict):
        chance = "; the difference may be chance"
    elif simple < _error(verdict):
        errs = "A simple model errs by less:"
    return (
        f"{where}: {verdict.name}, {error} {unit} (allowed {tolerance}, by default 2 % of "
        f"travel). {errs} {least} {unit}{chance}."
    )


def _is_by_chance(verdict: JointVerdict) -> bool:
    """Return whether unseen logs leave open which errs less over whole logs, the fit or
    the best simple model.

    Errors on fitted logs are not compared.
    """
    if not verdict.unseen_logs or not verdict.baselines_deg:
        return False
    errors = verdict.baselines_deg
    comparison = verdict.compared_whole.get(min(errors, key=errors.__getitem__))
    if comparison is None or comparison.blocks < LEAST_BLOCKS:
        return True
    return comparison.outcome is Outcome.UNTOLD


def next_step(
    summary: FitSummary,
    verdicts: Sequence[JointVerdict],
    folder: str,
    fitted: Sequence[Prediction],
) -> Finding:
    """Return what to do after a fit in a run folder, which made `fitted` of its logs,
    with the command."""
    run = shlex.quote(folder)
    sources = [str(log_file(prediction.log.source)) for prediction in fitted]
    files = shlex.join(dict.fromkeys(sources))
    untested = _named(verdicts, lambda v: v.verdict is Verdict.UNTESTED)
    if summary.ending == Ending.TIME.value:
        stage = summary.stage
        command = f"fit-{stage} {files} --config {run}/config.yaml --out {run} --resume"
        return _step("go on", untested, command)
    if summary.stage == "mech":
        return _step("fit the hydraulics", untested, f"fit-hyd {files} --mech {run}")
    if untested:
        return _step("predict unseen", untested, f"validate OTHER.csv --fit {run}")
    return _step_after_tests(verdicts, run)


def _step_after_tests(verdicts: Sequence[JointVerdict], run: str) -> Finding:
    """Return what to do once unseen logs have tested all joints of a run."""
    if all(verdict.verdict is Verdict.PREDICTS for verdict in verdicts):
        return _step("use the machine", [], f"follow TRAJECTORY.csv --fit {run}")
    if worse := _named(verdicts, _worse_than_expected):
        return _step("machine changed", worse, f"adapt UNSEEN.csv --fit {run}")
    if untold := _too_short(verdicts):
        return _step("test longer", untold, f"validate OTHER.csv --fit {run}")
    return _step("look for terms", [], f"suggest --fit {run}")


def _step(kind: str, joints: Sequence[str], command: str) -> Finding:
    return Finding(kind, "note", tuple(joints), {"command": f"hydroid {command}"})


def _named(
    verdicts: Sequence[JointVerdict], chosen: Callable[[JointVerdict], bool]
) -> list[str]:
    """Return the names of the joints whose verdicts are chosen."""
    return [verdict.name for verdict in verdicts if chosen(verdict)]


def _worse_than_expected(verdict: JointVerdict) -> bool:
    """Return whether a fit fails unseen logs by more than its fitted logs let
    expect."""
    if verdict.verdict is Verdict.PREDICTS:
        return False
    if verdict.unseen_deg is None or not verdict.expected_deg:
        return False
    return verdict.unseen_deg > WORSE * verdict.expected_deg


def _too_short(verdicts: Sequence[JointVerdict]) -> list[str]:
    """Return the joints whose unseen logs are too short to tell.

    None where any joint is known to fail.
    """
    if any(verdict.verdict.fails for verdict in verdicts):
        return []
    return _named(
        verdicts, lambda v: v.verdict is Verdict.UNTOLD and _has_few_blocks(v)
    )


def _has_few_blocks(verdict: JointVerdict) -> bool:
    """Return whether unseen logs are too short to compare a joint with its best simple
    model over every prediction time."""
    comparisons = verdict.compared.get(verdict.beside or "", ())
    blocks = [comparison.blocks for comparison in comparisons]
    return min(blocks, default=0) < LEAST_BLOCKS
