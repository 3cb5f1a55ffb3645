"""`hydroid collect` as a plain function: runs that were made apart, and what they found together."""

import glob
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydroid.errors import HydroidError, RunError
from hydroid.estimate import NAME, NamedEstimate, read_estimate
from hydroid.parameters import ParameterSet
from hydroid.problem.stage import Stage
from hydroid.report.page import write_page
from hydroid.report.spread import RunEstimate, RunResult, final_spread, spread_page
from hydroid.report.table import Table
from hydroid.run.folder import RunFolder
from hydroid.run.identity import file_hash, other_settings
from hydroid.settings.fit import FitSettings
from hydroid.uncertainty.flags import Flag


@dataclass(frozen=True)
class Collected:
    """The spread over runs, and the runs in the order of their seeds."""

    table: Table
    runs: tuple[RunResult, ...]

    @property
    def best(self) -> RunResult:
        """The run with the smallest rms output error."""
        return min(self.runs, key=lambda run: run.best.rms)


@dataclass(frozen=True)
class _Run:
    identity: dict[str, Any]
    settings: FitSettings
    parameters: ParameterSet
    result: RunResult


def collect(names: Sequence[str], out: Path, tell: Callable[[str], None]) -> Collected:
    """Merge finished runs that differ in nothing but their seeds; nothing of them is copied or changed.

    Args:
        names: run folders, or patterns of them, in any order.
        out: folder for the tables and the figure.
        tell: takes a line for each run that is left out (not finished, damaged, or a seed that another has),
            and for each that cannot be mixed with the first.

    Raises:
        RunError: no run is left, runs differ in more than their seeds, or `out` cannot be written.
    """
    if RunFolder(out).exists:
        raise RunError("is a run itself", where=f"--out {out}", hint="name another folder")
    runs: list[_Run] = []
    for path in _folders(names):
        try:
            runs.append(_read(path))
        except HydroidError as error:
            tell(f"left out: {error}")
    if not runs:
        hint = "finish one that was stopped with --resume"
        raise RunError("no finished run is there", where=" ".join(names), hint=hint)
    runs.sort(key=lambda run: (run.result.seed, run.result.path))
    _refuse_others(runs, tell)
    once: dict[int, RunResult] = {}
    for result in (run.result for run in runs):
        kept = once.setdefault(result.seed, result)
        if kept is not result:
            tell(f"left out: {result.path}: has seed {result.seed}, as {kept.path} has")
    results = tuple(once.values())
    page = spread_page(runs[0].parameters, results)
    write_page(page, out)
    return Collected(final_spread(page), results)


def _folders(names: Sequence[str]) -> list[Path]:
    """The folders that names and patterns stand for, each once; a name that stands for nothing stays."""
    found = ([name] if os.path.exists(name) else glob.glob(name) or [name] for name in names)
    paths = [Path(path) for group in found for path in group]
    return sorted({path.resolve(): path for path in reversed(paths)}.values())


def _read(path: Path) -> _Run:
    """Read what a finished run was and found.

    Raises:
        HydroidError: it is not finished or damaged.
    """
    folder = RunFolder(path)
    identity = folder.identity()
    if identity.get("status") != "done":
        what = f"is not finished ({identity.get('status')})"
        raise RunError(what, where=str(path), hint="finish it with --resume")
    for name in ("config.yaml", "arm.yaml"):
        if not (path / name).is_file() or file_hash(path / name) != identity.get("files", {}).get(name):
            raise RunError("is gone, or has changed since the run began", where=str(path / name))
    settings = folder.settings()
    parameters = Stage(settings).parameters
    return _Run(identity, settings, parameters, _result(path, settings.search.seed, parameters))


def _result(path: Path, seed: int, parameters: ParameterSet) -> RunResult:
    file = path / NAME
    summary = read_estimate(file)
    names = list(summary.estimates)
    if not names or summary.final not in names:
        raise RunError("is not an estimate that a run has written", where=str(file))
    first, last = (
        _estimate(summary.estimates[n], seed, parameters, str(file)) for n in (names[0], summary.final)
    )
    without = frozenset(name for name, p in summary.estimate.items() if p.flag == Flag.NO_EFFECT)
    return RunResult(path, first, last, summary.final != names[0], without)


def _estimate(found: NamedEstimate, seed: int, parameters: ParameterSet, source: str) -> RunEstimate:
    if found.rms_deg is None:
        raise RunError("is the estimate of a simulation that diverged", where=source)
    return RunEstimate(seed, parameters.vector(found.values, source), math.radians(found.rms_deg))


def _refuse_others(runs: Sequence[_Run], tell: Callable[[str], None]) -> None:
    """Tell each run that is not the first with another seed, and raise RunError where there is one."""
    first, *rest = runs
    differences = [(run.result.path, words) for run in rest if (words := _difference(first, run))]
    for path, words in differences:
        tell(f"{path}: {words}")
    if differences:
        what = f"{len(differences)} of {len(runs)} runs differ from {first.result.path} in more than the seed"
        raise RunError(what, hint="collect them apart")


def _difference(first: _Run, run: _Run) -> str:
    """What makes a run another one than the first with another seed; empty where nothing does."""
    for key in ("hydroid", "mujoco"):
        if run.identity.get(key) != first.identity.get(key):
            return f"made by {key} {run.identity.get(key)}, not {first.identity.get(key)}"
    if _logs(run) != _logs(first):
        return f"of other logs ({', '.join(name for name, _ in _logs(run))}, or their content)"
    for key, old, new in other_settings(first.settings, run.settings):
        if key != "search.seed":
            return f"has {key} = {new}, not {old}"
    return "" if _model(run) == _model(first) else "of another arm"


def _logs(run: _Run) -> list[tuple[str, str]]:
    """Names and hashes: the same log may lie elsewhere."""
    return [(Path(path).name, known) for path, known in run.identity.get("logs", {}).items()]


def _model(run: _Run) -> dict[str, str]:
    """Hashes of the arm, its model and its meshes, by file."""
    return {name: known for name, known in run.identity.get("files", {}).items() if name != "config.yaml"}
