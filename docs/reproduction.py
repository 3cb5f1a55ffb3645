"""`docs/reproduction.md`: the article's tables and figures made anew, from results that are committed.

    hydroid article --all --out runs/article
    python docs/reproduction.py runs/article

With a folder, its results are first copied to docs/reproduction/: one CSV of all runs for each study, the
figures that are the article's, and about.json. Without one, the page is written from these alone.
docs/reproduction/note.txt is written by hand; the page holds it where it says how the runs were made.
"""

import csv
import json
import shutil
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from hydroid.api.studies import article_items
from hydroid.report.article_report import tally
from hydroid.report.study_report import QUICK, conclusions, study_table
from hydroid.report.table import Cell, Table
from hydroid.settings.study import StudySettings, cell_settings
from hydroid.study.claims import Outcome, Verdict, verdicts
from hydroid.study.measures import Row, measures

HERE = Path(__file__).parent
PAGE, RESULTS, CONFIGS = HERE / "reproduction.md", HERE / "reproduction", HERE.parent / "configs" / "article"
HEAD = """# The article, put to the test

`hydroid article --all` makes every table and figure of the article's evaluation anew (Montazeri, West, Monk
and Taylor, 2017: [the two stages](two_stages.md) cites it): ten runs with different random numbers where the
article shows one. No machine was measured: the data of tables 1 to 7 are simulated at the article's true
parameters with our geometry, and those of tables 8 and 9 are a virtual rig's. So the numbers cannot be the
article's; its conclusions can be tested. What the article leaves open, and what was chosen, stands at the
end. `python docs/reproduction.py` writes this page from the results in `docs/reproduction/`.
"""
MEANING = """
*Confirmed* and *contradicted*: the difference is significant, in the stated direction or against it
(Wilcoxon's signed-rank test over pairs of runs with the same seed, two-sided, p < 0.05 after Holm's
correction over the claims of one study). *Not confirmed*: the runs do not tell. The effect is 1 if the claim
holds on every seed and -1 if its opposite does. [Studies](studies.md) defines every measure, and how
statements on figures are judged.
"""
COLORS = 64
"""of a picture: a third of its bytes, and nobody sees the difference"""
SHORT = 20
"""letters of a name that a narrow column can hold on one line"""
CHOICES = """
## What the article leaves open, and what was chosen

- Number of generations: so many that a search has about 2,800 simulations (stage 2: 1,480).
- Bounds of the parameters: 0.25 to 2.5 times the truth, linear, never centred on it.
- What a mutation rate counts: the probability that one parameter of a child changes. Then one of its 16 bits
  flips, or its integer is redrawn.
- Number of cuts of the pointwise crossover: 2.
- "Proportional" selection with several objectives: NSGA-II's crowded tournament, for there is no one fitness
  to be proportional to.
- Fitness on the simple GA's roulette wheel: the distance to the worst candidate, max(J) - J. The best
  candidate survives.
- Units of output errors: degrees. Table 2's parameter error index is in per cent, table 1's are fractions.
- The norm of the data in equation (19): the mean norm (18), so that (19) has no unit.
- The start: at rest in the first pose, in balance with gravity.
- The data: 75 s of random levels held for 1 to 5 s, without noise. The article shows them in figure 17 only.
- The segments: eight of equal length. The article's segment 6, 43.5 to 52.6 s, shows that its were not.
- Mass of link 5: 4.0 kg (table 6); table 1 prints 4.1.
- Geometry, inertias, hydraulic constants: ours.

What the article prints does not always agree with itself. Table 1 refers to equations (16) and (17) where
(18) and (19) are meant. The rows for 0.8 and 0.4 in table 3 are the same to 0.01. Table 4 has a lower mean
squared error with two segments than with eight; the text says the opposite. Table 7 prints 0.698 as the error
of an estimate that is off by 1.7.
"""


@dataclass(frozen=True)
class Evaluated:
    """One study: its settings and runs, the verdicts on its claims, and those on its figures."""

    name: str
    study: StudySettings
    rows: tuple[Row, ...]
    claimed: tuple[Verdict, ...]
    judged: tuple[Verdict, ...]


def main() -> None:
    """Write the page."""
    if len(sys.argv) > 1:
        collect(Path(sys.argv[1]))
    PAGE.write_text(page(), encoding="utf-8")


def studies() -> dict[str, StudySettings]:
    """Return the studies of the article by name, in the order of its tables and figures."""
    return {name: study for made in article_items().values() for name, study in made.items()}


def collect(out: Path) -> None:
    """Copy the results of `hydroid article --all` to docs/reproduction/."""
    RESULTS.mkdir(exist_ok=True)
    shutil.copyfile(out / "about.json", RESULTS / "about.json")
    for name, study in studies().items():
        if study.seeds:
            shutil.copyfile(out / name / f"{name}_runs.csv", RESULTS / f"{name}_runs.csv")
        for figure in study.figures:
            if figure.item:
                file = picture(figure.item)
                image = Image.open(out / name / "figures" / file).convert("RGB")
                image.quantize(COLORS).save(RESULTS / file, optimize=True)


def picture(item: str) -> str:
    """Return the name of a figure's file."""
    return f"{item.replace(' ', '_')}.png"


def page() -> str:
    """Return the page."""
    about = json.loads((RESULTS / "about.json").read_text(encoding="utf-8"))
    made = [evaluated(name, study, about) for name, study in studies().items()]
    parts = [HEAD, f"\n> **{QUICK}**\n" if about["quick"] else "", overview(made), provenance(made, about)]
    return "".join([*parts, *(section(each, about) for each in made), CHOICES])


