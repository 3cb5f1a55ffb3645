"""Algorithms of the library pymoo (Blank and Deb 2020): those of this table, each of which is tested."""

import warnings
from collections.abc import Generator as Context
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.search.library import LibraryAlgorithm, need
from hydroid.settings.search import PymooSettings

Float = NDArray[np.float64]

ALGORITHMS = {
    "DE": "soo.nonconvex.de.DE",
    "PSO": "soo.nonconvex.pso.PSO",
    "NSGA3": "moo.nsga3.NSGA3",
    "MOEAD": "moo.moead.ParallelMOEAD",  # asks for whole populations, MOEAD for one point
    "RVEA": "moo.rvea.RVEA",
    "AGEMOEA": "moo.age.AGEMOEA",
    "SMSEMOA": "moo.sms.SMSEMOA",
}
"""Module and class below `pymoo.algorithms`, by the name in the settings; `soo`: for one objective."""
DIRECTED = ("NSGA3", "MOEAD", "RVEA")
"""These take reference directions, one per candidate."""


def pymoo(
    settings: PymooSettings, parameters: int, objectives: int, start: Float | None = None
) -> LibraryAlgorithm:
    """The algorithm that the settings name, on the unit box.

    Args:
        settings: name, population, generations.
        parameters: dimensions of the box.
        objectives: number of them; an algorithm for one objective gets only one.
        start: point that joins the first population, shape (parameters,).

    Raises:
        SettingsError: pymoo is not installed, or the algorithm needs more objectives.
    """
    name = settings.algorithm
    single = ALGORITHMS[name].startswith("soo")
    if not single and objectives < 2:
        raise SettingsError(
            f"{name} minimises several objectives, and there is one segment",
            where="search.pymoo.algorithm",
            hint="ask for more with objective.segments, or choose DE, PSO or cmaes",
        )
    need("pymoo.config", "moo").Config.warnings["not_compiled"] = False  # else it prints a hint
    several, count = 1 if single else objectives, settings.population

    def begin(rng: Generator) -> _Pymoo:
        options: dict[str, Any] = {"seed": int(rng.integers(2**32))}
        options |= {"ref_dirs": directions(count, several)} if name in DIRECTED else {"pop_size": count}
        if start is not None:
            options["sampling"] = np.vstack([start, rng.random((count - 1, parameters))])
        module, _, kind = ALGORITHMS[name].rpartition(".")
        algorithm = getattr(need(f"pymoo.algorithms.{module}", "moo"), kind)(**options)
        box = {"n_var": parameters, "n_obj": several, "n_ieq_constr": 0, "xl": 0.0, "xu": 1.0}
        problem = need("pymoo.core.problem", "moo").Problem(**box)
        algorithm.setup(problem, termination=("n_gen", 1 + settings.generations), verbose=False)
        return _Pymoo(algorithm)

    return LibraryAlgorithm(settings, begin, single=single)


def directions(count: int, objectives: int) -> Float:
    """Reference directions: points spread over the unit simplex, the same in every run.

    The middle, then one after the other the point farthest from all chosen ones; among the points are the
    corners. pymoo's own method takes seconds, and fails from some twenty objectives on (0.6.2).

    Returns:
        Shape (count, objectives), rows of sum 1.
    """
    rng = np.random.default_rng(0)
    flat = rng.standard_exponential((max(2000, 50 * count), objectives))
    points = np.vstack([np.eye(objectives), flat / flat.sum(axis=1, keepdims=True)])
    chosen = [np.full(objectives, 1.0 / objectives)]
    distance = np.full(len(points), np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, np.linalg.norm(points - chosen[-1], axis=1))
        chosen.append(points[distance.argmax()])
    return np.array(chosen)


class _Pymoo:
    def __init__(self, algorithm: Any) -> None:
        self._algorithm, self._asked = algorithm, None

    def ask(self) -> Float:
        """Return the next population; none once no new points can be bred."""
        with _silent():
            self._asked = self._algorithm.ask()
        return np.empty((0, 0)) if self._asked is None else self._asked.get("X").astype(float)

    def tell(self, objectives: Float) -> None:
        """Take all objectives, shape (n, m)."""
        static = need("pymoo.problems.static", "moo").StaticProblem(self._algorithm.problem, F=objectives)
        with _silent():
            self._algorithm.evaluator.eval(static, self._asked)
            self._algorithm.tell(infills=self._asked)


@contextmanager
def _silent() -> Context[None]:
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield
