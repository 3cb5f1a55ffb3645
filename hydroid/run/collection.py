"""Finished runs that were made apart and differ only in their seeds."""

import glob
import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.errors import HydroidError, RunError
from hydroid.estimate import NAME, FitSummary
from hydroid.parameters import Array, ParameterSet
from hydroid.run.folder import RunFolder
from hydroid.run.identity import difference
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Run:
    """A finished run: its folder, what it was made of, its summary, and the final estimate, shape (P,)."""

    path: Path
    identity: Mapping[str, Any]
    settings: FitSettings
    summary: FitSummary
    theta: Array
    rms_deg: float

    @property
    def seed(self) -> int:
        """Of the search."""
        return self.settings.search.seed


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs that differ in their seeds only, in the order of these."""

    runs: tuple[Run, ...]

    @property
    def settings(self) -> FitSettings:
        """Of all runs but for their seeds."""
        return self.runs[0].settings

    @property
    def parameters(self) -> ParameterSet:
        """Of all runs."""
        return self.settings.parameter_set()

    @property
    def theta(self) -> Array:
        """The final estimates, shape (N, P)."""
        return np.array([run.theta for run in self.runs])

    @property
    def best(self) -> Run:
        """The run with the smallest rms output error."""
        return min(self.runs, key=lambda run: run.rms_deg)


def read_runs(names: Sequence[str], out: Path) -> Runs:
    """Read finished runs that differ in nothing but their seeds; those that cannot be used are left out.

    Args:
        names: run folders, or patterns of them, in any order.
        out: the folder for what is to be written about them.

    Raises:
        RunError: no run is left, runs differ in more than their seeds, or `out` is a run itself.
    """
    if RunFolder(out).exists:
        raise RunError("is a run itself", where=str(out), hint="name another folder")
    runs: list[Run] = []
    for path in _folders(names):
        try:
            runs.append(_read(path))
        except HydroidError as error:
            _log.warning("left out: %s", error)
    if not runs:
        hint = "resume those that were stopped"
        raise RunError("no finished run is there", where=" ".join(names), hint=hint)
    first, *others = sorted(runs, key=lambda run: (run.seed, run.path))
    once, differing = {first.seed: first}, 0
    for run in others:
        other = (run.identity, run.settings), (first.identity, first.settings)
        if text := difference(*other, but="search.seed"):
            _log.warning("%s: %s", run.path, text)
            differing += 1
        elif (kept := once.setdefault(run.seed, run)) is not run:
            _log.warning("left out: %s: has seed %d, as %s has", run.path, run.seed, kept.path)
    if differing:
        what = f"{differing} of {len(runs)} runs differ from {first.path} in more than the seed"
        raise RunError(what, hint="collect them apart")
    return Runs(tuple(once.values()))


def _folders(names: Sequence[str]) -> list[Path]:
    """The folders that names and patterns stand for, each once; a name that stands for nothing stays."""
    groups = ([name] if os.path.exists(name) else glob.glob(name) or [name] for name in names)
    paths = [Path(path) for group in groups for path in group]
    return sorted({path.resolve(): path for path in reversed(paths)}.values())


def _read(path: Path) -> Run:
    """Read a finished run.

    Raises:
        HydroidError: it is not finished or is damaged.
    """
    folder, file = RunFolder(path), path / NAME
    identity = folder.identity()
    if identity.get("status") != "done":
        raise RunError(f"is not finished ({identity.get('status')})", where=str(path), hint="resume it")
    folder.refuse_changes()
    settings, summary = folder.settings(), load(file, FitSummary)
    final = summary.estimates.get(summary.final or "")
    if final is None or final.rms_deg is None:
        raise RunError("has no final estimate that could be simulated", where=str(file))
    theta = settings.parameter_set().vector(final.values, str(file))
    return Run(path, identity, settings, summary, theta, final.rms_deg)
