"""Algorithms of the library pymoo (Blank and Deb 2020), by the names of their classes there."""

import difflib
import inspect
import pkgutil
import warnings
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.errors import SettingsError
from hydroid.search.library import LibraryAlgorithm, need
from hydroid.settings.search import PymooSettings

Float = NDArray[np.float64]

SEVERAL, ONE = "pymoo.algorithms.moo", "pymoo.algorithms.soo.nonconvex"
"""Where pymoo keeps algorithms for several objectives and for one."""

LEFT_OUT = {
    *("CMOPSO", "SPEA2"),  # draw from generators that no seed reaches (pymoo 0.6.2)
    "GDE32NN",  # fails on small fronts (pymoo 0.6.2)
    *("DNSGA2", "KGB"),  # for problems that change
    *("BGA", "BRKGA"),  # for other than real parameters
    *("ES", "SRES", "ISRES", "G3PCX"),  # generations of another size than the population
    *("CMAES", "BIPOPCMAES"),  # those of cma, on numpy's global generator
    "PINSGA2",  # asks a person
}
"""What cannot serve here: same seed, same bits; real parameters; a population simulated at once."""


def pymoo(settings: PymooSettings, parameters: int, objectives: int) -> LibraryAlgorithm:
    """The algorithm that the settings name, on the unit box.

    MOEAD is pymoo's ParallelMOEAD: whole populations, which are simulated together.

    Args:
        settings: name, population, generations.
        parameters: dimensions of the box.
        objectives: what one for several objectives is told; one for a single objective is told only that.

    Raises:
        SettingsError: pymoo is not installed, has no such algorithm, or the algorithm needs two objectives.
    """
    known = available()
    if settings.algorithm not in known:
        near = difflib.get_close_matches(settings.algorithm.upper(), known, n=1)
        raise SettingsError(
            f"no algorithm {settings.algorithm!r}" + (f"; did you mean {near[0]}?" if near else ""),
            where="search.pymoo.algorithm",
            hint=f"pymoo has: {', '.join(sorted(known))}",
        )
    kind, single = known[settings.algorithm]
    if not single and objectives < 2:
        raise SettingsError(
            f"{settings.algorithm} minimises several objectives, and there is one segment",
            where="search.pymoo.algorithm",
            hint="ask for more with objective.segments, or choose DE, PSO or cmaes",
        )
    count = 1 if single else objectives
    return LibraryAlgorithm(
        settings, lambda rng: _Pymoo(kind, settings, parameters, count, rng), single=single
    )


def available() -> dict[str, tuple[type[Any], bool]]:
    """Algorithms of the installed pymoo that can serve, by name, and whether they are for one objective.

    Raises:
        SettingsError: pymoo is not installed.
    """
    base = need("pymoo.core.algorithm", "moo").Algorithm
    found: dict[str, tuple[type[Any], bool]] = {}
    for folder in (SEVERAL, ONE):
        for name, kind in _classes(folder, base):
            accepted = _arguments(kind)
            needed = {n for n, p in accepted.items() if p.default is p.empty}
            if name not in LEFT_OUT and "pop_size" in accepted and needed <= {"pop_size", "ref_dirs"}:
                found[name] = (kind, folder == ONE)
    if "ParallelMOEAD" in found:
        found["MOEAD"] = found.pop("ParallelMOEAD")
    return found


def directions(count: int, objectives: int) -> Float:
    """Reference directions: points spread over the unit simplex, the same in every run.

    The middle, then one after the other the candidate farthest from all chosen ones; among the candidates are
    the corners. pymoo's own spread takes seconds, and fails from some twenty objectives on (0.6.2).

    Returns:
        Shape (count, objectives), rows of sum 1.
    """
    rng = np.random.default_rng(0)
    flat = rng.standard_exponential((max(2000, 50 * count), objectives))
    candidates = np.vstack([np.eye(objectives), flat / flat.sum(axis=1, keepdims=True)])
    chosen = [np.full(objectives, 1.0 / objectives)]
    distance = np.full(len(candidates), np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, np.linalg.norm(candidates - chosen[-1], axis=1))
        chosen.append(candidates[distance.argmax()])
    return np.array(chosen)


class _Pymoo:
    def __init__(
        self, kind: type[Any], settings: PymooSettings, parameters: int, objectives: int, rng: Generator
    ) -> None:
        need("pymoo.config", "moo").Config.warnings["not_compiled"] = False  # else it prints a hint
        problem = need("pymoo.core.problem", "moo").Problem(
            n_var=parameters, n_obj=objectives, n_ieq_constr=0, xl=0.0, xu=1.0
        )
        accepted = _arguments(kind)
        options: dict[str, Any] = {"seed": int(rng.integers(2**32))}
        if "ref_dirs" in accepted:
            options["ref_dirs"] = directions(settings.population, objectives)
        if "ref_dirs" not in accepted or accepted["pop_size"].default is not None:
            options["pop_size"] = settings.population
        self._algorithm = kind(**options)
        self._algorithm.setup(problem, termination=("n_gen", 1 + settings.generations), verbose=False)
        self._asked: Any = None

    def ask(self) -> Float:
        """Return the next population; none once no new points can be bred."""
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            self._asked = self._algorithm.ask()
        return np.empty((0, 0)) if self._asked is None else self._asked.get("X").astype(float)

    def tell(self, objectives: Float) -> None:
        """Take all objectives, shape (n, m)."""
        static = need("pymoo.problems.static", "moo").StaticProblem(self._algorithm.problem, F=objectives)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            self._algorithm.evaluator.eval(static, self._asked)
            self._algorithm.tell(infills=self._asked)


def _classes(folder: str, base: type[Any]) -> list[tuple[str, type[Any]]]:
    """Algorithms defined in a folder's modules; a module whose own needs are not installed is passed over."""
    found: list[tuple[str, type[Any]]] = []
    for module in pkgutil.iter_modules(need(folder, "moo").__path__, f"{folder}."):
        try:
            content = vars(need(module.name, "moo"))
        except Exception:
            continue
        found += [
            (name, value)
            for name, value in list(content.items())
            if inspect.isclass(value) and issubclass(value, base) and value.__module__ == module.name
        ]
    return found


def _arguments(kind: type[Any]) -> dict[str, inspect.Parameter]:
    """What the constructor takes, and what it hands on to those of its bases; the nearest one wins."""
    found: dict[str, inspect.Parameter] = {}
    for base in kind.__mro__:
        if "__init__" not in vars(base):
            continue
        parameters = list(inspect.signature(vars(base)["__init__"]).parameters.values())[1:]
        named = [p for p in parameters if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
        found = {p.name: p for p in named} | found
        if len(named) == len(parameters):
            break
    return found
