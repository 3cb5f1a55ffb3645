"""The verdict on fits as a terminal and a page show it: one row a joint, beside the baselines."""

from collections.abc import Mapping, Sequence

import numpy as np

from hydroid.estimate import JointVerdict
from hydroid.fitting.baselines import NAMES
from hydroid.fitting.validation import HORIZONS
from hydroid.reporting.page import Section, short_name
from hydroid.reporting.table import Cell, Given, Table
from hydroid.words import listed

_SIGNS = {"predicts": "✓", "predicts roughly": "!", "not tested": "?"}
"""of verdicts; all others are a ✗"""
_NOTE = (
    "rms errors in deg over the logs that drive the joint. The last three columns are simple models, fitted "
    "to the same logs: no motion; mean speeds by command; dead band, exponent, speed and lag."
)

Verdicts = Mapping[str, Sequence[JointVerdict]]
"""by fit"""


def verdict_table(fits: Verdicts) -> Table:
    """Return the verdicts on each joint of each fit."""
    columns = {name: name for name in ("fit", "joint", "verdict", "fitted", "unseen", *NAMES)}
    rows: list[dict[str, Cell]] = []
    for fit, verdicts in fits.items():
        for one in verdicts:
            errors = {"fitted": one.fitted_deg, "unseen": one.unseen_deg} | one.baselines_deg
            row = {name: _shown(error, one.slides) for name, error in errors.items()}
            verdict = f"{_SIGNS.get(one.verdict, '✗')} {one.verdict}"
            rows.append(row | {"fit": short_name(fit), "joint": one.name, "verdict": verdict})
    if len(fits) == 1:
        del columns["fit"]
    return Table.of("Verdict", columns, rows, _NOTE, NAMES[:2])


def _shown(error: float | None, slides: bool) -> Cell:
    if error is None:
        return None
    return f"{1e3 * np.radians(error):.2g} mm" if slides else Given(f"{error:.2g}")


def verdict_section(fits: Verdicts) -> Section:
    """Return the section that every page of predictions begins with."""
    return Section("Verdict", tables={"verdict": verdict_table(fits)})


def horizon_section(fits: Verdicts) -> tuple[Section, ...]:
    """Return the rms error of each angle's change over some times, of fits and baselines, if known."""
    rows = [
        {"joint": one.name, "of": short_name(fit) if name == "the fit" else name}
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
    table = Table.of("Error of the motion ahead", columns, rows, note)
    return (Section(table.title, tables={"horizons": table}, folded=True),) if rows else ()


def ordered(fits: Verdicts) -> Verdicts:
    """Return the fits, the smallest errors first: in parts of the tolerances of the joints."""

    def size(one: JointVerdict) -> float:
        error = one.fitted_deg if one.unseen_deg is None else one.unseen_deg
        return np.inf if error is None else error / one.tolerance_deg

    return {name: fits[name] for name in sorted(fits, key=lambda name: sum(map(size, fits[name])))}


def lead(fits: Verdicts) -> str:
    """Say of the first of the fits which joints it predicts, and what is wrong with the others."""
    name, verdicts = next(iter(fits.items()))
    of = f"{short_name(name)} is best. " if len(fits) > 1 else ""
    by_word: dict[str, list[str]] = {}
    for one in verdicts:
        by_word.setdefault(one.verdict, []).append(one.name)
    return of + "; ".join(f"{listed(names)}: {word}" for word, names in by_word.items()) + "."
