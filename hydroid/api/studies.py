"""Settings compared over many seeds: `study` of your own, and `article`, the article's evaluation."""

import json
import time
from collections.abc import Generator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydroid.api.look import read_logs
from hydroid.api.study import Study
from hydroid.assets import assets
from hydroid.errors import SettingsError, Stopped
from hydroid.files import write_atomic
from hydroid.progress import Progress, no_progress

if TYPE_CHECKING:
    from hydroid.settings.study import StudySettings
    from hydroid.study.study import StudyPlan, StudyRuns


@dataclass(frozen=True)
class StudyOptions:
    """How `study` and `article` run.

    Attributes:
        seeds: number of seeds; None: what the study's file says.
        quick: the short form: two seeds, short data, few generations.
        processes: on this machine; 0: one per core.
        dask: run on Dask workers instead (`local[:N]`, `slurm`, an address).
        dask_insecure: accept an address without TLS.
        progress: called with what is done, how much of it, and how much there is.
    """

    seeds: int | None = None
    quick: bool = False
    processes: int = 0
    dask: str | None = None
    dask_insecure: bool = False
    progress: Progress = field(default_factory=lambda: no_progress)


def study(
    file: str | Path, out: str | Path = "runs/study", options: StudyOptions = StudyOptions()
) -> "Study[StudyRuns]":
    """Fit every cell of a study over every seed, and test what it claims.

        result = hydroid.study("my-study.yaml", "runs/my-study", hydroid.StudyOptions(seeds=5)).result
        print(*[verdict.sentence for verdict in result.verdicts], sep="\\n")

    Every run leaves a small file in `out`/runs when it ends. If the study is stopped or killed, the same call
    goes on from there, and ends with the same bits.

    Args:
        file: the study's YAML file (docs/studies.md).
        out: folder for the runs, the page, the tables and figures.
        options: number of seeds, short form, processes.

    Returns:
        The study; `result.rows` has the measures of each run.

    Raises:
        SettingsError: a key or value of the file that is not allowed.
        RunError: `out` cannot be written or is in use, or a process died.
    """
    from hydroid.run.lock import locked

    plan = _plan(Path(file), options)
    with _stoppable(Path(out)), locked(Path(out)), _executor(options) as executor:
        return _run(plan, Path(out), Path(out), executor, options)


def article(
    items: Sequence[str] = (), out: str | Path = "runs/article", options: StudyOptions = StudyOptions()
) -> "Study[list[StudyRuns]]":
    """Make tables and figures of the article anew, and test its conclusions.

        result = hydroid.article(["table 6"], "runs/article", hydroid.StudyOptions(quick=True))

    Studies share the runs that they have in common. What is stopped goes on with the same call. The page of
    all items is written when all are made.

    Args:
        items: such as "table 6" or "figure 13"; none: all.
        out: folder for the runs, and a folder for each study.
        options: number of seeds, short form, processes.

    Raises:
        SettingsError: no such item.
        RunError: as of `study`.
    """
    from hydroid.report.article_report import account, article_page
    from hydroid.run.lock import locked

    plans = [_plan(path, options) for path in _chosen(items)]
    out, began = Path(out), time.monotonic()
    with _stoppable(out), locked(out), _executor(options) as executor:
        results = [_run(plan, out, out / plan.name, executor, options).result for plan in plans]
    page = article_page(results, items or article_items(), time.monotonic() - began)
    if items:
        return Study(results, page)
    about = json.dumps(account(results, quick=options.quick), indent=1, ensure_ascii=False)
    write_atomic(out / "about.json", about + "\n")
    return Study(results, page).write(out)


def article_items() -> "dict[str, dict[str, StudySettings]]":
    """Return the studies behind each table and figure of the article, by name of their file."""
    from hydroid.settings.study import load_study

    found: dict[str, dict[str, StudySettings]] = {}
    for path in _shipped():
        settings = load_study(path)
        for item in settings.items:
            found.setdefault(item, {})[path.stem] = settings
    return dict(sorted(found.items(), key=lambda each: _order(each[0])))


def _order(item: str) -> tuple[bool, int]:
    kind, number = item.split()
    return kind == "figure", int(number)


def _shipped() -> list[Path]:
    return sorted((assets() / "configs" / "article").glob("*.yaml"))


def _chosen(items: Sequence[str]) -> list[Path]:
    """Return the files of the studies that make some items, each once."""
    known = article_items()
    for item in items:
        if item not in known:
            raise SettingsError("cannot be made", where=item, hint="tables 1 to 9 and figures 9 to 20 can")
    wanted = dict.fromkeys(name for item in items or known for name in known[item])
    return [path for name in wanted for path in _shipped() if path.stem == name]


def _plan(path: Path, options: StudyOptions) -> "StudyPlan":
    from hydroid.settings.study import load_study

    load_study(path)  # a wrong file is refused before anything heavy is imported
    from hydroid.study.study import plan_study

    def read(paths: Any, settings: Any) -> Any:
        return read_logs(paths, settings)

    return plan_study(path, read, seeds=options.seeds, quick=options.quick)


def _run(
    plan: "StudyPlan", shared: Path, out: Path, executor: Executor, options: StudyOptions
) -> "Study[StudyRuns]":
    """Run a study whose runs lie in `shared`, and write its page to `out`."""
    from hydroid.report.study_report import study_page
    from hydroid.study.study import run_study

    runs = run_study(plan, shared, executor, options.progress)
    return Study(runs, study_page(runs)).write(out)


@contextmanager
def _executor(options: StudyOptions) -> Generator[Executor]:
    from hydroid.parallel.cluster import open_workers
    from hydroid.settings.simulation import ClusterSettings
    from hydroid.study.execution import processes

    with open_workers(options.dask, ClusterSettings(), insecure=options.dask_insecure) as workers:
        if workers is None:
            with processes(options.processes) as executor:
                yield executor
        else:
            yield workers.executor()


@contextmanager
def _stoppable(out: Path) -> Generator[None]:
    """Say what is kept where a study is stopped."""
    try:
        yield
    except KeyboardInterrupt:
        count = len(list(out.glob("runs/*.json")))
        raise Stopped(f"{out} holds {count} runs that have ended; the same command goes on") from None
