"""`docs/reproduction.md`: the article's tables and figures made anew, from results that are committed.

    python benchmarks/article/page.py

docs/reproduction/ has one CSV of all runs for each study, the figures that are the article's, about.json, and
note.txt, written by hand, on how the runs were made. choices.md beside this file ends the page.
"""

import csv
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from claims import Outcome, Verdict, verdicts
from measures import UNITS
from studies import FOLDER, ArticleStudy, Table, load_studies

from hydroid.settings.study import cell_settings
from hydroid.studies.study import Row

DOCS = FOLDER.parents[1] / "docs"
QUICK = "\n> **The short form: few seeds, short data, few generations. It shows that the studies run.**\n"
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


def page(results: Path) -> str:
    """Return the page of the results in a folder."""
    about, studies = json.loads((results / "about.json").read_text(encoding="utf-8")), load_studies()
    rows = {name: read_rows(results / f"{name}_runs.csv") for name, study in studies.items() if study.seeds}
    made = {
        name: [
            *verdicts(study.claims, rows.get(name, [])),
            *(Verdict(**v | {"outcome": Outcome(v["outcome"])}) for v in about["findings"][name]),
        ]
        for name, study in studies.items()
    }
    parts = [HEAD, QUICK if about["quick"] else "", overview(made), provenance(about, results)]
    for name, study in studies.items():
        parts += section(name, study, about["facts"][name], made[name])
        parts += results_of(name, study, rows.get(name, []), results)
    return "".join((*parts, "\n", (FOLDER / "choices.md").read_text(encoding="utf-8")))


def overview(made: dict[str, list[Verdict]]) -> str:
    """Return how many statements hold."""
    every = [verdict for some in made.values() for verdict in some]
    theirs, ours = ([v for v in every if v.ours == mine] for mine in (False, True))
    text = f"\n## In short\n\n- {len(theirs)} statements of the article: {tally(theirs)}.\n"
    return (
        text
        + f"- {len(ours)} claims of ours, on other searches and another measure: {tally(ours)}.\n{MEANING}"
    )


def tally(verdicts: Iterable[Verdict]) -> str:
    """Return how many verdicts there are of each kind, in words."""
    counts = Counter(verdict.outcome for verdict in verdicts)
    return ", ".join(f"{counts[outcome]} {outcome}" for outcome in Outcome if counts[outcome])


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]], note: str = "") -> str:
    """Return a table in Markdown."""
    above = f"\n**{title}**\n\n" if title else "\n"
    lines = [header, ["---"] * len(header), *rows]
    text = "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |\n" for row in lines)
    return above + text + (f"\n{note}\n" if note else "")


def provenance(about: dict[str, Any], results: Path) -> str:
    """Return with what the runs were made, and how long it took."""
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    note = results / "note.txt"
    return f"""
## How the runs were made

- {about["runs"]} runs; studies share the runs that they have in common.
- Machine: {about["machine"]}; {versions}.
- Time: {about["seconds"] / 60:,.0f} minutes of one core, each run counted with the median time
  of its cell; two cores take half of it. The clock also counts what else the machine did.
""" + (f"\n{note.read_text(encoding='utf-8').strip()}\n" if note.is_file() else "")


def section(name: str, study: ArticleStudy, facts: dict[str, str], made: list[Verdict]) -> list[str]:
    """Return what a study is, and its verdicts."""
    items, settings = ", ".join(study.items).capitalize(), f"../benchmarks/article/{name}.yaml"
    lines = [f"\n## {study.title}\n\n{items} ([settings]({settings})). {study.about.strip()}\n\n"]
    lines += [f"- {what}: {text}\n" for what, text in facts.items()]
    for title, ours in (("What the article says", False), ("Claims of ours", True)):
        if rows := [(v.item, v.says, v.outcome, v.detail) for v in made if v.ours == ours]:
            lines.append(table(title, ("item", "statement", "verdict", "what that rests on"), rows))
    return lines


def results_of(name: str, study: ArticleStudy, rows: Sequence[Row], results: Path) -> list[str]:
    """Return the tables and the figures of a study."""
    cells = cell_settings(study, FOLDER / name)
    units = {f"value {n}": p.unit for n, p in next(iter(cells.values())).parameters.items()}
    units |= UNITS | {f"check {check}": "deg" for check in study.checks}
    lines = [study_table(one, rows, list(cells), units) for one in study.tables]
    for figure in study.figures:
        (file,) = results.glob(f"{figure.item.replace(' ', '_')}.*")
        lines.append(f"\n![{figure.title}](reproduction/{file.name})\n")
    return lines


def study_table(shown: Table, rows: Sequence[Row], cells: Sequence[str], units: dict[str, str]) -> str:
    """Return a table with median and spread of each cell, and the article's values below it."""
    lines: list[list[str]] = []
    for cell in shown.cells or cells:
        good = [row.values for row in rows if row.cell == cell and not row.failed]
        values = ([row[column] for row in good] for column in shown.columns)
        lines.append([cell, "ours", str(len(good)), *map(spread, values)])
        if cell in shown.article:
            values = ("" if v is None else f"{v:g}" for v in shown.article[cell])
            lines.append([cell, "article", "", *values])
    named = (f"{c} [{units[c]}]" if units.get(c) else c for c in shown.columns)
    return table(shown.title, ("cell", "from", "runs", *named), lines, f"{SPREAD} {shown.note}".strip())


def spread(values: Sequence[float]) -> str:
    """Return median, lowest and highest of some values, with three digits or all before the point."""
    known = np.array(values)[np.isfinite(values)]
    if not known.size:
        return ""
    three = (np.median(known), known.min(), known.max())
    middle, low, high = (f"{v:.0f}" if abs(v) >= 100 else f"{v:.3g}" for v in three)
    return f"{middle} [{low}, {high}]" if known.size > 1 else middle


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
