"""`docs/reproduction.md`: the article's tables and figures made anew, from results that are committed.

    python benchmarks/article/page.py

docs/reproduction/ has one CSV of all runs for each study, the figures that are the article's, about.json, and
note.txt, written by hand, on how the runs were made. choices.md beside this file ends the page.
"""

import csv
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from claims import Outcome, Verdict, verdicts
from measures import BLIND, CENTRE, UNITS
from studies import FOLDER, ArticleStudy, Table, load_studies

from hydroid.settings.study import cell_settings
from hydroid.studies import Row

DOCS = FOLDER.parents[1] / "docs"
Rows = Mapping[str, Sequence[Row]]
"""runs by study"""
QUICK = "\n> **The short form: few seeds, short data, few generations. It shows that the studies run.**\n"
HEAD = """# The article, put to the test

The article (Montazeri, West, Monk and Taylor, 2017: [the two stages](two_stages.md) cites it) judges searches
by the sum of the parameters' relative errors. **That sum carries no signal here.** Within 0.25 to 2.5 times
the truth a blind draw has {blind:.2f} (median of {draws}) and the centre of the box {centre:.2f}; the simple
GA ends at {simple:.2f}, the multi-objective one at {multi:.2f}.

Of the article's {count} claims that runs can test: {tally}.

`make article` makes the tables and figures anew: {seeds} runs with different random numbers where the article
shows one. No machine was measured: the data of tables 1 to 7 are simulated at the article's true parameters
with our geometry, those of tables 8 and 9 are a virtual rig's. So the numbers cannot be the article's.
`python benchmarks/article/page.py` writes this page from the results in `docs/reproduction/`.
"""
MEANING = """
The ratio is that of the two measures that a claim compares, over pairs of runs with the same seed: below 1
the claim is right. Its interval is of 95 % for all claims of one item together. *Holds*, *opposite*: the
interval lies on one side of 1. *An effect of the article's size is excluded*: it does not, and the ratio that
the article prints lies outside of it. *Undecided*: more seeds could tell.
"""


def page(results: Path) -> str:
    """Return the page of the results in a folder."""
    about, studies = json.loads((results / "about.json").read_text(encoding="utf-8")), load_studies()
    rows = {name: read_rows(results / f"{name}_runs.csv") for name, study in studies.items() if study.seeds}
    made = [v for n, study in studies.items() for v in verdicts(study.claims, rows.get(n, []), study.tables)]
    parts = [head(rows["mechanical"], made), QUICK if about["quick"] else ""]
    for title, ours in (("What the article claims", False), ("Claims of ours", True)):
        lines = [verdict_row(v) for v in made if v.claim.ours == ours]
        header = ("item", "claim", "measure", "ratio", "article's", "verdict", "seeds")
        parts += [f"\n## {title}\n", "" if ours else MEANING, table("", header, lines)]
    for name, study in studies.items():
        items, settings = ", ".join(study.items).capitalize(), f"../benchmarks/article/{name}.yaml"
        parts.append(f"\n## {study.title}\n\n{items} ([settings]({settings})). {study.about.strip()}\n\n")
        parts += [f"- {what}: {text}\n" for what, text in about["facts"][name].items()]
        parts += results_of(name, study, rows.get(name, []), results)
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    parts.append(f"\n## How the runs were made\n\nMachine: {about['machine']}; {versions}.\n")
    if (note := results / "note.txt").is_file():
        parts.append(f"\n{note.read_text(encoding='utf-8').strip()}\n")
    return "".join((*parts, "\n", (FOLDER / "choices.md").read_text(encoding="utf-8")))


def head(mechanical: Sequence[Row], made: Sequence[Verdict]) -> str:
    """Return the first paragraphs."""
    errors = {cell: of_cell(mechanical, cell, "parameter error") for cell in {r.cell for r in mechanical}}
    middle = {cell: float(np.median(values)) for cell, values in errors.items() if values}
    theirs = [verdict for verdict in made if not verdict.claim.ours]
    counts = Counter(verdict.outcome for verdict in theirs)
    return HEAD.format(
        blind=middle[BLIND],
        draws=len(errors[BLIND]),
        centre=middle[CENTRE],
        simple=middle.get("simple GA", np.nan),
        multi=middle.get("multi-objective, 8 segments", np.nan),
        count=len(theirs),
        tally=", ".join(f"{outcome} {counts[outcome]}" for outcome in Outcome),
        seeds=max(verdict.seeds for verdict in made),
    )


