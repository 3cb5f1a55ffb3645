"""`docs/reproduction.md`: the article's tables and figures made anew, from results that are committed.

    python benchmarks/article/page.py

docs/reproduction/ has one CSV of all runs for each study, the figures that are the article's, about.json, and
note.txt, written by hand, on how the runs were made. choices.md beside this file ends the page.
"""

import csv
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from claims import Outcome, Verdict, verdicts
from measures import UNITS
from studies import FOLDER, ArticleStudy, Table, load_studies, order

from hydroid.settings.study import cell_settings
from hydroid.studies.study import Row

DOCS = FOLDER.parents[1] / "docs"
QUICK = "The short form: few seeds, short data, few generations. It shows that the studies run, nothing else."
SPREAD = "Ours: median of the seeds [lowest, highest]."
HEAD = """# The article, put to the test

`make article` makes every table and figure of the article's evaluation anew (Montazeri, West, Monk
and Taylor, 2017: [the two stages](two_stages.md) cites it): ten runs with different random numbers where the
article shows one. No machine was measured: the data of tables 1 to 7 are simulated at the article's true
parameters with our geometry, and those of tables 8 and 9 are a virtual rig's. So the numbers cannot be the
article's; its conclusions can be tested. What the article leaves open, and what was chosen, stands at the
end. `python benchmarks/article/page.py` writes this page from the results in `docs/reproduction/`.
"""
MEANING = """
*Confirmed* and *contradicted*: the difference is significant, in the stated direction or against it
(Wilcoxon's signed-rank test over pairs of runs with the same seed, two-sided, p < 0.05 after Holm's
correction over the claims of one study). *Not confirmed*: the runs do not tell. The effect is 1 if the claim
holds on every seed and -1 if its opposite does. [Below](#measures-and-verdicts) every measure is defined,
and how statements on figures are judged.
"""
SHORT = 20
"""letters of a name that a narrow column can hold on one line"""


@dataclass(frozen=True)
class Evaluated:
    """One study: its runs, the verdicts on its claims, and those on its figures."""

    name: str
    study: ArticleStudy
    rows: tuple[Row, ...]
    claimed: tuple[Verdict, ...]
    judged: tuple[Verdict, ...]


def page(results: Path) -> str:
    """Return the page of the results in a folder."""
    about = json.loads((results / "about.json").read_text(encoding="utf-8"))
    made = [evaluated(name, study, about, results) for name, study in load_studies().items()]
    parts = [HEAD, f"\n> **{QUICK}**\n" if about["quick"] else "", overview(made)]
    parts += [provenance(made, about, results), *(section(each, about, results) for each in made)]
    parts += ["\n", (FOLDER / "choices.md").read_text(encoding="utf-8")]
    return "".join(parts)


def evaluated(name: str, study: ArticleStudy, about: dict[str, Any], results: Path) -> Evaluated:
    """Read the runs of a study and test its claims."""
    rows = read_rows(results / f"{name}_runs.csv") if study.seeds else []
    judged = [Verdict(**v | {"outcome": Outcome(v["outcome"])}) for v in about["findings"][name]]
    return Evaluated(name, study, tuple(rows), tuple(verdicts(study.claims, rows)), tuple(judged))


def overview(made: Sequence[Evaluated]) -> str:
    """Return what was found of each item and of each claim."""
    items = sorted({item for each in made for item in each.study.items}, key=order)
    claimed = sorted((v for each in made for v in each.claimed), key=lambda v: order(v.item))
    judged = sorted((v for each in made for v in each.judged), key=lambda v: order(v.item))
    theirs, ours = ([v for v in claimed if v.ours == mine] for mine in (False, True))

    def links(item: str) -> str:
        titles = (e.study.title for e in made if item in e.study.items)
        return ", ".join(f"[{title}](#{anchor(title)})" for title in titles)

    found = [(whole(i), tally(v for v in (*theirs, *judged) if v.item == i), links(i)) for i in items]
    shown = [(whole(v.item), v.says, whole(v.outcome.value), v.detail) for v in judged]
    return "".join(
        [
            "\n## In short\n",
            f"\n- {len(theirs)} conclusions of the article, tested over the seeds: {tally(theirs)}.",
            f"\n- {len(judged)} statements on its figures, judged without a test: {tally(judged)}.",
            f"\n- {len(ours)} claims of ours, on other searches and another measure: {tally(ours)}.\n",
            MEANING,
            table("", ("item", "verdicts on what the article says", "made in"), found),
            claims("What the article concludes", theirs),
            table("What its figures show", ("item", "statement", "verdict", "what that rests on"), shown),
            claims("Claims of ours", ours),
        ]
    )


def tally(verdicts: Iterable[Verdict]) -> str:
    """Return how many verdicts there are of each kind, in words."""
    counts = Counter(verdict.outcome for verdict in verdicts)
    return ", ".join(f"{counts[outcome]} {outcome.value}" for outcome in Outcome if counts[outcome])


