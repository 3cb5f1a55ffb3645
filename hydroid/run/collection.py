"""Finished runs that were made apart and differ only in their seeds."""

import glob
import logging
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydroid.errors import HydroidError, RunError
from hydroid.estimate import NAME, FitSummary, read_estimate
from hydroid.identified_model import ARM, CONFIG
from hydroid.parameters import Array, ParameterSet
from hydroid.posterior.flags import Flag
from hydroid.run.folder import RunFolder
from hydroid.run.identity import file_hash, other_settings
from hydroid.settings.fit import FitSettings

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class RunEstimate:
    """One estimate of one run: the run's seed, theta of shape (P,), rms output error [rad]."""

    seed: int
    theta: Array
    rms: float


@dataclass(frozen=True, eq=False)
class RunResult:
    """What one run came to: its folder, the search's estimate and the final one, and its summary."""

    path: Path
    searched: RunEstimate
    best: RunEstimate
    summary: FitSummary

    @property
    def seed(self) -> int:
        """Of the search."""
        return self.best.seed

    @property
    def rms_deg(self) -> float:
        """Rms output error of the final estimate [deg]."""
        return math.degrees(self.best.rms)

    @property
    def refined(self) -> bool:
        """Whether the final estimate is another than the search's."""
        return self.summary.final != self.summary.searched

    @property
    def without_effect(self) -> frozenset[str]:
        """Parameters without effect on the outputs."""
        return frozenset(n for n, p in self.summary.estimate.items() if p.flag == Flag.NO_EFFECT)


@dataclass(frozen=True)
class Collection:
    """The settings of all runs but for their seeds, and the runs in the order of these."""

    settings: FitSettings
    runs: tuple[RunResult, ...]

    @property
    def parameters(self) -> ParameterSet:
        """Of all runs."""
        return self.settings.parameter_set()

    @property
    def best(self) -> RunResult:
        """The run with the smallest rms output error."""
        return min(self.runs, key=lambda run: run.best.rms)


@dataclass(frozen=True)
class _Run:
    identity: dict[str, Any]
    settings: FitSettings
    result: RunResult


def read_runs(names: Sequence[str], out: Path) -> Collection:
    """Read finished runs that differ in nothing but their seeds; those that cannot be used are left out.

    Args:
        names: run folders, or patterns of them, in any order.
        out: the folder for what is to be written about them.

    Raises:
        RunError: no run is left, runs differ in more than their seeds, or `out` is a run itself.
    """
    if RunFolder(out).exists:
        raise RunError("is a run itself", where=str(out), hint="name another folder")
    runs: list[_Run] = []
    for path in _folders(names):
        try:
            runs.append(_read(path))
        except HydroidError as error:
            _log.warning("left out: %s", error)
    if not runs:
        raise RunError(
            "no finished run is there", where=" ".join(names), hint="resume those that were stopped"
        )
    runs.sort(key=lambda run: (run.result.seed, run.result.path))
    _refuse_others(runs)
    once: dict[int, RunResult] = {}
    for result in (run.result for run in runs):
        kept = once.setdefault(result.seed, result)
        if kept is not result:
            _log.warning("left out: %s: has seed %d, as %s has", result.path, result.seed, kept.path)
    return Collection(runs[0].settings, tuple(once.values()))


def _folders(names: Sequence[str]) -> list[Path]:
    """The folders that names and patterns stand for, each once; a name that stands for nothing stays."""
    found = ([name] if os.path.exists(name) else glob.glob(name) or [name] for name in names)
    paths = [Path(path) for group in found for path in group]
    return sorted({path.resolve(): path for path in reversed(paths)}.values())


def _read(path: Path) -> _Run:
    """Read a finished run.

    Raises:
        HydroidError: it is not finished or is damaged.
    """
    folder = RunFolder(path)
    identity = folder.identity()
    if identity.get("status") != "done":
        raise RunError(f"is not finished ({identity.get('status')})", where=str(path), hint="resume it")
    for name in (CONFIG, ARM):
        if not (path / name).is_file() or file_hash(path / name) != identity.get("files", {}).get(name):
            raise RunError("is gone, or has changed since the run began", where=str(path / name))
    settings = folder.settings()
    return _Run(identity, settings, _result(path, settings.search.seed, settings.parameter_set()))


def _result(path: Path, seed: int, parameters: ParameterSet) -> RunResult:
    file = path / NAME
    summary = read_estimate(file)
    if summary.final not in summary.estimates:
        raise RunError("is not an estimate that a run has written", where=str(file))

    def estimate(name: str) -> RunEstimate:
        one = summary.estimates[name]
        if one.rms_deg is None:
            raise RunError("is the estimate of a simulation that diverged", where=str(file))
        return RunEstimate(seed, parameters.vector(one.values, str(file)), math.radians(one.rms_deg))

    return RunResult(path, estimate(summary.searched), estimate(summary.final), summary)


def _refuse_others(runs: Sequence[_Run]) -> None:
    """Name each run that is not the first with another seed, and raise RunError where there is one."""
    first, *rest = runs
    differences = [(run.result.path, text) for run in rest if (text := _difference(first, run))]
    for path, text in differences:
        _log.warning("%s: %s", path, text)
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
    return {name: known for name, known in run.identity.get("files", {}).items() if name != CONFIG}
