"""Finished runs that were made apart and differ only in their seeds."""

import glob
import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hydroid.errors import HydroidError, RunError
from hydroid.parameters import Array, ParameterSet
from hydroid.run.folder import RunFolder
from hydroid.run.identity import difference
from hydroid.run.record import Record, load_record
from hydroid.settings.fit import FitSettings

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs that differ in their seeds only, in the order of these."""

    runs: tuple[Record, ...]

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
        return np.array([self.parameters.vector(run.summary.values, run.folder) for run in self.runs])

    @property
    def best(self) -> Record:
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
    runs: list[Record] = []
    groups = ([name] if os.path.exists(name) else glob.glob(name) or [name] for name in names)
    paths = {Path(path).resolve(): path for group in groups for path in group}
    for _, path in sorted(paths.items()):
        try:
            runs.append(_read(path))
        except HydroidError as error:
            _log.warning("left out: %s", error)
    if not runs:
        hint = "resume those that were stopped"
        raise RunError("no finished run is there", where=" ".join(names), hint=hint)
    first, *others = sorted(runs, key=lambda run: (run.seed, run.folder))
    once, differing = {first.seed: first}, 0
    for run in others:
        if text := difference(run.identity, first.identity, but="search.seed"):
            _log.warning("%s: %s", run.folder, text)
            differing += 1
        elif (kept := once.setdefault(run.seed, run)) is not run:
            _log.warning("left out: %s: has seed %d, as %s has", run.folder, run.seed, kept.folder)
    if differing:
        what = f"{differing} of {len(runs)} runs differ from {first.folder} in more than the seed"
        raise RunError(what, hint="collect them apart")
    return Runs(tuple(once.values()))


def _read(path: str) -> Record:
    """Read a finished run.

    Raises:
        HydroidError: it is not finished or is damaged.
    """
    folder = RunFolder(Path(path))
    if (status := folder.identity().get("status")) != "done":
        raise RunError(f"is not finished ({status})", where=path, hint="resume it")
    folder.refuse_changes()
    record = load_record(path)
    if record.summary.rms_deg is None:
        raise RunError("has no final estimate that could be simulated", where=path)
    return record
