"""The run folder: what was asked, with what, how far it came, and what came out."""

import hashlib
import json
import logging
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydroid.arrays import Array
from hydroid.errors import RunError, Stopped
from hydroid.estimate import NAME, FitSummary, write_estimate
from hydroid.files import remove_parts, write_atomic
from hydroid.identified_model import CONFIG, IdentifiedModel, write_settings
from hydroid.log import Log
from hydroid.plant import Plant
from hydroid.run.archive import CheckpointFile
from hydroid.run.identity import DESCRIPTION, difference, identity, own_hashes
from hydroid.run.process import LOCK, locked, run_log
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RunFolder:
    """A folder that one fit owns."""

    path: Path

    @property
    def exists(self) -> bool:
        """Whether a run has begun here."""
        return (self.path / DESCRIPTION).is_file()

    @contextmanager
    def owned(self) -> Generator[None]:
        """Hold the folder against other processes, and write the `hydroid` logger's lines to `run.log`.

        Raises:
            RunError: another process holds it, it holds other files, or it cannot be written.
            Stopped: the run was interrupted; says what is kept.
        """
        # it is the run's if it is empty, or holds a run's description or at least its lock
        other = self.path.exists() and not (self.exists or (self.path / LOCK).exists())
        if other and (not self.path.is_dir() or any(self.path.iterdir())):
            hint = "choose another folder with --out"
            raise RunError("exists and holds no run", where=self.path, hint=hint)
        with locked(self.path), run_log(self.path / "run.log"):
            remove_parts(self.path)
            try:
                yield
            except KeyboardInterrupt:
                _log.info("interrupted")
                raise Stopped(self.interrupt()) from None
            except Exception as error:
                _log.error("ended by %s: %s", type(error).__name__, error)
                raise
            _log.info("done")

    def begin(self, settings: FitSettings, logs: Sequence[Log]) -> CheckpointFile:
        """Describe a new run, or check that the run here is the same; return its checkpoints.

        Raises:
            RunError: the run here had other settings, another arm, another log or another version, one of its
                files was changed, no checkpoint is whole, or the folder cannot be written.
        """
        own = identity(settings, logs)
        if not self.exists:
            write_settings(self.path, settings)
            self._describe(own | {"files": own_hashes(self.path), "status": "running"})
            return self.checkpoints()
        self.refuse_changes()
        if other := difference(self.identity(), own):
            hint = "continue it with the command that began it, or choose another folder"
            raise RunError(f"the run here {other}", where=self.path, hint=hint)
        checkpoints = self.checkpoints()
        self.status("running")
        _log.info("resumed from %s", ", ".join(checkpoints) or "no checkpoint")
        return checkpoints

    def refuse_changes(self) -> None:
        """Refuse a run whose settings or model were changed since it began.

        Raises:
            RunError: a file is gone, or is another.
        """
        hashes = own_hashes(self.path)
        for name, known in self.identity().get("files", {}).items():
            if hashes.get(name) != known:
                hint = "put it back as it was, or choose another folder"
                raise RunError("has changed since the run began", where=self.path / name, hint=hint)

    def identity(self) -> dict[str, Any]:
        """Read the run's description.

        Raises:
            RunError: missing or damaged.
        """
        file = self.path / DESCRIPTION
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            what = f"cannot be read as a run ({getattr(error, 'strerror', None) or 'it is damaged'})"
            raise RunError(what, where=file, hint="name a folder that a fit has made") from None
        if not (isinstance(content, dict) and isinstance(content.get("logs", {}), dict)):
            raise RunError("is not a run's description", where=file)
        return content

    def settings(self) -> FitSettings:
        """Read back the resolved settings.

        Raises:
            RunError, SettingsError: they are missing or damaged.
        """
        self.identity()  # raises the clearer error where the folder holds no run
        return load(self.path / CONFIG, FitSettings)

    def write_estimate(self, log: Log, theta: Array, summary: FitSummary) -> None:
        """Write `estimate.yaml`, and the fitted arm in `model/` as it began a log."""
        write_estimate(self.path, summary)
        settings = self.settings().of_estimate(summary.final)
        model = IdentifiedModel(settings, theta, str(self.path / NAME), summary)
        plant = Plant(model, payload=settings.payloads.get(Path(log.source).name, 0.0))
        plant.reset(log.start)
        plant.export(self.path / "model")

    def status(self, word: str, **more: Any) -> None:
        """Record whether the run is running, interrupted or done, and more about it."""
        self._describe(self.identity() | {"status": word} | more)

    def interrupt(self) -> str:
        """Record the status `interrupted`, and return what is kept, empty where nothing was written."""
        if not self.exists:
            return ""
        self.status("interrupted")
        kept = "a checkpoint" if self.checkpoints() else "no checkpoint yet"
        return f"{self.path} holds {kept}; the same command with --resume continues"

    def checkpoints(self) -> CheckpointFile:
        """Return what the run's search and refinements have stored, by name.

        Raises:
            RunError: no checkpoint is whole.
        """
        # what does not change while the run goes on
        fixed = {key: value for key, value in self.identity().items() if key not in ("status", "seconds")}
        run = hashlib.sha256(json.dumps(fixed, sort_keys=True).encode()).hexdigest()
        return CheckpointFile(self.path / "checkpoint.npz", run)

    def _describe(self, content: dict[str, Any]) -> None:
        write_atomic(self.path / DESCRIPTION, json.dumps(content, indent=2) + "\n")
