"""What makes a run that run: settings, arm, logs and versions; and refusing to continue another one."""

import hashlib
import json
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.arm.model import load_model
from hydroid.errors import RunError
from hydroid.files import is_file
from hydroid.identified_model import ARM, CONFIG, MODEL, portable
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings

DESCRIPTION = "run.json"
"""name of the file that describes the run: versions, seed, hashes of its logs and files, status, seconds"""
FREE = ("cluster.", "simulation.threads")
"""settings on which no result depends"""
ELSEWHERE = frozenset({"model", "pair"})
"""of an arm's settings: where its files are, and what stands beside it"""


def identity(settings: FitSettings, logs: Sequence[Log]) -> dict[str, Any]:
    """Return versions, seed, and hashes of the logs."""
    return {
        "hydroid": version("hydroid"),
        "mujoco": version("mujoco"),
        "numpy": version("numpy"),
        "python": platform.python_version(),
        "seed": settings.search.seed,
        "logs": {log.source: log_hash(log) for log in logs},
    }


def was_fitted(run: Path, log: Log) -> bool | None:
    """Return whether the run in a folder was fitted to a log; None where the folder holds no run."""
    try:
        known = json.loads((run / DESCRIPTION).read_text(encoding="utf-8"))["logs"]
    except (OSError, ValueError, LookupError, TypeError):
        return None
    return log_hash(log) in known.values() if isinstance(known, dict) else None


def _other_logs(before: dict[str, str], now: dict[str, str]) -> str:
    """Say how the logs' contents differ, empty if they do not; the files may have moved."""
    if list(before.values()) == list(now.values()):
        return ""
    if len(before) != len(now):
        return f"{len(before)} of them, now {len(now)}"
    if sorted(before.values()) == sorted(now.values()):
        return f"their order was {', '.join(before)}"
    changed = next((b, n) for b, n in zip(before, now, strict=True) if before[b] != now[n])
    return f"{changed[1]} is not the {changed[0]} of the run, or its content has changed"


def own_hashes(folder: Path) -> dict[str, str]:
    """Return hashes of the settings and the model in a run folder, by file."""
    files = [folder / name for name in (CONFIG, ARM, MODEL)]
    files += sorted((folder / MODEL).parent.glob("meshes/*"))
    return {f.relative_to(folder).as_posix(): file_hash(f) for f in files if f.is_file()}


def refuse_other_run(
    folder: Path, then: dict[str, Any], before: FitSettings, settings: FitSettings, logs: Sequence[Log]
) -> None:
    """Refuse to continue the run in a folder where anything that decides its result is another.

    Args:
        folder: of the run.
        then: its description.
        before: its settings.
        settings: of now.
        logs: of now.

    Raises:
        RunError: other logs, versions, settings, another arm or model, or a file of the run that was changed.
    """
    other = "choose another folder"
    now = identity(settings, logs)
    for key in ("hydroid", "mujoco"):
        if then.get(key) != now[key]:
            what = f"holds a run of {key} {then.get(key)}, this is {now[key]}"
            raise RunError(what, where=str(folder), hint=other)
    if difference := _other_logs(then.get("logs", {}), now["logs"]):
        raise RunError(f"holds a run of other logs: {difference}", where=str(folder), hint=other)
    hashes = own_hashes(folder)
    for name, known in then.get("files", {}).items():
        if hashes.get(name) != known:
            hint = f"put it back as it was, or {other}"
            raise RunError("has changed since the run began", where=str(folder / name), hint=hint)
    for key, old, new in other_settings(before, settings):
        hint = (
            f"to continue it with the settings it was started with, give only --resume and --out; or {other}"
        )
        what = f"this run was started with {key} = {old}, but your command gives {new}"
        raise RunError(what, where=str(folder), hint=hint)
    if settings.arm.model.resolve() == (folder / MODEL).resolve():
        return
    arms = (arm.file.model_dump(mode="json", exclude=set(ELSEWHERE)) for arm in (before.arm, settings.arm))
    for key, old, new in _differences(*arms):
        hint = f"continue it with its own arm, or {other}"
        raise RunError(f"holds a run of an arm with {key} = {old}, now {new}", where=str(folder), hint=hint)
    if model_hash(settings.arm) != then.get("origin"):
        hint = f"resume it by its folder alone, or {other}"
        what = f"holds a run of another model than {settings.arm.model} is now"
        raise RunError(what, where=str(folder), hint=hint)


def other_settings(then: FitSettings, now: FitSettings) -> list[tuple[str, Any, Any]]:
    """Return the settings that differ and change the result, with their values."""
    return [d for d in _differences(portable(then), portable(now)) if not d[0].startswith(FREE)]


def model_hash(arm: Arm) -> str:
    """Return the hash of the arm's MJCF and of its meshes."""
    spec = load_model(arm)
    folder = Path(spec.modelfiledir) / spec.meshdir
    return file_hash(arm.model, *(folder / mesh.file for mesh in spec.meshes if mesh.file))


def file_hash(*files: Path) -> str:
    """Return the SHA-256 of the files' contents."""
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def log_hash(log: Log) -> str:
    """Return the hash of the log's file, or of its samples where it has none."""
    if is_file(Path(log.source)):
        return file_hash(Path(log.source))
    return hashlib.sha256(np.column_stack([log.time, log.command, log.angle]).tobytes()).hexdigest()


def _differences(old: Any, new: Any) -> list[tuple[str, Any, Any]]:
    before, after = _flat(old), _flat(new)
    keys = sorted(before.keys() | after.keys())
    return [(k, before.get(k), after.get(k)) for k in keys if before.get(k) != after.get(k)]


def _flat(values: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(values, dict):
        return {prefix: values}
    return {
        k: v for key, inner in values.items() for k, v in _flat(inner, f"{prefix}.{key}".lstrip(".")).items()
    }
