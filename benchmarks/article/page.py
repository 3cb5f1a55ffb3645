"""`docs/reproduction.md`: the article's tables and figures made anew, from results that are committed.

    python benchmarks/article/page.py

docs/reproduction/ has one CSV of all runs for each study, and the figures; page.md here has the words.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median

import numpy as np
from claims import MOST, POWER, Outcome, Verdict, log_ratios, verdict, verdicts
from studies import (
    BLIND,
    CENTRE,
    FOLDER,
    RECORDS,
    ArticleStudy,
    Claim,
    Figure,
    Runs,
    Table,
    load_studies,
    of_cell,
    read_runs,
)

DOCS = FOLDER.parents[1] / "docs"
QUICK = "> **The short form: one seed, short data, few generations. It shows that the studies run.**\n\n"
FEW = 5
"""runs below which a median of some of a cell's runs, or a curve, says little"""
SEARCHES = {"simple": "simple GA", "multi": "multi-objective", "least": "multi-start"}
"""what the head calls a cell"""
KNOWN = Claim(
    says="", item="", lower=SEARCHES["multi"], than=SEARCHES["simple"], column="identifiable error", ours=True
)
"""what the head says of the wide box besides the article's claim"""


def page(results: Path, *, quick: bool = False) -> str:
    """Return the page of the results in a folder."""
    studies = load_studies()
    runs = {name: read_runs(results / f"{name}_runs.csv") for name in studies}
    made = {name: verdicts(study.claims, runs[name], study.tables) for name, study in studies.items()}
    every = [v for each in made.values() for v in each]
    parts = [""]
    for name, study in studies.items():
        link = f"[Settings](../benchmarks/article/{name}.yaml)"
        parts.append(f"\n## {study.title}\n\n{study.about.strip()} {link}.\n")
        cells = [*study.changes()]
        parts += [study_table(shown, runs[name], cells) for shown in study.tables]
        parts += [shown_figure(figure, runs[name]) for figure in study.figures]
    text = (
        (FOLDER / "page.md")
        .read_text(encoding="utf-8")
        .format(
            theirs=claims_table(v for v in every if not v.claim.ours),
            ours=claims_table(v for v in every if v.claim.ours),
            studies="".join(parts),
            enough=percent(POWER),
            **head(runs, made, studies),
        )
    )
    return QUICK + text if quick else text


def head(
    runs: Mapping[str, Runs],
    made: Mapping[str, Sequence[Verdict]],
    studies: Mapping[str, ArticleStudy],
) -> dict[str, object]:
    """Return the numbers that the words need."""

    def middle(study: str, cell: str, column: str) -> float:
        return median(of_cell(runs[study], cell, column).values() or [np.nan])

    says = "ulti-objective GA: lower parameter error than simple GA"
    narrow, wide = (next(v for v in made[n] if says in v.claim.says) for n in ("mechanical", "wide"))
    both = [
        of_cell(runs["mechanical"], cell, "parameter error")
        for cell in (narrow.claim.lower, narrow.claim.than)
    ]
    cost = {
        f"cost_{stage}_{name}": middle(study, cell, "simulations")
        for stage, study in (("1", "mechanical"), ("2", "hydraulic"))
        for name, cell in SEARCHES.items()
    }
    seeds = [  # of the searches in stages 1 and 2, with whether the record is a seed's own
        run["seed"] > studies[name].same_record
        for name in ("mechanical", "hydraulic")
        for run in runs[name]
        if run["cell"] not in (BLIND, CENTRE, RECORDS)
    ]
    cells = SEARCHES | {"blind": BLIND, "centre": CENTRE}
    return {
        "main": at_best(narrow),
        "wide": at_best(wide),
        "seeds": narrow.seeds,
        "shared": sum(seed <= studies["mechanical"].same_record for seed in both[0] if seed in both[1]),
        "wide_seeds": wide.seeds,
        "wide_known": interval(verdict(KNOWN, log_ratios(KNOWN, runs["wide"]), 0.05, None)),
        "own": sum(seeds),
        "searches": len(seeds),
        "rank": number(middle("mechanical", RECORDS, "directions of the record")),
        "count": sum(not v.claim.ours for each in made.values() for v in each),
        "tally": tally(made, number(middle("mechanical", CENTRE, "largest error"))),
        **{f"wide_{n}": number(middle("wide", c, "identifiable error")) for n, c in SEARCHES.items()},
        **{name: number(middle("mechanical", cell, "parameter error")) for name, cell in cells.items()},
        **{f"output_{n}": number(middle("mechanical", c, "largest error")) for n, c in SEARCHES.items()},
        **{name: f"{value:,.0f}" for name, value in cost.items()},
        "dearer": percent(cost["cost_2_least"] / cost["cost_2_multi"] - 1),
    }


