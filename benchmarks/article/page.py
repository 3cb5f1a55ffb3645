"""`docs/reproduction.md`: the article's tables and figures made anew, from results that
are committed.

    python benchmarks/article/page.py

docs/reproduction/ has one CSV of all runs for each study, and the figures; page.md here
has the words.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from claims import MOST, POWER, Outcome, Verdict, log_ratios, verdict, verdicts
from common import ROOT
from studies import (
    BLIND,
    CENTRE,
    RECORDS,
    Claim,
    Runs,
    Table,
    load_studies,
    of_cell,
    read_runs,
)

from hydroid.words import two_digits

DOCS = ROOT / "docs"
QUICK = "> **The short form: one seed, short data, few generations. It shows that the studies run.**\n\n"
FEW = 5
"""runs below which a median of some of a cell's runs says little"""
KINDS: dict[str, str] = {"parameter": "parameters", "mass": "parameters"}
KINDS |= {
    "slope": "sensitivity",
    "D": "sensitivity",
    "": "fit, convergence, validation",
}
"""what a claim is about, by the first word of its measure"""
NO_HALVING = "no halving"
SHOWN: tuple[str, ...] = (
    Outcome.HOLDS,
    Outcome.OPPOSITE,
    Outcome.EXCLUDED,
    NO_HALVING,
    Outcome.UNDECIDED,
)
KNOWN = Claim(
    says="",
    item="",
    lower="multi-objective",
    than="simple GA",
    column="identifiable error",
)
"""what the head says of the wide box besides the article's claim"""


def page(results: Path, *, quick: bool = False) -> str:
    studies, text = (
        load_studies(),
        Path(__file__).with_name("page.md").read_text(encoding="utf-8"),
    )
    runs = {name: read_runs(results / f"{name}_runs.csv") for name in studies}
    made = {
        name: verdicts(study.claims, runs[name], study.tables)
        for name, study in studies.items()
    }
    numbers = head(
        runs, made, {name: study.same_record for name, study in studies.items()}
    )
    numbers["studies"] = ""
    for name, study in studies.items():
        link, cells = (
            f"[Settings](../benchmarks/article/{name}.yaml)",
            [*study.changes()],
        )
        numbers["studies"] += f"\n## {study.title}\n\n{study.about.strip()} {link}.\n"
        numbers["studies"] += "".join(
            study_table(each, runs[name], cells) for each in study.tables
        )
        for figure in study.figures:
            numbers["studies"] += (
                f"\n![{figure.title.partition(':')[0]}](reproduction/{figure.file})\n"
            )
    for word, ours in (("theirs", False), ("ours", True)):
        numbers[word] = claims_table(
            v for each in made.values() for v in each if v.claim.ours is ours
        )
    return QUICK * quick + text.format(enough=percent(POWER), **numbers)


class Medians:
    """What page.md says of a study: the median of a measure over a cell's runs, by
    `cell / measure`."""

    def __init__(self, runs: Runs) -> None:
        self.runs = runs

    def __getitem__(self, place: str) -> str:
        cell, _, column = place.partition(" / ")
        values = of_cell(self.runs, cell, column).values()
        if not values:
            return "(no runs)"
        return (
            f"{median(values):,.0f}"
            if column == "simulations"
            else two_digits(median(values))
        )


def head(
    runs: Mapping[str, Runs],
    made: Mapping[str, Sequence[Verdict]],
    shared: Mapping[str, int],
) -> dict[str, Any]:
    """Return what page.md needs besides; `shared`: seeds up to this one share a record,
    by study."""
    says = "ulti-objective GA: lower parameter error than simple GA"
    narrow, wide = (
        next(v for v in made[n] if says in v.claim.says) for n in ("mechanical", "wide")
    )
    known = {
        n: verdict(KNOWN, log_ratios(KNOWN, runs[n]), 0.05, None)
        for n in ("mechanical", "wide")
    }
    cells = (
        of_cell(runs["hydraulic"], cell, "simulations")
        for cell in ("multi-start", "multi-objective")
    )
    least, multi = (median(each.values() or [np.nan]) for each in cells)
    searches = [
        (n, r)
        for n in ("mechanical", "hydraulic")
        for r in runs[n]
        if "generations" in r
    ]
    return {
        **{f"{name}_median": Medians(made) for name, made in runs.items()},
        "narrow": interval(narrow),
        "narrow_gain": gain(narrow),
        "wide": interval(wide),
        "wide_gain": gain(wide),
        "narrow_known": interval(known["mechanical"]),
        "wide_known": interval(known["wide"]),
        # with a record of their own
        "own": sum(run["seed"] > shared[name] for name, run in searches),
        "searches": len(searches),
        "count": sum(not v.claim.ours for each in made.values() for v in each),
        "tally": tally(made),
        "dearer": percent(least / multi - 1),
    }


