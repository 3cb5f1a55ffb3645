"""The verdict on fits as a terminal and a page show it: one row a joint, beside the baselines."""

import shlex
from collections.abc import Mapping, Sequence

import numpy as np

from hydroid.estimate import FitSummary, JointVerdict
from hydroid.files import Plain
from hydroid.findings import Finding
from hydroid.fitting.baselines import NAMES
from hydroid.fitting.validation import HORIZONS, Prediction
from hydroid.fitting.verdict import WORSE
from hydroid.reporting.page import Cell, Given, Section, Table, short_name, shown
from hydroid.search.descent import Ending
from hydroid.settings.arm import Arm
from hydroid.settings.log import log_file
from hydroid.words import listed, two_digits

_SIGNS = {"predicts": "✓", "predicts roughly": "!", "not tested": "?"}  # of verdicts; all others are a ✗
_NOTE = "rms errors in deg (unseen logs: {count}). Last three columns: simple models on the {logs} logs."
_RIVALS = (
    "Beside the fit stand simple models: no motion, mean speeds by command, and nine numbers (dead band, "
    "exponent, speed, lag)."
)

_LEFT_OUT = "By joint: the rms error [deg] on parts of the logs, each predicted by a fit without it."

Verdicts = Mapping[str, Sequence[JointVerdict]]  # by fit


def verdict_table(fits: Verdicts) -> Table:
    """Return the verdicts on each joint of each fit."""
    columns = {name: name for name in ("fit", "joint", "verdict", "fitted", "unseen", *NAMES)}
    rows: list[dict[str, Cell]] = []
    for fit, verdicts in fits.items():
        for one in verdicts:
            errors = {"fitted": one.fitted_deg, "unseen": one.unseen_deg} | one.baselines_deg
            row = {name: _shown(error, one.slides) for name, error in errors.items()}
            row["unseen"] = row["unseen"] or ("diverged" if one.unseen_logs else np.nan)
            verdict = f"{_SIGNS.get(one.verdict, '✗')} {one.verdict}"
            rows.append(row | {"fit": short_name(fit), "joint": one.name, "verdict": verdict})
    if len(fits) == 1:
        del columns["fit"]
    count = max(one.unseen_logs for verdicts in fits.values() for one in verdicts)
    note = _NOTE.format(count=count, logs="unseen" if count else "fitted")
    return Table.of("", columns, rows, note, NAMES[:2])


def _shown(error: float | None, slides: bool) -> Cell:
    if error is None:
        return None
    return f"{two_digits(1e3 * np.radians(error))} mm" if slides else Given(two_digits(error))


def left_out_table(
    title: str, columns: dict[str, str], rows: Sequence[Plain], arm: Arm, note: str = ""
) -> Table:
    """Return a table of rows by key, with a further column for each joint of their `left_out_deg`."""
    joints = {name: name for row in rows for name in row.get("left_out_deg", ())}
    slides = {arm.joint_names[joint - 1] for joint in arm.slides}
    cells = [
        row | {n: _shown(e, n in slides) for n, e in row.get("left_out_deg", {}).items()} for row in rows
    ]
    return Table.of(title, columns | joints, cells, note + _LEFT_OUT)


def verdict_sections(fits: Verdicts, *steps: Finding) -> tuple[Section, ...]:
    """Return the sections that every page of predictions begins with: the verdicts, and what to do next."""
    verdict = Section("Verdict", _RIVALS, tables={"verdict": verdict_table(fits)})
    return (verdict, Section("Next", steps=steps)) if steps else (verdict,)


def horizon_section(fits: Verdicts) -> Section | None:
    """Return the rms error of each angle's change over some times, of fits and baselines, if known."""
    rows = [
        {"joint": one.name, "of": short_name(fit) if name == "the fit" and len(fits) > 1 else name}
        | {str(ahead): _shown(e, one.slides) for ahead, e in zip(HORIZONS, errors, strict=True)}
        for fit, verdicts in fits.items()
        for one in verdicts
        for name, errors in one.horizons_deg.items()
    ]
    columns = {"joint": "joint", "of": "of"} | {str(seconds): f"{seconds:g} s" for seconds in HORIZONS}
    note = (
        "rms error [deg] of how far the angle turns in this time, from starts every 2 s of the unseen logs. "
        "Each is simulated from 2 s before, at the measured angles."
    )
    table = Table.of("Error by prediction time", columns, rows, note)
    return Section(table.title, tables={"horizons": table}, folded=True) if rows else None