def tally(made: Mapping[str, Sequence[Verdict]], centre: str) -> str:
    """Return how many of the article's claims have each outcome, and which."""
    every = [(name, v) for name, each in made.items() for v in each if not v.claim.ours]
    held = [(name, v.claim.item) for name, v in every if v.outcome is Outcome.HOLDS]
    excluded = [(v, v.printed is not None) for _, v in every if v.outcome is Outcome.EXCLUDED]
    log, slopes = sum(n == "rig" for n, _ in held), sum(item == "section 3.1" for _, item in held)
    near = sum(item == "figure 16" for _, item in held)
    of = {o: [v.claim.says for _, v in every if v.outcome is o] for o in Outcome}
    lists = {
        f"**{len(held)} hold** ({log} are of one log of a virtual rig; {slopes} are sensitivities, without a "
        f"search; {near}, of figure 16, ask for an error within 5 % of the motion, and the box's centre "
        f"meets that without a search: {centre} deg)": of[Outcome.HOLDS],
        f"**in {len(of[Outcome.OPPOSITE])} the opposite holds**": of[Outcome.OPPOSITE],
        f"**in {sum(p for _, p in excluded)} the effect that the article prints is excluded**": [
            v.claim.says for v, printed in excluded if printed
        ],
        f"**in {sum(not p for _, p in excluded)} the article prints no effect, and a halving is excluded**": [
            v.claim.says for v, printed in excluded if not printed
        ],
    }
    lines = [f"- {what}: {'; '.join(says)}.\n" for what, says in lists.items() if says]
    undecided = f"- **{len(of[Outcome.UNDECIDED])} are undecided**: the seeds are too few so far.\n"
    return "".join(lines) + undecided


def at_best(made: Verdict) -> str:
    """Return a ratio, and how much better the multi-objective GA can be within its interval."""
    low, printed = made.interval[0], made.printed
    if not np.isfinite(made.interval[1]):
        return interval(made)
    best = f"at best {percent(1 - low)} better" if low < 1 else "worse"
    other = f", not {percent(1 - printed)}" if printed and made.outcome is Outcome.EXCLUDED else ""
    return f"{interval(made)}: the multi-objective GA is {best}{other}"


def percent(part: float) -> str:
    """Return a part in per cent."""
    return f"{100 * part:.0f} %"


def interval(made: Verdict) -> str:
    """Return a ratio with its interval."""
    if not np.isfinite(made.interval[1]):
        return "too few runs"
    return f"{made.ratio:.2g} [{made.interval[0]:.2g}, {made.interval[1]:.2g}]"


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
    """Return a table with the median of each cell, and the article's values.

    A measure that fewer than FEW of a cell's runs have, and others lack, is blank.
    """
    lines: list[list[str]] = []
    without_search = () if shown.cells == (RECORDS,) else (BLIND, CENTRE)
    for cell in dict.fromkeys((*(shown.cells or cells), *shown.article, *without_search)):
        columns = [values_of(runs, cell, column) for column in shown.columns]
        most = max(map(len, columns))
        texts = [number(median(v)) if v and len(v) >= min(FEW, most) else "" for v in columns]
        printed = shown.article.get(cell, [None] * len(columns))
        texts = [t if v is None else f"{t} ({v:g})".strip() for t, v in zip(texts, printed, strict=True)]
        if any(texts):
            lines.append([cell, str(most or ""), *texts])
    return table(shown.title, ("", "runs", *shown.columns), lines)


def values_of(runs: Runs, cell: str, column: str) -> list[float]:
    """Return a measure of a cell's runs, or the ratio of two, `A / B`, in the runs that have both."""
    above, _, below = column.partition(" / ")
    upper = of_cell(runs, cell, above)
    if not below:
        return [*upper.values()]
    lower = of_cell(runs, cell, below)
    return [value / lower[seed] for seed, value in upper.items() if seed in lower]


def shown_figure(figure: Figure, runs: Runs) -> str:
    """Return a figure, with the runs behind each curve where only runs with a history count."""
    text = f"\n![{figure.title.partition(':')[0]}](reproduction/{figure.file})\n"
    if figure.kind != "convergence":
        return text
    counts = {cell: sum(run["cell"] == cell and "history" in run for run in runs) for cell in figure.cells}
    behind = "; ".join(f"{cell}: {count}" for cell, count in counts.items())
    weak = f" A curve of fewer than {FEW} shows little but chance." * (min(counts.values()) < FEW)
    return f"{text}\nRuns behind each curve (older runs have no history): {behind}.{weak}\n"


def number(value: float) -> str:
    """Return a number in two digits, or all before the point."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"


if __name__ == "__main__":
    (DOCS / "reproduction.md").write_text(page(DOCS / "reproduction"), encoding="utf-8")
