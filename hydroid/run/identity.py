"""What makes a run that run: settings, arm, logs and versions; and refusing to continue another one."""

import hashlib
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import hydroid
from hydroid.arm.model import load_model
from hydroid.errors import RunError
from hydroid.identified import portable
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings


def identity(settings: FitSettings, logs: Sequence[Path]) -> dict[str, Any]:
    """Versions, seed, and hashes of the logs."""
    return {
        "hydroid": hydroid.__version__,
        "mujoco": version("mujoco"),
        "numpy": version("numpy"),
        "python": platform.python_version(),
        "seed": settings.search.seed,
        "logs": {str(path): file_hash(path) for path in logs},
    }


def refuse_other_identity(
    where: Path, then: dict[str, Any], settings: FitSettings, logs: Sequence[Path]
) -> None:
    """Raise RunError where other logs or versions decide the result."""
    now = identity(settings, logs)
    for key in ("hydroid", "mujoco", "logs"):
        if then.get(key) != now[key]:
            raise RunError(
                f"holds a run with other {key}: {then.get(key)}, now {now[key]}",
                where=str(where),
                hint="choose another --out",
            )


def refuse_other_settings(where: Path, then: FitSettings, now: FitSettings) -> None:
    """Raise RunError with the first setting that differs and changes the result."""
    for key, old, new in other_settings(then, now):
        raise RunError(
            f"holds a run with {key} = {old}, now {new}",
            where=str(where),
            hint="continue it with its own settings, or choose another --out",
        )


def other_settings(then: FitSettings, now: FitSettings) -> list[tuple[str, Any, Any]]:
    """The settings that differ and change the result, with their values; threads, memory and jobs do not."""
    return [
        (key, old, new)
        for key, old, new in _differences(portable(then), portable(now))
        if not key.startswith("cluster.") and key not in ("simulation.threads", "simulation.chunk_mib")
    ]


def refuse_other_arm(where: Path, then: Arm, now: Arm, model: str | None) -> None:
    """Raise RunError with the first of the arm's settings that differs, or where its model's hash does."""
    old, new = (a.model_dump(mode="json", exclude={"model", "meshes"}) for a in (then, now))
    for key, before, after in _differences(old, new):
        raise RunError(
            f"holds a run of an arm with {key} = {before}, now {after}",
            where=str(where),
            hint="continue it with its own arm, or choose another --out",
        )
    if model_hash(now) != model:
        hint = "continue it by `--resume --out` alone, or choose another --out"
        raise RunError(f"holds a run of another model than {now.model} is now", where=str(where), hint=hint)


def model_hash(arm: Arm) -> str:
    """Hash of the arm's MJCF and of its meshes."""
    spec = load_model(arm.model, arm)
    folder = Path(spec.modelfiledir) / spec.meshdir
    return file_hash(arm.model, *(folder / mesh.file for mesh in spec.meshes if mesh.file))


def file_hash(*files: Path) -> str:
    """SHA-256 of the files' contents."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


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
