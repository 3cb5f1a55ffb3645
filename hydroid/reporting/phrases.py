"""Labels of a fit's settings and estimates."""

import numpy as np

from hydroid.estimate import FitSummary
from hydroid.parameters import Array
from hydroid.settings.problem import ObjectiveSettings, PriorSettings
from hydroid.words import number

ALGORITHMS = {
    "ga": "simple genetic algorithm",
    "nsga2": "NSGA-II, a multi-objective genetic algorithm",
    "cmaes": "CMA-ES, an evolution strategy",
    "multistart": "bounded least squares from random starts",
}
_NORMS = {1: "mean absolute error", 2: "rms error", "inf": "largest error"}
_ESTIMATES = {
    "average": "mean of the best candidates of all segments, as in the article",
    "utopia": "candidate whose errors are nearest to the lowest error of every segment",
    "best": "candidate with the lowest error over the whole record",
    "refined": "least squares from the best of the estimates before it",
    "joint": "both stages refined together from 'refined'",
}


def estimate_meanings(summary: FitSummary) -> str:
    """Say what the names of a fit's estimates mean."""
    meanings = [f"{name}: {_ESTIMATES.get(name, name)}" for name in summary.estimates]
    return f"{'; '.join(meanings)}." if meanings else ""


def norm_label(objective: ObjectiveSettings) -> str:
    """Name the objective, with its unit."""
    label = _NORMS[objective.norm]
    return f"relative {label} [-]" if objective.relative else f"{label} [deg]"


def in_reader_units(objective: ObjectiveSettings, values: Array) -> Array:
    """Return objectives in deg, or as they are where relative."""
    return values if objective.relative else np.degrees(values)


def prior_phrase(prior: PriorSettings) -> str:
    """Write a prior as an equation."""
    if prior.ratio is not None:
        what = " / ".join(prior.ratio)
    else:
        terms = (n if f == 1 else f"{number(f)} {n}" for n, f in prior.factors.items())
        what = " + ".join(terms).replace("+ -", "- ")
    spread = ", exact" if prior.sd is None else f" ± {number(prior.sd)} (standard deviation)"
    return f"{what} = {number(prior.value)}{spread}"
