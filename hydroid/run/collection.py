"""Finished runs that were made apart and differ only in their seeds."""

import glob
import logging
import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from hydroid.errors import HydroidError, RunError
from hydroid.run.folder import RunFolder
from hydroid.run.identity import difference
from hydroid.run.record import Record, load_record

_log = logging.getLogger(__name__)


def read_runs(names: Sequence[str], out: str | Path | None) -> tuple[Record, ...]:
    """Read finished runs that differ in nothing but their seeds; those that are not finished are left out.

    Args:
        names: run folders, or patterns of them, in any order.
        out: the folder for what is to be written about them, if anything is.

    Returns:
        One run for each seed, in the order of the seeds.

    Raises:
        RunError: no run is left, two differ in more than their seeds or in nothing, or `out` is a run.
    """
    if out is not None and RunFolder(Path(out)).exists:
        raise RunError("is a run itself", where=out, hint="name another folder")
    runs: list[Record] = []
    groups = ([name] if os.path.exists(name) else glob.glob(name) or [name] for name in names)
    for path in sorted({path for group in groups for path in group}):
        try:
            runs.append(_read(path))
        except HydroidError as error:
            _log.warning("left out: %s", error)
    if not runs:
        hint = "resume those that were stopped"
        raise RunError("no finished run is there", where=" ".join(names), hint=hint)
    runs.sort(key=lambda run: run.seed)
    for before, run in pairwise(runs):
        other = difference(run.identity, before.identity, but="search.seed")
        if run.seed == before.seed:
            other = f"has seed {run.seed}, as {before.folder} has"
        if other:
            raise RunError(other, where=run.folder, hint="leave it out, or merge it apart")
    return tuple(runs)


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
