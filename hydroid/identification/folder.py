"""The run folder: what was asked, with what, how far it came, and what came out."""

import hashlib
import io
import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

import hydroid
from hydroid.arm.model import load_model
from hydroid.errors import RunError
from hydroid.files import write_atomic
from hydroid.identification.fit import Fit
from hydroid.identification.problem import Memo, Problem
from hydroid.identification.search import Checkpoint, SearchState
from hydroid.search.algorithm import Population
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.fit import FitSettings
from hydroid.settings.load import load, read_yaml


@dataclass(frozen=True)
class RunFolder:
    """A folder that one fit owns."""

    path: Path

    @property
    def exists(self) -> bool:
        """Whether a run has begun here."""
        return (self.path / "run.json").is_file()

    def begin(self, settings: FitSettings, arm: Arm, logs: Sequence[Path]) -> None:
        """Write what the run is: settings, the arm it is about, versions, seed, hashes of the logs.

        Raises:
            RunError: the folder cannot be written, or holds other files.
        """
        if self.path.exists() and (not self.path.is_dir() or any(self.path.iterdir())):
            raise RunError("exists and holds no run", where=str(self.path), cure="choose another --out")
        self._write_model(load_model(arm.model, arm))
        local = arm.model_copy(update={"model": Path("model/arm.xml"), "meshes": Path("model/meshes")})
        self._write_yaml("arm.yaml", local.model_dump(mode="json"))
        self._write_yaml("config.yaml", _portable(settings))
        self.write("run.json", json.dumps(_identity(settings, logs) | {"status": "running"}, indent=2) + "\n")

    def check(self, settings: FitSettings, logs: Sequence[Path]) -> None:
        """Refuse to continue a run that was another one.

        Raises:
            RunError: other settings, another log, another version; each with its name.
        """
        then = self.identity()
        now = _identity(settings, logs)
        for key in ("hydroid", "mujoco", "logs"):
            if then.get(key) != now[key]:
                raise RunError(
                    f"holds a run with other {key}: {then.get(key)}, now {now[key]}",
                    where=str(self.path),
                    cure="choose another --out",
                )
        self._refuse_other_settings(settings)

    def identity(self) -> dict[str, Any]:
        """Read run.json.

        Raises:
            RunError: missing or damaged.
        """
        file = self.path / "run.json"
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            cure = "name a folder that `hydroid fit-mech --out` has made"
            raise RunError(
                f"no run can be read ({getattr(error, 'strerror', None) or 'it is damaged'})",
                where=str(file),
                cure=cure,
            ) from None
        if not isinstance(content, dict):
            raise RunError("is not a run's description", where=str(file))
        return content

    def settings(self, overrides: dict[str, Any] | None = None) -> tuple[FitSettings, Arm]:
        """Read back the resolved settings, some of them replaced, and the arm."""
        self.identity()  # says what is wrong where the folder holds no run
        return load(self.path / "config.yaml", FitSettings, overrides), load_arm(self.path / "arm.yaml")

    def estimate(self) -> dict[str, Any]:
        """Read the final parameters by name.

        Raises:
            RunError: the run is not finished, or its estimate is damaged.
        """
        file = self.path / "estimate.yaml"
        if not file.exists():
            raise RunError("has no estimate yet", where=str(self.path), cure="finish the fit with --resume")
        parameters = read_yaml(file)[0].get("parameters")
        if not isinstance(parameters, dict):
            raise RunError("holds no parameters", where=str(file))
        return parameters

    def write_estimate(self, problem: Problem, fit: Fit) -> None:
        """Write `estimate.yaml` (the final parameters, every other estimate, flags) and the fitted MJCF."""
        mapping = problem.parameters.mapping
        names = problem.parameters.names
        content = {
            "stage": problem.settings.stage,
            "final": fit.final,
            "parameters": mapping(fit.best.theta),
            "units": {p.name: p.unit for p in problem.parameters.parameters},
            "standard_deviation": mapping(fit.uncertainty.standard_deviation),
            "interval_95": {
                name: [float(low), float(high)]
                for name, (low, high) in zip(names, fit.uncertainty.interval, strict=True)
            },
            "flags": {n: list(f) for n, f in zip(names, fit.uncertainty.flags, strict=True) if f},
            "not_determined": [direction.words for direction in fit.identifiability.weak],
            "without_effect": [n for n, none in zip(names, fit.without_effect, strict=True) if none],
            "estimates": {
                e.name: {
                    "parameters": mapping(e.theta),
                    "rms_deg": float(np.rad2deg(e.rms)),
                    "norm": e.overall,
                }
                for e in fit.estimates.values()
            },
        }
        self._write_yaml("estimate.yaml", content)
        spec = load_model(self.path / "model" / "arm.xml", load_arm(self.path / "arm.yaml"))
        problem.stage.write_into(spec, fit.best.theta)
        self._write_xml(spec, "fitted.xml")

    def status(self, word: str) -> None:
        """Record how far the run is: running, interrupted or done."""
        self.write("run.json", json.dumps(self.identity() | {"status": word}, indent=2) + "\n")

    def write(self, name: str, content: str | bytes) -> None:
        """Write one file of the run."""
        write_atomic(self.path / name, content)

    def save(self, state: SearchState, memo: Memo) -> None:
        """Write the checkpoint, atomically, as npz without pickle."""
        theta, values = memo.arrays()
        buffer = io.BytesIO()
        np.savez(
            buffer,
            chromosomes=state.population.chromosomes,
            objectives=state.population.objectives,
            history=state.history,
            memo_theta=theta,
            memo_values=values,
            rng=np.frombuffer(json.dumps(state.rng).encode(), dtype=np.uint8),
        )
        self.write("checkpoint.npz", buffer.getvalue())

    def checkpoint(self) -> Checkpoint | None:
        """Read the checkpoint; None where the run was stopped before its first.

        Raises:
            RunError: the file is damaged.
        """
        file = self.path / "checkpoint.npz"
        if not file.exists():
            return None
        try:
            with np.load(file, allow_pickle=False) as data:
                population = Population(data["chromosomes"], data["objectives"])
                rng = json.loads(data["rng"].tobytes())
                state = SearchState(population, rng, data["history"])
                return Checkpoint(state, (data["memo_theta"], data["memo_values"]))
        except Exception as error:  # a damaged zip fails in many ways; all mean the same to the user
            cure = "remove it to begin again from the seed"
            raise RunError(f"is damaged ({type(error).__name__})", where=str(file), cure=cure) from None

    def _refuse_other_settings(self, settings: FitSettings) -> None:
        then, _ = self.settings()
        old, new = _flat(_portable(then)), _flat(_portable(settings))
        for key in sorted(old.keys() | new.keys()):
            # threads and memory change nothing in the result
            if old.get(key) != new.get(key) and key not in ("simulation.threads", "simulation.chunk_mib"):
                raise RunError(
                    f"holds a run with {key} = {old.get(key)}, now {new.get(key)}",
                    where=str(self.path),
                    cure="continue it with its own settings, or choose another --out",
                )

    def _write_model(self, spec: mujoco.MjSpec) -> None:
        """Copy the MJCF with its meshes, so that the run can be read where the original is gone."""
        origin = Path(spec.modelfiledir) / spec.meshdir
        for mesh in spec.meshes:
            source = origin / mesh.file
            mesh.file = source.name
            self.write(f"model/meshes/{source.name}", source.read_bytes())
        self._write_xml(spec, "arm.xml")

    def _write_xml(self, spec: mujoco.MjSpec, name: str) -> None:
        spec.modelfiledir, spec.meshdir = str((self.path / "model").resolve()), "meshes"
        spec.compiler.savecompiled = spec.compiler.savecanonical = False  # canonical is six digits
        self.write(f"model/{name}", spec.to_xml())

    def _write_yaml(self, name: str, content: dict[str, Any]) -> None:
        self.write(name, yaml.safe_dump(content, sort_keys=False, allow_unicode=True))


def _portable(settings: FitSettings) -> dict[str, Any]:
    return settings.model_copy(update={"arm": "arm.yaml"}).model_dump(mode="json")


def _identity(settings: FitSettings, logs: Sequence[Path]) -> dict[str, Any]:
    return {
        "hydroid": hydroid.__version__,
        "mujoco": version("mujoco"),
        "numpy": version("numpy"),
        "python": platform.python_version(),
        "seed": settings.search.seed,
        "logs": {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in logs},
    }


def _flat(values: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(values, dict):
        return {prefix: values}
    return {
        k: v for key, inner in values.items() for k, v in _flat(inner, f"{prefix}.{key}".lstrip(".")).items()
    }
