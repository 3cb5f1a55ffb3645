"""The run folder: what was asked, with what, how far it came, and what came out."""

import hashlib
import json
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hydroid.arm.export import copy_model
from hydroid.arm.model import load_model
from hydroid.errors import RunError
from hydroid.estimate import write_estimate
from hydroid.files import remove_parts, write_atomic
from hydroid.fitting.fit import Fit
from hydroid.fitting.search import Checkpoint, SearchState
from hydroid.identified import IdentifiedModel, write_settings
from hydroid.plant import Plant
from hydroid.problem.problem import Memo, Problem
from hydroid.run.checkpoint import RefinementCheckpoints, read_checkpoint, write_checkpoint
from hydroid.run.identity import (
    file_hash,
    identity,
    model_hash,
    refuse_other_arm,
    refuse_other_identity,
    refuse_other_settings,
)
from hydroid.run.lock import LOCK, locked
from hydroid.run.run_log import run_log
from hydroid.run.summary import summarise
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load


@dataclass(frozen=True)
class RunFolder:
    """A folder that one fit owns."""

    path: Path

    @property
    def exists(self) -> bool:
        """Whether a run has begun here."""
        return (self.path / "run.json").is_file()

    @contextmanager
    def owned(self) -> Generator[None]:
        """Hold the folder against other processes, and write what happens meanwhile to `run.log`.

        Raises:
            RunError: another process holds it, it holds other files, or it cannot be written.
        """
        self._refuse_other_files()
        with locked(self.path), run_log(self.path / "run.log"):
            remove_parts(self.path)
            yield

    def begin(self, settings: FitSettings, logs: Sequence[Path]) -> None:
        """Write what the run is: settings, the arm it is about, versions, seed, hashes of the logs.

        Raises:
            RunError: the folder cannot be written, or holds other files.
        """
        self._refuse_other_files()
        copy_model(load_model(settings.arm.model, settings.arm), self.path / "model")
        write_settings(self.path, settings)
        files = {"files": self._hashes(), "origin": model_hash(settings.arm), "status": "running"}
        self.write("run.json", json.dumps(identity(settings, logs) | files, indent=2) + "\n")

    def check(self, settings: FitSettings, logs: Sequence[Path]) -> None:
        """Refuse to continue a run that was another one.

        Raises:
            RunError: other settings, another arm, another log, another version; each with its name.
        """
        then = self.identity()
        refuse_other_identity(self.path, then, settings, logs)
        self._refuse_changed_files(then.get("files", {}))
        theirs = self.settings()
        refuse_other_settings(self.path, theirs, settings)
        if settings.arm.model.resolve() != (self.path / "model" / "arm.xml").resolve():  # its own is its own
            refuse_other_arm(self.path, theirs.arm, settings.arm, then.get("origin"))

    def identity(self) -> dict[str, Any]:
        """Read run.json.

        Raises:
            RunError: missing or damaged.
        """
        file = self.path / "run.json"
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            hint = "name a folder that `hydroid fit-mech --out` has made"
            raise RunError(
                f"no run can be read ({getattr(error, 'strerror', None) or 'it is damaged'})",
                where=str(file),
                hint=hint,
            ) from None
        hashes = [content.get(key, {}) for key in ("logs", "files")] if isinstance(content, dict) else [None]
        if not all(isinstance(h, dict) and all(isinstance(v, str) for v in h.values()) for h in hashes):
            raise RunError("is not a run's description", where=str(file))
        return content

    def settings(self, overrides: dict[str, Any] | None = None) -> FitSettings:
        """Read back the resolved settings, some of them replaced."""
        self.identity()  # says what is wrong where the folder holds no run
        return load(self.path / "config.yaml", FitSettings, overrides)

    def write_estimate(self, problem: Problem, fit: Fit) -> None:
        """Write `estimate.yaml` and the fitted arm in `model/`."""
        write_estimate(self.path, summarise(problem, fit))
        log, settings = problem.logs[0], self.settings()
        theta = fit.best.theta
        driven = {int(j) + 1 for j in np.flatnonzero(log.driven)} | set(settings.outputs)
        payload = settings.payloads.get(Path(log.source).name, 0.0)
        source = str(self.path / "estimate.yaml")
        identified = IdentifiedModel(settings, theta, source)
        plant = Plant(identified, joints=sorted(driven), payload=payload)
        plant.reset(log.start)
        plant.export(self.path / "model")

    def status(self, word: str) -> None:
        """Record how far the run is: running, interrupted or done."""
        self.write("run.json", json.dumps(self.identity() | {"status": word}, indent=2) + "\n")

    def write(self, name: str, content: str | bytes) -> None:
        """Write one file of the run."""
        write_atomic(self.path / name, content)

    def save(self, state: SearchState, memo: Memo) -> None:
        """Write the checkpoint; the one before it is kept (see `checkpoint`)."""
        write_checkpoint(self.path / "checkpoint.npz", state, memo, self._id())

    def checkpoint(self) -> Checkpoint | None:
        """Read the newest checkpoint that is whole; None where the run was stopped before its first.

        Raises:
            RunError: none is whole.
        """
        return read_checkpoint(self.path / "checkpoint.npz", self._id())

    def refinements(self) -> RefinementCheckpoints:
        """How far the run's refinements are, by name."""
        return RefinementCheckpoints(self.path / "refinement.npz", self._id())

    def _id(self) -> str:
        """What tells this run's checkpoints from those of others."""
        identity = {key: value for key, value in self.identity().items() if key != "status"}
        return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()

    def _hashes(self) -> dict[str, str]:
        """What the run's own settings and model are, by file."""
        names = ("config.yaml", "arm.yaml", "model/arm.xml")
        files = [self.path / name for name in names]
        files += sorted((self.path / "model" / "meshes").glob("*"))
        return {f.relative_to(self.path).as_posix(): file_hash(f) for f in files if f.is_file()}

    def _refuse_changed_files(self, then: dict[str, str]) -> None:
        now = self._hashes()
        for name, known in then.items():
            if now.get(name) != known:
                hint = "put it back as it was, or choose another --out"
                raise RunError("has changed since the run began", where=str(self.path / name), hint=hint)

    def _refuse_other_files(self) -> None:
        """A folder is the run's where it is empty, or has the run's description or at least its lock."""
        if not self.path.exists() or self.exists or (self.path / LOCK).exists():
            return
        if not self.path.is_dir() or any(self.path.iterdir()):
            raise RunError("exists and holds no run", where=str(self.path), hint="choose another --out")
