"""`hydroid study` and `article`."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hydroid.cli.options import DaskInsecure, Folder, Output
from hydroid.cli.output import show

if TYPE_CHECKING:
    from hydroid.api.studies import StudyOptions
    from hydroid.cli.progress import Progress
    from hydroid.report.table import Table
    from hydroid.study.study import StudyRuns


@dataclass(kw_only=True)
class StudyFlags:
    """How a study runs."""

    seeds: Annotated[
        int | None,
        typer.Option(min=1, max=10_000, help="Number of seeds [default: as the study's file says]."),
    ] = None
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="Two seeds, short data and few generations: shows that everything runs."
        ),
    ] = False
    processes: Annotated[
        int, typer.Option(min=0, max=1024, help="Number of processes. 0 means one per core.")
    ] = 0
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="local[:N]|slurm|ADDRESS",
            help="Run on the workers of a Dask scheduler instead. The result is the same.",
        ),
    ] = None
    dask_insecure: DaskInsecure = False

    def options(self, progress: "Progress") -> "StudyOptions":
        """Return them as the function's options."""
        from hydroid.api.studies import StudyOptions

        return StudyOptions(self.seeds, self.quick, self.processes, self.dask, self.dask_insecure, progress)


def study(
    file: Annotated[Path, typer.Argument(metavar="STUDY.yaml", help="The study's file (docs/studies.md).")],
    flags: StudyFlags,
    output: Output,
    out: Folder = Path("runs/study"),
) -> None:
    """Compare settings over many seeds: which fits better, and is the difference more than chance?

    The file names a config, the settings that vary, the data, and the claims to be tested. To continue a
    study that was stopped, give the same command again.
    """
    from hydroid.api.studies import study
    from hydroid.cli.progress import Progress

    with Progress(quiet=output.silent) as progress:
        result = study(file, out, flags.options(progress))
    lines = [*result.page.tables.values(), *_sentences(result.result), str(out / f"{result.page.name}.html")]
    show(output, lambda: {"out": str(out)} | _content(result.result), lines)


def article(
    flags: StudyFlags,
    output: Output,
    table: Annotated[
        list[int] | None,
        typer.Option(metavar="N", help="A table of the article, 1 to 9. May be repeated."),
    ] = None,
    figure: Annotated[
        list[int] | None,
        typer.Option(metavar="N", help="A figure of the article, 9 to 20. May be repeated."),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="All tables and figures.")] = False,
    listed: Annotated[bool, typer.Option("--list", help="List them, and run nothing.")] = False,
    out: Folder = Path("runs/article"),
) -> None:
    """Make the tables and figures of the article (Montazeri et al. 2017) anew, and test its conclusions.

    Each is a study over many seeds; its file travels with hydroid (configs/article). All of them take hours;
    --quick shows in minutes that they run. To continue after a stop, give the same command again.
    """
    from hydroid.api.studies import article, article_items
    from hydroid.cli.progress import Progress

    if listed:
        items = article_items()
        lines = [
            f"{item:10} {name:16} {settings.title}"
            for item, studies in items.items()
            for name, settings in studies.items()
        ]
        show(output, lambda: {"items": {item: list(studies) for item, studies in items.items()}}, lines)
        return
    chosen = [] if every else [f"table {n}" for n in table or ()] + [f"figure {n}" for n in figure or ()]
    if not chosen and not every:
        raise typer.BadParameter("give --table N, --figure N, --all or --list")
    with Progress(quiet=output.silent) as progress:
        result = article(chosen, out, flags.options(progress))
    made = [line for runs in result.result for line in _made(runs, out / runs.plan.name, chosen)]
    content = {runs.plan.name: _content(runs) for runs in result.result}
    pages = [str(out / "article.html")] if every else []
    show(output, lambda: {"out": str(out), "studies": content}, [*made, *pages])


def _made(runs: "StudyRuns", folder: Path, chosen: list[str]) -> "list[Table | str]":
    """Return what was made of a study, found, and where it stands; of all items or of those chosen."""
    from hydroid.report.study_report import study_tables

    items = [item for item in runs.plan.study.items if item in chosen or not chosen]
    names = tuple(item.replace(" ", "_") for item in items if item in chosen)
    tables = {name: table for name, table in study_tables(runs).items() if names and name.startswith(names)}
    figures = [name for figure in runs.plan.study.figures if (name := figure.item.replace(" ", "_")) in names]
    files = [
        f"{runs.plan.name}.html",
        *(f"tables/{n}.csv" for n in tables),
        *(f"figures/{n}.png" for n in figures),
    ]
    heading = f"{', '.join(items)}: {runs.plan.study.title}"
    where = [f"  {folder / file}" for file in files]
    return [heading, *tables.values(), *_sentences(runs, chosen), *where, ""]


def _sentences(runs: "StudyRuns", chosen: Sequence[str] = ()) -> list[str]:
    """Return the verdicts in sentences, of all items or of those chosen; many of one reason in one."""
    from hydroid.study.claims import Outcome

    verdicts = [v for v in (*runs.verdicts, *runs.findings) if v.item in chosen or not chosen]
    few = Counter(v.detail for v in verdicts if v.outcome is Outcome.UNTESTED)
    alike = {detail: count for detail, count in few.items() if count > 1}
    found = [f"- {v.sentence}" for v in verdicts if v.detail not in alike]
    found += [f"- {count} claims are not tested: {detail}" for detail, count in alike.items()]
    failed = sum(bool(row.failed) for row in runs.rows)
    return [*found, f"- {failed} of {len(runs.rows)} runs failed"] if failed else found


def _content(runs: "StudyRuns") -> dict[str, Any]:
    """Return verdicts and runs for JSON."""
    from hydroid.estimate import finite

    verdicts = [
        {
            "claim": v.says,
            "item": v.item or None,
            "verdict": v.outcome.value,
            "detail": v.detail,
            "p": finite(v.p),
            "effect": finite(v.effect),
            "seeds": v.seeds,
        }
        for v in (*runs.verdicts, *runs.findings)
    ]
    rows = [
        {"cell": r.cell, "seed": r.seed, "failed": r.failed or None}
        | {name: finite(value) for name, value in r.values.items()}
        for r in runs.rows
    ]
    return {"verdicts": verdicts, "runs": rows}
