"""The verdict on fits as a terminal and a page show it: one row a joint, beside the
baselines."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hydroid.estimate import FitSummary
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.fitting.baselines import NAMES
from hydroid.fitting.comparison import LEAST_BLOCKS
from hydroid.fitting.validation import HORIZONS, Prediction
from hydroid.fitting.verdict import JUDGED, THE_FIT, WORSE
from hydroid.joint_verdict import Comparison, JointVerdict, Verdict
from hydroid.reporting.page import Cell, Given, Section, Table, short_name
from hydroid.search.descent import Ending
from hydroid.settings.arm import Arm
from hydroid.settings.log import log_file
from hydroid.units import Display, display
from hydroid.words import listed, told_apart, two_digits

_RIVALS = (
    "Simple models are: standing still; speed tables, the mean speed at each command; and nine numbers a "
    "joint, which are dead band, exponent, top speed and lag of each direction, and one delay."
)
_FITTED = (
    "Rms errors{unit} on the fitted logs. No other log tests the fit yet. "
    "Last three columns: simple models."
)
_TESTED = (
    "Rms errors{unit} on {count} unseen log{s} (not fitted): of the change over 1, 5 and 10 s, and over "
    "whole logs. In brackets: the best simple model. The word after it: whether the fit is better or "
    "worse than that model, or cannot be told from it."
)
WHOLE = "whole logs"
"""name of a column"""

_LEFT_OUT = "By joint: the rms error [deg] on parts of the logs, each predicted by a fit without it."

Verdicts = Mapping[str, Sequence[JointVerdict]]  # by fit


def verdict_table(fits: Verdicts) -> Table:
    """Return the verdicts on each joint of each fit.

    Where unseen logs test a joint, its errors stand beside those of the best simple
    model there.
    """
    every = [one for verdicts in fits.values() for one in verdicts]
    count = max(one.unseen_logs for one in every)
    slides = any(one.slides for one in every)
    unit = "" if slides else " [deg]"
    if count:
        names = ("joint", "verdict", *map(column_of, JUDGED), WHOLE, "fitted")
        optional = ("fitted", column_of(JUDGED[1]), WHOLE)
        note = _TESTED.format(unit=unit, count=count, s="s" if count > 1 else "")
    else:
        names = ("joint", "verdict", "fitted", *NAMES)
        optional = NAMES[:2]
        note = _FITTED.format(unit=unit)
    if slides:
        names = (*names[:2], "unit", *names[2:])
    if len(fits) > 1:
        names = ("fit", *names)
    rows = [
        _row(one, tested=bool(count)) | {"fit": short_name(fit)}
        for fit, verdicts in fits.items()
        for one in verdicts
    ]
    return Table.of("", {name: name for name in names}, rows, note, optional)


def column_of(seconds: float) -> str:
    """Return the name of the column of a prediction time."""
    return f"{seconds:g} s"


def _row(one: JointVerdict, *, tested: bool) -> dict[str, Cell]:
    """Return a row of the table of verdicts by columns, where any joint is `tested` or
    none."""
    row: dict[str, Cell] = {
        "joint": one.name,
        "verdict": f"{one.verdict.sign} {one.text}",
        "unit": one.shown.unit,
        "fitted": _shown(one.fitted_deg, one.shown),
    }
    if not tested:
        return row | {
            name: _shown(error, one.shown) for name, error in one.baselines_deg.items()
        }
    if not one.unseen_logs:
        return row
    whole = {THE_FIT: one.unseen_deg} | one.baselines_deg
    # one log, or a few, cannot tell: the numbers stand there alone
    row[WHOLE] = _beside_best(whole, one.compared_whole, one.shown, least=LEAST_BLOCKS)
    for i, seconds in enumerate(HORIZONS):
        errors = {name: errors[i] for name, errors in one.horizons_deg.items()}
        compared = {name: comparisons[i] for name, comparisons in one.compared.items()}
        row[column_of(seconds)] = (
            _beside_best(errors, compared, one.shown) if errors else None
        )
    return row


def _beside_best(
    errors: Mapping[str, float | None],
    compared: Mapping[str, Comparison],
    shown: Display,
    least: int = 0,
) -> str | None:
    """Return the fit's error beside that of the best simple model, as "2.1 (2.3) cannot
    be told".

    Nothing where the logs are too short for the prediction time; no word of fewer than
    `least` blocks.
    """
    simple = {
        name: error
        for name, error in errors.items()
        if name in compared and error is not None
    }
    if not simple:
        return None
    best = min(simple, key=simple.__getitem__)
    fit = errors[THE_FIT]
    scale = shown.of_degrees(1.0)
    if fit is None:
        return f"diverged ({two_digits(scale * simple[best])})"
    ours, theirs = told_apart(scale * fit, scale * simple[best])
    word = f" {compared[best].outcome}" if compared[best].blocks >= least else ""
    return f"{ours} ({theirs}){word}"


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


def verdict_sections(fits: Verdicts, *steps: Finding) -> tuple[Section, ...]:
    """Return the sections that every page of predictions begins with: the verdicts, and
    what to do next.
    """
    table = verdict_table(fits)
    table = replace(table, note=f"{table.note} {_RIVALS}")
    verdict = Section("Verdict", tables={"verdict": table})
    return (verdict, Section("Next", steps=steps)) if steps else (verdict,)


def horizon_section(fits: Verdicts) -> Section | None:
    """Return the rms error of each angle's change over some times, of fits and
    baselines, if known."""
    rows = list[dict[str, Cell]]()
    for fit, verdicts in fits.items():
        for one in verdicts:
            whole = {THE_FIT: one.unseen_deg} | one.baselines_deg
            for name, errors in one.horizons_deg.items():
                of = short_name(fit) if name == THE_FIT and len(fits) > 1 else name
                row: dict[str, Cell] = {
                    "joint": one.name,
                    "of": of,
                    "unit": one.shown.unit,
                }
                for seconds, error in zip(HORIZONS, errors, strict=True):
                    row[column_of(seconds)] = _shown(error, one.shown)
                row[WHOLE] = _shown(whole[name], one.shown)
                # the simple models of fits to the same logs are the same
                if row not in rows:
                    rows.append(row)
    names = ("joint", "of", "unit", *map(column_of, HORIZONS), WHOLE)
    columns = {name: name for name in names}
    note = (
        "Rms error of how far the joint moves in this time, from starts every 2 s of the unseen logs. Each "
        "is simulated from 2 s before, at the measured angles. Last column: of the angle, over whole logs."
    )
    table = Table.of("Error by prediction time", columns, rows, note)
    if not rows:
        return None
    answer = f"the fit beside simple models over {HORIZONS[0]:g} to {HORIZONS[-1]:g} s"
    return Section(table.title, tables={"horizons": table}, folded=True, answer=answer)


def ordered(fits: Verdicts) -> Verdicts:
    """Return the fits, the smallest errors first: in parts of the tolerances of the
    joints that all compare.

    Where there is no such joint, each fit counts by the mean of its own ones.
    """
    shared = set.intersection(
        *({one.joint for one in verdicts} for verdicts in fits.values())
    )

    def size(verdicts: Sequence[JointVerdict]) -> float:
        return float(
            np.mean(
                [_size(one) for one in verdicts if one.joint in shared or not shared]
            )
        )

    return dict(sorted(fits.items(), key=lambda fit: size(fit[1])))


def _error(one: JointVerdict) -> float:
    """Return the error on the unseen logs, or of a joint that they do not test on the
    fitted ones [deg].
    """
    error = one.unseen_deg if one.unseen_logs else one.fitted_deg
    return np.inf if error is None else error  # it diverged


def _size(one: JointVerdict) -> float:
    """Return the error in parts of the tolerance.

    0 of a joint that no log drives, which has none.
    """
    driven = (
        one.unseen_logs
        or one.fitted_deg is not None
        or one.verdict is not Verdict.UNTESTED
    )
    return _error(one) / one.tolerance_deg if driven else 0.0


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
    of = f"{short_name(name)} is best. " if len(fits) > 1 else ""
    by_word: dict[str, list[str]] = {}
    for one in verdicts:
        by_word.setdefault(one.text, []).append(one.name)
    said = "; ".join(f"{listed(names)}: {word}" for word, names in by_word.items())
    count = max(one.unseen_logs for one in verdicts)
    over = f", over {count} unseen log{'s' if count > 1 else ''}" if count else ""
    return f"{of}{said}{over}. {worst(verdicts)}".strip()


def outside(verdicts: Sequence[JointVerdict]) -> tuple[str, ...]:
    """Say of which joints the prediction bands are too narrow.

    Nothing where all hold their samples.
    """
    # a right model's hold somewhat less than 95 % where the start of a log is off
    missed = [
        f"{part:.0f} % of the {one.name}'s"
        for one in verdicts
        if (part := one.inside_percent) is not None and part < 80
    ]
    return (
        (f"The 95 % bands hold only {listed(missed)} unseen samples.",)
        if missed
        else ()
    )


def worst(verdicts: Sequence[JointVerdict]) -> str:
    """Say which of several joints errs most, in parts of its tolerance; nothing of one
    joint."""
    if len(verdicts) < 2:
        return ""
    one = max(verdicts, key=_size)
    if not np.isfinite(_error(one)):
        return f"Worst: {one.name}, whose simulation diverges."
    scale = one.shown.of_degrees(1.0)
    unit = one.shown.unit
    good = (
        f"{two_digits(scale * one.tolerance_deg)} {unit} (by default 2 % of its travel)"
    )
    # a joint without simple models has no logs either, and nothing beside it
    error, least = told_apart(
        scale * _error(one), scale * min(one.baselines_deg.values(), default=0.0)
    )
    return (
        f"Worst: {one.name}, {error} {unit}; good is up to {good}, and simple models err by {least} {unit} "
        "or more."
    )


def next_step(
    summary: FitSummary,
    verdicts: Sequence[JointVerdict],
    folder: str,
    fitted: Sequence[Prediction],
) -> Finding:
    """Return what to do after a fit in a run folder, which made `fitted` of its logs,
    with the command."""
    run = shlex.quote(folder)
    files = shlex.join(dict.fromkeys(str(log_file(one.log.source)) for one in fitted))
    joints = [one.name for one in verdicts if one.verdict is Verdict.UNTESTED]
    if summary.ending == Ending.TIME.value:
        kind = "go on"
        command = f"hydroid fit-{summary.stage} {files} --config {run}/config.yaml --out {run} --resume"
    elif summary.stage == "mech":
        kind = "fit the hydraulics"
        command = f"hydroid fit-hyd {files} --mech {run}"
    elif joints:
        kind = "predict unseen"
        command = f"hydroid validate OTHER.csv --fit {run}"
    elif all(one.verdict is Verdict.PREDICTS for one in verdicts):
        kind = "use the machine"
        command = f"hydroid simulate COMMANDS.csv --fit {run}"
    elif joints := [one.name for one in verdicts if _worse_than_expected(one)]:
        kind = "machine changed"
        command = f"hydroid adapt UNSEEN.csv --fit {run}"
    elif joints := _too_short(verdicts):
        kind = "test longer"
        command = f"hydroid validate OTHER.csv --fit {run}"
    else:
        kind = "look for terms"
        command = f"hydroid suggest --fit {run}"
    return Finding(kind, "note", tuple(joints), {"command": command})


def _worse_than_expected(one: JointVerdict) -> bool:
    """Return whether a fit fails unseen logs by more than its fitted logs let
    expect."""
    if (
        one.verdict is Verdict.PREDICTS
        or one.unseen_deg is None
        or not one.expected_deg
    ):
        return False
    return one.unseen_deg > WORSE * one.expected_deg


def _too_short(verdicts: Sequence[JointVerdict]) -> list[str]:
    """Return the joints whose unseen logs are too short to tell.

    None where any joint is known to fail.
    """
    if any(one.verdict.fails for one in verdicts):
        return []
    untold = [one for one in verdicts if one.verdict is Verdict.UNTOLD]
    return [
        one.name
        for one in untold
        if min((at.blocks for at in one.compared.get(one.beside or "", ())), default=0)
        < LEAST_BLOCKS
    ]
