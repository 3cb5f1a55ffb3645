"""The run folder: what makes a run that run, how far it came, and what came out."""

import hashlib
import json
import os
import platform
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hydroid.arm.model import load_model
from hydroid.arrays import record
from hydroid.errors import RunError, Stopped
from hydroid.estimate import DESCRIPTION, NAME, write_estimate
from hydroid.files import PART, Plain, is_file, read_file, write_atomic
from hydroid.identified_model import (
    MODEL,
    IdentifiedModel,
    file_hash,
    own_hashes,
    portable,
    write_settings,
)
from hydroid.log import Log
from hydroid.parallel.workers import VERSIONS
from hydroid.plant import Plant
from hydroid.progress import LOGGER
from hydroid.run.archive import CheckpointFile
from hydroid.run.process import LOCK, locked, run_log
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings
from hydroid.words import numbered


def identity(settings: FitSettings, logs: Sequence[Log]) -> Plain:
    """Return versions, the settings that decide, and hashes of the logs and of the
    arm's model."""
    hashes = [log_hash(log, settings) for log in logs]
    return VERSIONS | {
        "python": platform.python_version(),
        "seed": settings.search.seed,
        "logs": dict(zip(numbered(log.source for log in logs), hashes, strict=True)),
        "origin": model_hash(settings.arm),
        "settings": deciding(settings),
    }


def deciding(settings: FitSettings) -> Plain:
    """Return the settings that decide a result, the arm's too: no threads, unused
    searches, or paths."""
    values = portable(settings)
    del values["simulation"]["threads"]
    used = settings.search.algorithm
    values["search"] = {
        name: value
        for name, value in values["search"].items()
        if name == used or not isinstance(value, dict)
    }
    arm = settings.arm.model_dump(mode="json", exclude={"model", "pair"})
    return values | {"arm": arm}


def difference(run: Mapping[str, Any], other: Mapping[str, Any], but: str = "") -> str:
    """Say what makes a run another one, as "has search.seed = 1, not 2"; empty where
    nothing does.

    Both are identities. The setting `but` may differ.
    """
    for key in VERSIONS:
        # a run of an earlier hydroid names fewer of them
        named = key in run and key in other
        if named and run[key] != other[key]:
            return f"was made by {key} {run[key]}, not {other[key]}"
    logs = run.get("logs", {})
    other_logs = other.get("logs", {})
    # the files may have moved
    if [*logs.values()] != [*other_logs.values()]:
        names = ", ".join(logs)
        return (
            f"has other logs, or others' contents: {names}, not {', '.join(other_logs)}"
        )
    # dotted keys, as `--set` takes them, so that the message can be acted on
    settings = _flat(run.get("settings"))
    other_settings = _flat(other.get("settings"))
    for key in sorted(settings.keys() | other_settings.keys()):
        if settings.get(key) != other_settings.get(key) and key != but:
            return f"has {key} = {settings.get(key)}, not {other_settings.get(key)}"
    if run.get("origin") != other.get("origin"):
        return "has another model of the arm"
    return ""


def model_hash(arm: Arm) -> str:
    """Return the hash of the arm's MJCF and of its meshes."""
    spec = load_model(arm)
    folder = Path(spec.modelfiledir) / spec.meshdir
    # a mesh may be given by its vertices, without a file
    meshes = [folder / mesh.file for mesh in spec.meshes if mesh.file]
    return file_hash(arm.model, *meshes)


def log_hash(log: Log, settings: FitSettings) -> str:
    """Return the hash of all of a log that decides a result: samples, and what its name
    stands for.

    A file that was moved or saved again is the same log, and one that was repaired is
    another.
    """
    payload = settings.payload_of(log.source) or None
    named = repr((payload, settings.log.group_of(log.source)))
    return hashlib.sha256(samples(log) + named.encode()).hexdigest()


def samples(log: Log) -> bytes:
    """Return the digest of a log's samples, wherever they are from."""
    shape = repr((log.period, log.rest, log.angle.shape))
    content = hashlib.sha256(shape.encode())
    signals = [log.time, log.command, log.angle, log.pressure, log.recorded]
    for signal in (*signals, log.conditions):
        if signal is not None:
            content.update(signal.tobytes())
    return content.digest()


def digest(content: Plain) -> str:
    """Return the digest of a mapping, whatever the order of its keys."""
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _names(values: Any) -> bool:
    """Return whether values as JSON holds them are texts by name."""
    return isinstance(values, dict) and all(
        isinstance(value, str) for value in values.values()
    )


def _flat(values: Any, prefix: str = "") -> Plain:
    """Return the values of nested mappings by dotted key."""
    if not isinstance(values, dict):
        return {prefix: values}
    flat: Plain = {}
    for key, value in values.items():
        flat |= _flat(value, f"{prefix}.{key}".lstrip("."))
    return flat


