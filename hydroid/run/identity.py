"""What makes a run that run: settings, arm, logs and versions."""

import hashlib
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.arm.model import load_model
from hydroid.files import is_file
from hydroid.identified_model import ARM, CONFIG, MODEL, portable
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings

DESCRIPTION = "run.json"
"""name of the file that describes the run: versions, seed, hashes of its logs and files, status, seconds"""


def identity(settings: FitSettings, logs: Sequence[Log]) -> dict[str, Any]:
    """Return versions, the settings that decide, and hashes of the logs and of the arm's model."""
    versions = {name: version(name) for name in ("hydroid", "mujoco", "numpy")}
    return versions | {
        "python": platform.python_version(),
        "seed": settings.search.seed,
        "logs": {log.source: log_hash(log) for log in logs},
        "origin": model_hash(settings.arm),
        "settings": deciding(settings),
    }


def deciding(settings: FitSettings) -> dict[str, Any]:
    """Return the settings that decide a result, and the arm's.

    Without threads and unused searches, and without where the arm's files are.
    """
    values, search = portable(settings), settings.search.algorithm
    del values["simulation"]["threads"]
    values["search"] = {n: v for n, v in values["search"].items() if n == search or not isinstance(v, dict)}
    return values | {"arm": settings.arm.model_dump(mode="json", exclude={"model", "pair"})}


def difference(run: Mapping[str, Any], other: Mapping[str, Any], but: str = "") -> str:
    """Say what makes a run another one, as "has search.seed = 1, not 2"; empty where nothing does.

    Both are identities. The setting `but` may differ.
    """
    for key in ("hydroid", "mujoco"):
        if run.get(key) != other.get(key):
            return f"was made by {key} {run.get(key)}, not {other.get(key)}"
    logs, others = run.get("logs", {}), other.get("logs", {})
    if [*logs.values()] != [*others.values()]:  # the files may have moved
        return f"has other logs, or others' contents: {', '.join(logs)}, not {', '.join(others)}"
    one, two = _flat(run.get("settings")), _flat(other.get("settings"))
    for key in sorted(one.keys() | two.keys()):
        if one.get(key) != two.get(key) and key != but:
            return f"has {key} = {one.get(key)}, not {two.get(key)}"
    return "" if run.get("origin") == other.get("origin") else "has another model of the arm"


def own_hashes(folder: Path) -> dict[str, str]:
    """Return hashes of the settings and the model in a run folder, by file."""
    files = [folder / name for name in (CONFIG, ARM, MODEL)]
    files += sorted((folder / MODEL).parent.glob("meshes/*"))
    return {f.relative_to(folder).as_posix(): _file_hash(f) for f in files if f.is_file()}


def model_hash(arm: Arm) -> str:
    """Return the hash of the arm's MJCF and of its meshes."""
    spec = load_model(arm)
    folder = Path(spec.modelfiledir) / spec.meshdir
    return _file_hash(arm.model, *(folder / mesh.file for mesh in spec.meshes if mesh.file))


def log_hash(log: Log) -> str:
    """Return the hash of the log's file, or of its samples where it has none."""
    return _file_hash(Path(log.source)) if is_file(Path(log.source)) else samples_hash(log)


def samples_hash(log: Log) -> str:
    """Return the hash of a log's samples, wherever they are from."""
    return hashlib.sha256(np.column_stack([log.time, log.command, log.angle]).tobytes()).hexdigest()


def _file_hash(*files: Path) -> str:
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def _flat(values: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(values, dict):
        return {prefix: values}
    inner = (_flat(value, f"{prefix}.{key}".lstrip(".")) for key, value in values.items())
    return {key: value for flat in inner for key, value in flat.items()}