def tally(made: Mapping[str, Sequence[Verdict]]) -> str:
    """Return how many of the article's claims of each kind have each verdict."""
    counts = {
        kind: dict[str, int].fromkeys(("claims", *SHOWN), 0) for kind in KINDS.values()
    }
    for one in (v for each in made.values() for v in each if not v.claim.ours):
        kind = KINDS.get(one.claim.column.split()[0], KINDS[""])
        counts[kind]["claims"] += 1
        counts[kind][called(one)] += 1
    rows = [(kind, *map(str, found.values())) for kind, found in counts.items()]
    return table("", ("about", "claims", *SHOWN), rows)


def called(made: Verdict) -> str:
    """Return a verdict as a page has it: where the article prints no such effect, a
    halving is excluded."""
    stated = made.printed is not None and made.printed < made.claim.below
    return (
        made.outcome if stated or made.outcome is not Outcome.EXCLUDED else NO_HALVING
    )


def gain(made: Verdict) -> str:
    """Return by how much the first measure can be lower than the second at best, within
    the interval."""
    return percent(
        max(0.0, 1 - made.interval[0]) if np.isfinite(made.interval[1]) else np.nan
    )


def percent(part: float) -> str:
    return "(no runs)" if np.isnan(part) else f"{100 * part:.0f} %"


def interval(made: Verdict) -> str:
    if not np.isfinite(made.interval[1]):
        return "too few runs"
    return f"{made.ratio:.2g} [{made.interval[0]:.2g}, {made.interval[1]:.2g}]"


def claims_table(made: Iterable[Verdict]) -> str:
    """Return the table of verdicts; an item stands at its first claim."""
    lines, item = list[tuple[str, ...]](), ""
    for v in made:
        printed = "" if v.printed is None else f"{v.printed:.2g}"
        open_still = v.outcome is Outcome.UNDECIDED and 2 < v.seeds < v.enough
        more = f"/{v.enough if v.enough <= MOST else f'{MOST}+'}" if open_still else ""
        numbers = (
            interval(v),
            printed,
            f"{v.power:.2f}",
            called(v),
            f"{v.seeds}{more}",
        )
        lines.append(
            ("" if v.claim.item == item else v.claim.item, v.claim.says, *numbers)
        )
        item = v.claim.item
    return table(
        "", ("item", "claim", "ratio", "article's", "power", "verdict", "seeds"), lines
    )


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    above = f"\n**{title}**\n\n" if title else "\n"
    text = "".join(
        f"| {' | '.join(row)} |\n" for row in (header, ["---"] * len(header), *rows)
    )
    return above + text


def study_table(shown: Table, runs: Runs, cells: Sequence[str]) -> str:
    """Return a table with the median of each cell, and the article's values.

    A measure that fewer than FEW of a cell's runs have, and others lack, is blank.
    """
    lines: list[list[str]] = []
    without_search = () if shown.cells == (RECORDS,) else (BLIND, CENTRE)
    for cell in dict.fromkeys(
        (*(shown.cells or cells), *shown.article, *without_search)
    ):
        columns = [of_cell(runs, cell, column).values() for column in shown.columns]
        most = max(map(len, columns))
        texts = [
            two_digits(median(v)) if v and len(v) >= min(FEW, most) else ""
            for v in columns
        ]
        printed = shown.article.get(cell, [None] * len(columns))
        texts = [
            t if v is None else f"{t} ({v:g})".strip()
            for t, v in zip(texts, printed, strict=True)
        ]
        if any(texts):
            lines.append([cell, str(most or ""), *texts])
    return table(shown.title, ("", "runs", *shown.columns), lines)


if __name__ == "__main__":
    (DOCS / "reproduction.md").write_text(page(DOCS / "reproduction"), encoding="utf-8")