@record
class RunFolder:
    """A folder that one fit owns."""

    path: Path

    @property
    def exists(self) -> bool:
        """Whether a run has begun here."""
        return is_file(self.path / DESCRIPTION)

    @contextmanager
    def owned(self) -> Generator[None]:
        """Hold the folder against other processes,
        and write the `hydroid` logger's lines to `run.log`."""
        if self._is_of_others():
            raise RunError(
                "exists and holds no run", self.path, "choose another folder with --out"
            )
        with locked(self.path), run_log(self.path / "run.log"):
            # nobody else writes here
            for part in self.path.rglob(f".*{PART}"):
                LOGGER.info(
                    "removed %s, left by a process that was killed while it wrote",
                    part.name,
                )
                part.unlink(missing_ok=True)
            try:
                yield
            except KeyboardInterrupt:
                LOGGER.info("interrupted")
                raise Stopped(self.interrupt()) from None
            except Exception as error:
                LOGGER.error("ended by %s: %s", type(error).__name__, error)
                raise
            LOGGER.info("done")

    def _is_of_others(self) -> bool:
        """Return whether the folder holds something else.

        It is the run's if it is empty, or holds a run's description or at least its
        lock.
        """
        if not os.path.exists(self.path):
            return False
        if self.exists or (self.path / LOCK).exists():
            return False
        return not self.path.is_dir() or any(self.path.iterdir())

    def begin(self, settings: FitSettings, logs: Sequence[Log]) -> CheckpointFile:
        """Describe a new run, or check that the run here is the same; return its
        checkpoints."""
        wanted = identity(settings, logs)
        if not self.exists:
            write_settings(self.path, settings)
            self._describe(
                wanted | {"files": own_hashes(self.path), "status": "running"}
            )
            return self.checkpoints()
        self.refuse_changes()
        # resumed with its own config.yaml: the model is its own copy, to the last bit
        if (self.path / MODEL).samefile(settings.arm.model):
            wanted["origin"] = self.identity().get("origin")
        other = difference(self.identity(), wanted)
        if other:
            hint = (
                "continue it with the command that began it, or choose another folder"
            )
            raise RunError(f"the run here {other}", self.path, hint)
        checkpoints = self.checkpoints()
        self.status("running")
        LOGGER.info("resumed from %s", ", ".join(checkpoints) or "no checkpoint")
        return checkpoints

    def refuse_changes(self) -> None:
        """Refuse a run whose settings or model were changed since it began."""
        hashes = own_hashes(self.path)
        for name, stored in self.identity().get("files", {}).items():
            if hashes.get(name) != stored:
                hint = "put it back as it was, or choose another folder"
                raise RunError(
                    "has changed since the run began", self.path / name, hint
                )

    def identity(self) -> Plain:
        """Read the run's description."""
        file = self.path / DESCRIPTION
        try:
            content = json.loads(read_file(file))
        except (OSError, ValueError, RecursionError) as error:
            why = getattr(error, "strerror", None) or "it is damaged"
            hint = "name a folder that a fit has made"
            raise RunError(f"cannot be read as a run ({why})", file, hint) from None
        if not isinstance(content, dict):
            raise RunError("is not a run's description", file)
        if not all(_names(content.get(key, {})) for key in ("logs", "files")):
            raise RunError("is not a run's description", file)
        return content

    def write_estimate(self, model: IdentifiedModel, log: Log) -> None:
        """Write `estimate.yaml` of a fit's model,
        and the fitted arm in `model/` as it began a log."""
        write_estimate(self.path, model.summarise())
        payload = model.settings.payload_of(log.source)
        plant = Plant(model, payload=payload)
        plant.reset(log.start)
        plant.export(self.path / "model")

    def status(self, word: str, **more: Any) -> None:
        """Record whether the run is running, interrupted or done, and more about it."""
        if is_file(self.path / NAME):
            more["estimate"] = file_hash(self.path / NAME)
        self._describe(self.identity() | {"status": word} | more)

    def interrupt(self) -> str:
        """Record the status `interrupted`, and return what is kept,
        empty where nothing was written."""
        if not self.exists:
            return ""
        self.status("interrupted")
        kept = "a checkpoint" if self.checkpoints() else "no checkpoint yet"
        return f"{self.path} holds {kept}; the same command with --resume continues"

    def checkpoints(self) -> CheckpointFile:
        """Return what the run's search and refinements have stored, by name."""
        # checkpoints belong to a run by what does not change while it goes on
        lasting = self.identity()
        for key in ("status", "seconds", "estimate", "finished"):
            lasting.pop(key, None)
        return CheckpointFile(self.path / "checkpoint.npz", digest(lasting))

    def _describe(self, content: Plain) -> None:
        write_atomic(self.path / DESCRIPTION, json.dumps(content, indent=2) + "\n")
