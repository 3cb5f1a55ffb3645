"""Finished runs that were made apart and differ only in their seeds."""

import glob
import logging
import os
from collections.abc import Sequence
from pathlib import Path

from hydroid.errors import HydroidError, RunError
from hydroid.run.folder import RunFolder
from hydroid.run.identity import difference
from hydroid.run.record import Record, load_record

_log = logging.getLogger(__name__)


def read_runs(names: Sequence[str], out: str | Path | None) -> tuple[Record, ...]:
    """Read finished runs that differ in nothing but their seeds; those that cannot be used are left out.

    Args:
        names: run folders, or patterns of them, in any order.
        out: the folder for what is to be written about them, if anything is.

    Returns:
        One run for each seed, in the order of the seeds.

    Raises:
        RunError: no run is left, runs differ in more than their seeds, or `out` is a run itself.
    """
    if out is not None and RunFolder(Path(out)).exists:
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
    runs.sort(key=lambda run: (run.seed, run.folder))
    others = {run.folder: difference(run.identity, runs[0].identity, but="search.seed") for run in runs}
    if differing := {folder: text for folder, text in others.items() if text}:
        for folder, text in differing.items():
            _log.warning("%s: %s", folder, text)
        what = f"{len(differing)} of {len(runs)} runs differ from {runs[0].folder} in more than the seed"
        raise RunError(what, hint="collect them apart")
    once: dict[int, Record] = {}
    for run in runs:
        if (kept := once.setdefault(run.seed, run)) is not run:
            _log.warning("left out: %s: has seed %d, as %s has", run.folder, run.seed, kept.folder)
    return tuple(once.values())


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