def claims(title: str, found: Iterable[Verdict]) -> str:
    """Return verdicts with their tests as a table; without a test there are no numbers."""
    rows = [
        (
            *(whole(v.item), v.says, whole(v.outcome.value)),
            *((f"{v.p:.2g}", f"{v.effect:+.2g}") if np.isfinite(v.p) else ("", "")),
        )
        for v in found
    ]
    return table(title, ("item", "claim", "verdict", "p", "effect"), rows)


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]], note: str = "") -> str:
    """Return a table in Markdown."""
    above = f"\n**{title}**\n\n" if title else "\n"
    lines = [header, ["---"] * len(header), *rows]
    text = "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |\n" for row in lines)
    return above + text + (f"\n{note}\n" if note else "")


def anchor(title: str) -> str:
    """Return the address of a heading within the page."""
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c == "-")


def whole(text: str) -> str:
    """Return a text that no line ends within."""
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def provenance(made: Sequence[Evaluated], about: dict[str, Any], results: Path) -> str:
    """Return with what the runs were made, and how long it took."""
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    code = ", ".join(f"{count} by {name}" for name, count in about["code"].items())
    seeds = max(row.seed for each in made for row in each.rows)
    lines = [
        "\n## How the runs were made\n",
        f"\n- {about['runs']} runs over {seeds} seeds; studies share the runs that they have in common.",
        f"\n- Machine: {about['machine']}; {versions}.",
        f"\n- Code of hydroid, as each run recorded it: {code}.",
        f"\n- Time: {about['seconds'] / 60:,.0f} minutes of one core, each run counted with the median time",
        "\n  of its cell; two cores take half of it. The clock also counts what else the machine did.\n",
    ]
    note = results / "note.txt"
    return "".join(lines) + (f"\n{note.read_text(encoding='utf-8').strip()}\n" if note.is_file() else "")


def section(each: Evaluated, about: dict[str, Any], results: Path) -> str:
    """Return the part of one study."""
    study, rows = each.study, each.rows
    items, settings = ", ".join(study.items).capitalize(), f"../benchmarks/article/{each.name}.yaml"
    lines = [
        f"\n## {study.title}\n\n{items} ([settings]({settings})). {study.about.strip()}\n",
        "".join(f"\n- {name}: {text}" for name, text in about["facts"][each.name].items() if name != "cells"),
    ]
    if rows:
        failed = sum(bool(row.failed) for row in rows)
        seconds = np.median([row.values["seconds"] for row in rows if not row.failed])
        lines.append(f"\n- runs: {len(rows)}, {failed} failed; median {seconds:.0f} s")
    lines.append("\n")
    for heading, ours in (("Claims", False), ("Further claims, not the article's", True)):
        if sentences := [v.sentence for v in (*each.claimed, *each.judged) if v.ours == ours]:
            lines += [f"\n{heading}:\n", *(f"\n- {sentence}" for sentence in sentences), "\n"]
    if rows:
        cells = cell_settings(study, FOLDER / each.name)
        units = {f"value {n}": p.unit for n, p in next(iter(cells.values())).parameters.items()}
        units |= UNITS | {f"check {name}": "deg" for name in study.checks}
        lines += [study_table(one, rows, list(cells), units) for one in study.tables]
    for figure in study.figures:
        (file,) = results.glob(f"{figure.item.replace(' ', '_')}.*")
        lines.append(f"\n![{figure.title}](reproduction/{file.name})\n")
    return "".join(lines)


def study_table(shown: Table, rows: Sequence[Row], cells: Sequence[str], units: dict[str, str]) -> str:
    """Return a table with median and spread of each cell, and the article's values below it."""
    lines: list[list[str]] = []
    for cell in shown.cells or cells:
        mine = [row for row in rows if row.cell == cell]
        good = [row for row in mine if not row.failed]
        count = f"{len(good)}" if len(good) == len(mine) else f"{len(good)} of {len(mine)}"
        name = whole(cell) if len(cell) < SHORT else cell
        lines.append([name, "ours", count, *(spread([row.values[c] for row in good]) for c in shown.columns)])
        if cell in shown.article:
            lines.append([name, "article", "", *("" if v is None else f"{v:g}" for v in shown.article[cell])])
    named = (f"{c} [{units[c]}]" if units.get(c) else c for c in shown.columns)
    return table(shown.title, ("cell", "from", "runs", *named), lines, f"{SPREAD} {shown.note}".strip())


def spread(values: Sequence[float]) -> str:
    """Return median, lowest and highest of some values, with three digits or all before the point."""
    known = np.array(values, dtype=float)
    known = known[np.isfinite(known)]
    if not known.size:
        return ""
    three = (np.median(known), known.min(), known.max())
    middle, low, high = (f"{v:.0f}" if abs(v) >= 100 else f"{v:.3g}" for v in three)
    return f"{middle} [{low}, {high}]" if known.size > 1 else middle


def read_rows(file: Path) -> list[Row]:
    """Read the runs of a study."""
    with file.open(newline="", encoding="utf-8") as text:
        rows = [
            (line.pop("cell"), int(line.pop("seed")), line.pop("failed"), line)
            for line in csv.DictReader(text)
        ]
    numbers = [
        {name: float(v or "nan") for name, v in line.items() if not failed} for *_, failed, line in rows
    ]
    return [Row(cell, seed, n, failed) for (cell, seed, failed, _), n in zip(rows, numbers, strict=True)]


if __name__ == "__main__":
    (DOCS / "reproduction.md").write_text(page(DOCS / "reproduction"), encoding="utf-8")