def verdict_row(verdict: Verdict) -> tuple[str, ...]:
    """Return a claim's line of the table."""
    claim, printed = verdict.claim, "" if verdict.printed is None else f"{verdict.printed:.2g}"
    ratio = f"{verdict.ratio:.2g} [{verdict.interval[0]:.2g}, {verdict.interval[1]:.2g}]"
    return (claim.item, claim.says, claim.column, ratio, printed, verdict.outcome, str(verdict.seeds))


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]], note: str = "") -> str:
    """Return a table in Markdown."""
    above = f"\n**{title}**\n\n" if title else "\n"
    lines = [header, ["---"] * len(header), *rows]
    text = "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |\n" for row in lines)
    return above + text + (f"\n{note}\n" if note else "")


def results_of(name: str, study: ArticleStudy, rows: Sequence[Row], results: Path) -> Iterator[str]:
    """Yield the tables and the figures of a study."""
    cells = cell_settings(study, FOLDER / name)
    units = {f"value {n}": p.unit for n, p in next(iter(cells.values())).parameters.items()}
    units |= UNITS | {f"check {check}": "deg" for check in study.checks}
    for shown in study.tables:
        yield study_table(shown, rows, [*cells, BLIND, CENTRE], units)
    for figure in study.figures:
        (file,) = results.glob(f"{figure.item.replace(' ', '_')}.*")
        yield f"\n![{figure.title}](reproduction/{file.name})\n"


def study_table(shown: Table, rows: Sequence[Row], cells: Sequence[str], units: dict[str, str]) -> str:
    """Return a table with median and spread of each cell, and the article's values below it."""
    lines: list[list[str]] = []
    for cell in (*shown.cells, BLIND, CENTRE) if shown.cells else cells:
        columns = [of_cell(rows, cell, column) for column in shown.columns]
        if any(columns):
            lines.append([cell, "ours", str(max(map(len, columns))), *map(spread, columns)])
        if cell in shown.article:
            values = ("" if v is None else f"{v:g}" for v in shown.article[cell])
            lines.append([cell, "article", "", *values])
    named = (f"{c} [{units[c]}]" if units.get(c) else c for c in shown.columns)
    note = f"Ours: median of the seeds [lowest, highest]. {shown.note}".strip()
    return table(shown.title, ("cell", "from", "runs", *named), lines, note)


def of_cell(rows: Sequence[Row], cell: str, column: str) -> list[float]:
    """Return a measure of the runs of a cell that have it."""
    values = [row.values.get(column, np.nan) for row in rows if row.cell == cell and not row.failed]
    return [value for value in values if np.isfinite(value)]


def spread(values: Sequence[float]) -> str:
    """Return median, lowest and highest of some values, with three digits or all before the point."""
    if not values:
        return ""
    three = (float(np.median(values)), min(values), max(values))
    middle, low, high = (f"{v:.0f}" if abs(v) >= 100 else f"{v:.3g}" for v in three)
    return f"{middle} [{low}, {high}]" if len(values) > 1 else middle


def read_rows(file: Path) -> list[Row]:
    """Read the runs of a study."""
    rows: list[Row] = []
    with file.open(newline="", encoding="utf-8") as text:
        for line in csv.DictReader(text):
            cell, seed, failed = line.pop("cell"), int(line.pop("seed")), line.pop("failed")
            rows.append(
                Row(cell, seed, {n: float(v or "nan") for n, v in line.items() if not failed}, failed)
            )
    return rows


if __name__ == "__main__":
    (DOCS / "reproduction.md").write_text(page(DOCS / "reproduction"), encoding="utf-8")
