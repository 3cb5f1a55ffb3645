"""`docs/reproduction.md`: the article's tables and figures made anew, from results that are committed.

    python benchmarks/article/page.py

docs/reproduction/ has one CSV of all runs for each study, and the figures; page.md here has the words.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median

import numpy as np
from claims import ASSUMED, MOST, POWER, Outcome, Verdict, verdicts
from studies import BLIND, CENTRE, FOLDER, RECORDS, Runs, Table, load_studies, of_cell, read_runs

DOCS = FOLDER.parents[1] / "docs"
QUICK = "> **The short form: one seed, short data, few generations. It shows that the studies run.**\n\n"
WORDS = {o: str(o) for o in Outcome} | {Outcome.EXCLUDED: "an effect of that size is excluded"}
TALLY = {
    Outcome.HOLDS: "**{} hold**: {}",
    Outcome.OPPOSITE: "**in {} the opposite holds**: {}",
    Outcome.EXCLUDED: "**in {} an effect of the article's size is excluded** (without one, a halving): {}",
    Outcome.UNDECIDED: "**{} are undecided**: the seeds are too few so far",
}


def page(results: Path, *, quick: bool = False) -> str:
    """Return the page of the results in a folder."""
    studies = load_studies()
    runs = {name: read_runs(results / f"{name}_runs.csv") for name in studies}
    made = {name: verdicts(study.claims, runs[name], study.tables) for name, study in studies.items()}
    every = [verdict for each in made.values() for verdict in each]
    parts = [""]
    for name, study in studies.items():
        link = f"[Settings](../benchmarks/article/{name}.yaml)"
        parts.append(f"\n## {study.title}\n\n{study.about.strip()} {link}.\n")
        cells = [*study.changes()]
        parts += [study_table(shown, runs[name], cells) for shown in study.tables]
        parts += [
            f"\n![{figure.title.partition(':')[0]}](reproduction/{figure.file})\n" for figure in study.figures
        ]
    text = (
        (FOLDER / "page.md")
        .read_text(encoding="utf-8")
        .format(
            theirs=claims_table(verdict for verdict in every if not verdict.claim.ours),
            ours=claims_table(verdict for verdict in every if verdict.claim.ours),
            studies="".join(parts),
            enough=POWER,
            assumed=ASSUMED,
            **head(runs["mechanical"], made),
        )
    )
    return QUICK + text if quick else text


def head(runs: Runs, made: Mapping[str, Sequence[Verdict]]) -> dict[str, object]:
    """Return what the first paragraphs state."""

    def middle(cell: str, column: str) -> str:
        return number(median(of_cell(runs, cell, column).values() or [np.nan]))

    says = "ulti-objective GA: lower parameter error than simple GA"
    narrow, wide = (next(v for v in made[n] if says in v.claim.says) for n in ("mechanical", "wide"))
    theirs = [verdict for each in made.values() for verdict in each if not verdict.claim.ours]
    said = {o: [v.claim.says for v in theirs if v.outcome is o] for o in Outcome}
    cells = {"blind": BLIND, "centre": CENTRE, "simple": "simple GA", "multi": "multi-objective"}
    return {
        "main": f"{interval(narrow)}: {WORDS[narrow.outcome]}",
        "wide": f"{interval(wide)}: {WORDS[wide.outcome]}",
        "rank": middle(RECORDS, "directions of the record"),
        "count": len(theirs),
        "tally": "".join(f"- {TALLY[o].format(len(s), '; '.join(s))}.\n" for o, s in said.items() if s),
        **{name: middle(cell, "parameter error") for name, cell in cells.items()},
        **{f"output_{name}": middle(cell, "largest error") for name, cell in cells.items()},
    }


def interval(verdict: Verdict) -> str:
    """Return a ratio with its interval."""
    if not np.isfinite(verdict.interval[1]):
        return "too few runs"
    return f"{verdict.ratio:.2g} [{verdict.interval[0]:.2g}, {verdict.interval[1]:.2g}]"


def claims_table(made: Iterable[Verdict]) -> str:
    """Return the table of verdicts; an item stands at its first claim."""
    lines: list[tuple[str, ...]] = []
    item = ""
    for v in made:
        printed = "" if v.printed is None else f"{v.printed:.2g}"
        open_still = v.outcome is Outcome.UNDECIDED and 2 < v.seeds < v.enough
        more = f"/{v.enough if v.enough <= MOST else f'{MOST}+'}" if open_still else ""
        numbers = (interval(v), printed, f"{v.power:.2f}", v.outcome, f"{v.seeds}{more}")
        lines.append(("" if v.claim.item == item else v.claim.item, v.claim.says, *numbers))
        item = v.claim.item
    return table("", ("item", "claim", "ratio", "article's", "power", "verdict", "seeds"), lines)


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    above = f"\n**{title}**\n\n" if title else "\n"
    text = "".join(f"| {' | '.join(row)} |\n" for row in (header, ["---"] * len(header), *rows))
    return above + text


def study_table(shown: Table, runs: Runs, cells: Sequence[str]) -> str:
    """Return a table with median and spread of each cell, and the article's values."""
    lines: list[list[str]] = []
    without_search = () if shown.cells == (RECORDS,) else (BLIND, CENTRE)
    for cell in dict.fromkeys((*(shown.cells or cells), *shown.article, *without_search)):
        columns = [[*of_cell(runs, cell, column).values()] for column in shown.columns]
        texts = [number(median(values)) if values else "" for values in columns]
        printed = shown.article.get(cell, [None] * len(columns))
        texts = [t if v is None else f"{t} ({v:g})".strip() for t, v in zip(texts, printed, strict=True)]
        if any(texts):
            lines.append([cell, str(max(map(len, columns)) or ""), *texts])
    return table(shown.title, ("", "runs", *shown.columns), lines)


def number(value: float) -> str:
    """Return a number in two digits, or all before the point."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"


if __name__ == "__main__":
    (DOCS / "reproduction.md").write_text(page(DOCS / "reproduction"), encoding="utf-8")