def evaluated(name: str, study: StudySettings, about: dict[str, Any]) -> Evaluated:
    """Read the runs of a study and test its claims."""
    rows = read_rows(RESULTS / f"{name}_runs.csv") if study.seeds else []
    judged = [
        Verdict(v["says"], Outcome(v["outcome"]), v["detail"], v["item"]) for v in about["findings"][name]
    ]
    return Evaluated(name, study, tuple(rows), tuple(verdicts(study.claims, rows)), tuple(judged))


def overview(made: Sequence[Evaluated]) -> str:
    """Return what was found of each item and of each claim."""
    order = list(article_items())
    claimed = sorted((v for each in made for v in each.claimed), key=lambda v: order.index(v.item))
    theirs, ours = ([v for v in claimed if v.ours == mine] for mine in (False, True))
    judged = sorted((v for each in made for v in each.judged), key=lambda v: order.index(v.item))
    lines = [
        "\n## In short\n",
        f"\n- {len(theirs)} conclusions of the article, tested over the seeds: {tally(theirs)}.",
        f"\n- {len(judged)} statements on its figures, judged without a test: {tally(judged)}.",
        f"\n- {len(ours)} claims of ours, on other searches and another measure: {tally(ours)}.\n",
        MEANING,
        "\n| item | verdicts on what the article says | made in |\n| --- | --- | --- |\n",
    ]
    for item in order:
        where = ", ".join(
            f"[{e.study.title}](#{anchor(e.study.title)})" for e in made if item in e.study.items
        )
        found = tally(v for v in (*theirs, *judged) if v.item == item)
        lines.append(f"| {whole(item)} | {found} | {where} |\n")
    figures = tuple((whole(v.item), v.says, whole(v.outcome.value), v.detail) for v in judged)
    header = ("item", "statement", "verdict", "what that rests on")
    tables = [
        claims("What the article concludes", theirs),
        Table("What its figures show", header, figures),
        claims("Claims of ours", ours),
    ]
    return "".join([*lines, *(f"\n{table.markdown()}" for table in tables)])


def claims(title: str, found: Iterable[Verdict]) -> Table:
    """Return verdicts with their tests as a table."""
    rows = tuple(
        (whole(v.item), v.says, whole(v.outcome.value), number(v.p), number(v.effect, "+")) for v in found
    )
    return Table(title, ("item", "claim", "verdict", "p", "effect"), rows)


def anchor(title: str) -> str:
    """Return the address of a heading within the page."""
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c == "-")


def whole(text: str) -> str:
    """Return a text that no line ends within."""
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def number(value: float, sign: str = "") -> str:
    """Return a number with two digits, or nothing where there is none."""
    return f"{value:{sign}.2g}" if np.isfinite(value) else ""


def provenance(made: Sequence[Evaluated], about: dict[str, Any]) -> str:
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
    note = RESULTS / "note.txt"
    return "".join(lines) + (f"\n{note.read_text(encoding='utf-8').strip()}\n" if note.is_file() else "")


def section(each: Evaluated, about: dict[str, Any]) -> str:
    """Return the part of one study."""
    study, rows = each.study, each.rows
    items, settings = ", ".join(study.items).capitalize(), f"../configs/article/{each.name}.yaml"
    lines = [
        f"\n## {study.title}\n",
        f"\n{items} ([settings]({settings})). {study.about.strip()}\n",
        "".join(f"\n- {name}: {text}" for name, text in about["facts"][each.name].items() if name != "cells"),
    ]
    if rows:
        failed = sum(bool(row.failed) for row in rows)
        seconds = np.median([row.values["seconds"] for row in rows if not row.failed])
        lines.append(f"\n- runs: {len(rows)}, {failed} failed; median {seconds:.0f} s")
    lines.append("\n")
    for heading, sentences in conclusions([*each.claimed, *each.judged]).items():
        lines += [f"\n{heading}:\n", *(f"\n- {sentence}" for sentence in sentences), "\n"]
    lines += [f"\n{table.markdown()}" for table in tables(each)]
    lines += [
        f"\n![{figure.title}](reproduction/{picture(figure.item)})\n"
        for figure in study.figures
        if figure.item
    ]
    return "".join(lines)


def tables(each: Evaluated) -> list[Table]:
    """Return the study's tables."""
    if not each.rows:
        return []
    cells = cell_settings(each.study, CONFIGS / f"{each.name}.yaml", quick=False)
    parameters = next(iter(cells.values())).parameters
    units = measures(each.study, ["any"], list(parameters))
    units |= {f"value {name}": p.unit for name, p in parameters.items()}
    made = [study_table(table, each.rows, list(cells), units) for table in each.study.tables]
    return [replace(table, rows=tuple((short(row[0]), *row[1:]) for row in table.rows)) for table in made]


def short(cell: Cell) -> Cell:
    """Return the name of a cell; a short one stays on one line."""
    return whole(cell) if isinstance(cell, str) and len(cell) < SHORT else cell


def read_rows(file: Path) -> list[Row]:
    """Read the runs of a study."""
    with file.open(newline="", encoding="utf-8") as text:
        return [row(line) for line in csv.DictReader(text)]


def row(line: dict[str, str]) -> Row:
    """Return a run from a line of the CSV."""
    cell, seed, failed = line.pop("cell"), int(line.pop("seed")), line.pop("failed")
    values = {} if failed else {name: float(v) if v else float("nan") for name, v in line.items()}
    return Row(cell, seed, values, failed)


if __name__ == "__main__":
    main()
