"""The runs of a study: each is a fit of one cell and one seed, and leaves one small file.

A file's name is a digest of all that decides its content: settings, arm, data and versions. So a study that
was killed goes on where it was, and studies in one folder share the runs that they have in common.
"""

import hashlib
import json
import math
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from hydroid.errors import RunError
from hydroid.estimate import finite
from hydroid.fitting.fit import fit
from hydroid.log import Log
from hydroid.problem.problem import Problem
from hydroid.run.identity import deciding, model_hash, samples_hash
from hydroid.search.compromise import segment_best
from hydroid.settings.fit import FitSettings

Result = dict[str, Any]
"""what `perform` returns, or {"failed": why}"""


@dataclass(frozen=True, eq=False)
class Task:
    """One run: a cell, a seed, the settings with it, and the logs."""

    cell: str
    seed: int
    settings: FitSettings
    logs: tuple[Log, ...]

    def key(self) -> str:
        """Return the digest of all that decides the run's result."""
        content = {
            "versions": {name: version(name) for name in ("hydroid", "mujoco", "numpy")},
            "settings": deciding(self.settings),
            "model": model_hash(self.settings.arm),
            "logs": [samples_hash(log) for log in self.logs],
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:24]


def perform(task: Task) -> Result:
    """Fit, and return what a study needs of the run, as plain values.

    `measures` are those of docs/studies.md, by name. `history` has generation, simulations and best
    objective; `segment_bests` are the parameters of the best candidate of each segment, as `theta` are those
    of the estimate.

    Raises:
        RunError: every candidate diverged.
    """
    problem = Problem(task.settings, task.logs)
    result = fit(problem)
    if not result.best.usable:
        raise RunError("the estimate diverged when it was simulated")
    error = problem.residuals(result.best.theta[None])[0]
    angles = np.degrees(
        np.concatenate([error[c.rows] / c.weight for c in problem.channels if c.quantity == "angle"])
    )
    front, evaluation = result.front
    unit = 1.0 if task.settings.objective.relative else 180 / math.pi
    refined = sum(r.evaluations for r in result.refinements.values())
    measures = {
        "objective": unit * result.best.overall,
        "largest error": float(np.abs(angles).max()),
        "mean absolute error": float(np.abs(angles).mean()),
        "rms error": float(np.sqrt(np.mean(angles**2))),
        "simulations": int(result.history[-1, 2]) + refined,
        "diverged": int(result.history[-1, 3]),
        "seconds": round(sum(result.seconds.values()), 3),
    }
    bests = front[segment_best(evaluation.segments)]
    return {
        "measures": measures,
        "theta": problem.parameters.mapping(result.best.theta),
        "segment_bests": [problem.parameters.mapping(theta) for theta in bests],
        "history": [[int(g), int(n), finite(unit * best)] for g, _, n, _, best, _ in result.history],
    }
