"""Priors: single parameters, and linear combinations or ratios of them, that are known
besides the logs.

Each has a value and a standard deviation; a combination without one is a constraint. A
search stays where every prior holds within REACH standard deviations. The refinement
and the uncertainty take each as one more measurement.

One with heavy tails knows its scatter only roughly: it is Student's t with FREEDOM
degrees of freedom, a normal distribution whose variance is drawn, and the draw is
integrated out. The variance of the m bends of one curve is drawn once: a curve with one
bend may have others, and one without is held straight by all of them. Of m distances r
in units of the scale the negative logarithm is

    ½ (ν + m) log(1 + r'r/ν),

which is half the square of its scores, so that least squares minimises it. Such a prior
confines no search.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hydroid.arrays import Array, Mask, record
from hydroid.errors import SettingsError
from hydroid.parameters import Parameter, ParameterSet, Prior
from hydroid.settings.problem import PriorSettings

REACH = 2.0  # standard deviations that a candidate of a search may be away from a prior
CONSTRAINT_SD = 1e-5
"""standard deviation of a constraint, as a part of the range that its parameters'
bounds allow"""
FREEDOM = 2.0
"""degrees of freedom ν of a prior with heavy tails: 10 % of its values are beyond 3
scales, 1 % beyond 10"""
# projections on all priors in turn; two that are nearly parallel need the most
MAX_SWEEPS = 200


@record
class _Combination:
    """A prior on factors·theta, or on a ratio a / b.

    A ratio has the factors of a - value b and the column of b as `divisor`.
    step: the shortest change in the box of the free parameters that raises
    factors·theta by 1, shape (P,).
    """

    factors: Array
    value: float
    sd: float
    divisor: int | None
    step: Array

    def excess(self, theta: Array) -> Array:
        """Distance from the value, shape (n,), times the divisor if any."""
        # the sum along the last axis is the same for any number of rows; a matrix
        # product may not be
        return (theta * self.factors).sum(axis=1) - self.value

    def tolerance(self, theta: Array) -> Array:
        """Excess of one standard deviation, shape (n,)."""
        if self.divisor is None:
            return self.sd * np.ones(len(theta))
        return self.sd * theta[:, self.divisor]

    def distances(self, theta: Array) -> Array:
        """Distance from the value in standard deviations, shape (n, 1)."""
        deviations = self.excess(theta) / self.tolerance(theta)
        return deviations[:, None]


@record
class _Bends:
    """What a curve bends from one of its parts to the next: the columns of their
    factors, in order."""

    columns: list[int]
    sd: float

    def distances(self, theta: Array) -> Array:
        """Logarithms of the ratios of neighbours, the last one to 1, over the scale:
        (n, P) -> (n, m)."""
        logs = np.log(theta[:, self.columns])
        # the last part of a curve has the factor 1, whose logarithm is 0
        last = np.zeros((len(theta), 1))
        ahead = np.hstack([logs[:, 1:], last])
        return (logs - ahead) / self.sd


@record
class _Heavy:
    """A prior with heavy tails on the m distances of another one."""

    inner: _Combination | _Bends

    def distances(self, theta: Array) -> Array:
        """Scores, (n, m)."""
        distances = self.inner.distances(theta)
        square = (distances * distances).sum(axis=1, keepdims=True)
        # log(1 + x)/x is 1 there to the last digit
        far = np.maximum(square / FREEDOM, 1e-12)
        count = distances.shape[1]
        shrinking = np.log1p(far) / far
        return distances * np.sqrt((FREEDOM + count) / FREEDOM * shrinking)

    def weight(self, theta: Array) -> float:
        """Factor on distances at one theta, (1, P), by which a normal prior has the
        same slope there."""
        distances = self.inner.distances(theta)[0]
        square = distances @ distances
        weight = (FREEDOM + len(distances)) / (FREEDOM + square)
        return float(np.sqrt(weight))


class Priors:
    """Priors about P parameters, with M scores in all; those about fixed parameters
    only are left out.

    Those of single parameters come first. `searched` are the parameters with bounds
    within REACH of these, `names` those of the priors by score, and `firm` says which
    scores are those of normal distributions.
    """

    def __init__(
        self, settings: Mapping[str, PriorSettings], parameters: ParameterSet
    ) -> None:
        self._single = dict[int, Prior]()
        searched = list(parameters.parameters)
        for column, p in enumerate(parameters.parameters):
            if p.prior is not None and p.fixed is None:
                self._single[column] = p.prior
                # a search that draws beyond would spend itself on what nobody believes
                lower = max(p.lower, p.prior.value(-REACH))
                upper = min(p.upper, p.prior.value(REACH))
                searched[column] = replace(p, lower=lower, upper=upper)
        self.searched = ParameterSet(tuple(searched))
        self._combinations = list[_Combination]()
        self._several = list[_Combination | _Heavy]()
        names = [parameters.names[column] for column in self._single]
        firm = [True] * len(self._single)
        for name, prior in settings.items():
            further = _prior_of_several(name, prior, self.searched)
            if further is None:
                continue
            self._several.append(further)
            if isinstance(further, _Combination):
                self._combinations.append(further)
            count = further.distances(self.searched.start[None]).shape[1]
            names += [name] * count
            firm += [isinstance(further, _Combination)] * count
        self.names = tuple(names)
        self.firm: Mask = np.array(firm, dtype=bool)
        if self._combinations:
            self._refuse_contradiction()

    def _refuse_contradiction(self) -> None:
        """Refuse combinations that no candidate within the bounds can meet at once."""
        nearest = self.project(self.searched.start[None])
        away = np.abs(self.scores(nearest)[0]) * self.firm
        worst = np.argmax(away)
        # projections end a little off
        if away[worst] > 1.5 * REACH:
            raise SettingsError(
                "cannot hold within the bounds together with the other priors",
                f"priors.{self.names[worst]}",
                "widen the bounds, correct the value, or give it a larger sd",
            )

    def __len__(self) -> int:
        return len(self.names)

    def scores(self, theta: Array) -> Array:
        """Return the distance from each prior's value in standard deviations; (n, P) ->
        (n, M).

        Those of a prior with heavy tails have half of their squares for its negative
        logarithm.
        """
        scores = self._single_scores(theta)
        scores += [prior.distances(theta) for prior in self._several]
        return np.hstack([np.empty((len(theta), 0)), *scores])

    def _single_scores(self, theta: Array) -> list[Array]:
        """Return the scores of the priors of single parameters, (n, 1) each."""
        scores = list[Array]()
        for column, prior in self._single.items():
            scores.append(prior.score(theta[:, [column]]))
        return scores

    def weighed_at(self, theta: Array) -> Callable[[Array], Array]:
        """Return scores, (n, P) -> (n, M), with priors of heavy tails as they act at
        theta, shape (P,).

        They are normal there, with the scatter that theta shows: their slopes are those
        of the negative logarithm, and their information is what theta's neighbours are
        known by.
        """
        weighed: list[tuple[_Combination | _Bends, float]] = []
        for prior in self._several:
            if isinstance(prior, _Heavy):
                weighed.append((prior.inner, prior.weight(theta[None])))
            else:
                weighed.append((prior, 1.0))

        def scores(near: Array) -> Array:
            rows = self._single_scores(near)
            rows += [weight * prior.distances(near) for prior, weight in weighed]
            return np.hstack([np.empty((len(near), 0)), *rows])

        return scores

    def project(self, theta: Array) -> Array:
        """Return theta, (n, P), moved by the shortest steps to within REACH sd of every
        combination.

        Projections on them in turn (S. Kaczmarz, 1937), within the bounds of
        `searched`. Each row is moved by itself.
        """
        if not self._combinations:
            return theta
        theta = theta.copy()
        free = self.searched.free
        low = self.searched.lower[free]
        high = self.searched.upper[free]
        for _ in range(MAX_SWEEPS):
            before = theta.copy()
            for combination in self._combinations:
                excess = combination.excess(theta)
                slack = REACH * combination.tolerance(theta)
                beyond = excess - np.clip(excess, -slack, slack)
                theta -= beyond[:, None] * combination.step
                theta[:, free] = np.clip(theta[:, free], low, high)
            if np.array_equal(theta, before):
                break
        return theta


def _prior_of_several(
    name: str, prior: PriorSettings, parameters: ParameterSet
) -> _Combination | _Heavy | None:
    """Return a prior on several parameters; None where all of them are fixed."""
    for parameter in prior.names:
        if parameter not in parameters.names:
            raise SettingsError(
                f"no parameter {parameter!r}",
                f"priors.{name}",
                f"parameters: {', '.join(parameters.names)}",
            )
    if prior.smooth is not None:
        return _bends(name, prior.smooth, prior.sd or 0.0, parameters)
    combination = _combination(prior, parameters)
    if combination is None or prior.tails == "normal":
        return combination
    return _Heavy(combination)


def _bends(
    name: str, smooth: Sequence[str], sd: float, parameters: ParameterSet
) -> _Heavy | None:
    """Return the prior on a curve's bends between the factors `smooth`; None where all
    of them are fixed."""
    columns = [parameters.names.index(factor) for factor in smooth]
    for column in columns:
        p = parameters.parameters[column]
        if _least(p) <= 0:
            raise SettingsError(
                f"{p.name} may be 0", f"priors.{name}.smooth", "give it bounds above 0"
            )
    if not parameters.free[columns].any():
        return None
    return _Heavy(_Bends(columns, sd))


def _least(parameter: Parameter) -> float:
    """Return the least value that a parameter can have."""
    if parameter.fixed is None:
        return parameter.lower
    return parameter.fixed


def _combination(prior: PriorSettings, parameters: ParameterSet) -> _Combination | None:
    """Return a combination; None where all of its parameters are fixed."""
    names = parameters.names
    free = parameters.free
    factors = np.array([prior.factors.get(name, 0.0) for name in names])
    if not factors[free].any():
        return None
    width = np.where(free, parameters.upper - parameters.lower, 0.0)
    # shortest in a box whose sides all count for 1
    in_box = factors * width
    step = factors * width**2 / np.sum(in_box**2)
    # a constraint is exact but for this: something must be left to divide by
    sd = prior.sd or CONSTRAINT_SD * float(np.abs(factors) @ width)
    if prior.ratio is None:
        return _Combination(factors, prior.value or 0.0, sd, None, step)
    divisor = names.index(prior.ratio[1])
    p = parameters.parameters[divisor]
    if _least(p) <= 0:
        raise SettingsError(f"a ratio divides by {p.name}, which may be 0", "priors")
    return _Combination(factors, 0.0, sd, divisor, step)