def ordered(fits: Verdicts) -> Verdicts:
    """Return the fits, the smallest errors first: in parts of the tolerances of the joints."""
    return dict(sorted(fits.items(), key=lambda fit: sum(map(_size, fit[1]))))


def _error(one: JointVerdict) -> float:
    """Return the error on the unseen logs, or of a joint that they do not test on the fitted ones [deg]."""
    error = one.unseen_deg if one.unseen_logs else one.fitted_deg
    return np.inf if error is None else error  # it diverged


def _size(one: JointVerdict) -> float:
    return _error(one) / one.tolerance_deg


def verdict_lines(fits: Verdicts) -> list[Table | str]:
    """Return the verdicts as a terminal shows them: the table, and what is worst about the first fit."""
    first = next(iter(fits.values()))
    return [verdict_table(fits), *filter(None, [worst(first)]), *outside(first)]


def next_lines(step: Finding) -> tuple[str, str]:
    """Return what to do next as a terminal shows it."""
    return f"Next: {step}", f"  {step.numbers['command']}"


def lead(fits: Verdicts) -> str:
    """Say of the first of the fits which joints it predicts, what is wrong with the others, and the worst."""
    name, verdicts = next(iter(fits.items()))
    of = f"{short_name(name)} is best. " if len(fits) > 1 else ""
    by_word: dict[str, list[str]] = {}
    for one in verdicts:
        by_word.setdefault(one.verdict, []).append(one.name)
    said = "; ".join(f"{listed(names)}: {word}" for word, names in by_word.items())
    count = max(one.unseen_logs for one in verdicts)
    over = f", over {count} unseen log{'s' if count > 1 else ''}" if count else ""
    return f"{of}{said}{over}. {worst(verdicts)}".strip()


def outside(verdicts: Sequence[JointVerdict]) -> tuple[str, ...]:
    """Say of which joints the prediction bands are too narrow; nothing where all hold their samples."""
    # a right model's hold somewhat less than 95 % where the start of a log is off
    missed = [
        f"{part:.0f} % of the {one.name}'s"
        for one in verdicts
        if (part := one.inside_percent) is not None and part < 80
    ]
    return (f"The 95 % bands hold only {listed(missed)} unseen samples.",) if missed else ()


def worst(verdicts: Sequence[JointVerdict]) -> str:
    """Say which of several joints errs most, in parts of its tolerance; nothing of one joint."""
    if len(verdicts) < 2:
        return ""
    one = max(verdicts, key=_size)
    if not np.isfinite(_error(one)):
        return f"Worst: {one.name}, whose simulation diverges."
    errors = _error(one), one.tolerance_deg, min(one.baselines_deg.values(), default=np.nan)
    error, good, simple = (f"{shown(_shown(e, one.slides))}{'' if one.slides else ' deg'}" for e in errors)
    bar = f"good is up to {good} (by default 2 % of its travel)"
    return f"Worst: {one.name}, {error}; {bar}, and simple models err by {simple} or more."


def next_step(
    summary: FitSummary, verdicts: Sequence[JointVerdict], folder: str, fitted: Sequence[Prediction]
) -> Finding:
    """Return what to do after a fit in a run folder, which made `fitted` of its logs, with the command."""
    run = shlex.quote(folder)
    files = shlex.join(dict.fromkeys(str(log_file(one.log.source)) for one in fitted))
    joints = [one.name for one in verdicts if one.verdict == "not tested"]
    if summary.ending == Ending.TIME.value:
        command = f"hydroid fit-{summary.stage} {files} --config {run}/config.yaml --out {run} --resume"
        kind = "go on"
    elif summary.stage == "mech":
        kind, command = "fit the hydraulics", f"hydroid fit-hyd {files} --mech {run}"
    elif joints:
        kind, command = "predict unseen", f"hydroid validate OTHER.csv --fit {run}"
    elif all(one.verdict == "predicts" for one in verdicts):
        kind, command = "use the machine", f"hydroid simulate COMMANDS.csv --fit {run}"
    elif joints := [
        one.name
        for one in verdicts
        if one.verdict != "predicts" and (one.unseen_deg or 0.0) > WORSE * (one.expected_deg or np.inf)
    ]:
        kind, command = "machine changed", f"hydroid adapt UNSEEN.csv --fit {run}"
    else:
        kind, command = "look for terms", f"hydroid suggest --fit {run}"
    return Finding(kind, "note", tuple(joints), {"command": command})
