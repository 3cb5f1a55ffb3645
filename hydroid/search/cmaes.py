"""CMA-ES: the evolution strategy with covariance matrix adaptation (Hansen), of the library cma."""

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.search.library import LibraryAlgorithm, need
from hydroid.settings.search import PopulationSettings

Float = NDArray[np.float64]

SIGMA = 0.3
"""standard deviation of the first population around its mean in the unit box"""


def cmaes(settings: PopulationSettings, parameters: int, start: Float | None = None) -> LibraryAlgorithm:
    """CMA-ES on the unit box of so many parameters, from a start, shape (p,), or from its middle.

    Raises:
        SettingsError: cma is not installed.
    """
    cma = need("cma", "cma")
    mean = np.full(parameters, 0.5) if start is None else start
    return LibraryAlgorithm(settings, lambda rng: _Cmaes(cma, settings, mean, rng), single=True)


class _Cmaes:
    def __init__(self, cma: Any, settings: PopulationSettings, mean: Float, rng: Generator) -> None:
        options = {
            "bounds": [0.0, 1.0],
            "popsize": settings.population,
            "maxiter": np.inf,  # generations are counted outside
            "seed": np.nan,  # leave numpy's global generator alone
            "randn": lambda *shape: rng.standard_normal(shape),
            "verbose": -10,  # below -9, no file of signals is looked for in the working folder either
            "verb_log": 0,
            # a generation that diverged throughout is flat, and no sign of having converged
            "tolflatfitness": np.inf,
            "tolfun": 0.0,
        }
        self._strategy = cma.CMAEvolutionStrategy(mean, SIGMA, options)

    def ask(self) -> Float:
        """Return the next population, none once cma finds itself converged."""
        self._asked = [] if self._strategy.stop() else self._strategy.ask()
        return np.array(self._asked)

    def tell(self, objectives: Float) -> None:
        """Take the one objective, shape (n, 1)."""
        self._strategy.tell(self._asked, objectives[:, 0].tolist())
