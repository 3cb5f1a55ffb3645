"""Settings of the searches; the defaults are the article's table 5, and ours where it is silent."""

from typing import Annotated, Literal

from pydantic import Field

from hydroid.settings.load import Settings

Rate = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1)]
Population = Annotated[int, Field(ge=4, le=100_000)]
Generations = Annotated[int, Field(ge=0)]


class GeneticSettings(Settings):
    """A genetic algorithm of the article.

    For NSGA-II table 5 says "proportional" parent selection too. With several objectives there is no one
    fitness to be proportional to, and the article names NSGA-II: parents come from its crowded tournament.
    """

    population: Population = 70
    """number of candidates in a population"""
    generations: Generations = 40
    """number of populations after the first one"""
    crossover_rate: Rate = 0.8
    """probability P_c that a pair of parents is crossed; otherwise its children are copies"""
    mutation_rate: Rate = 0.05
    """probability P_m that an element (one parameter) of a child changes"""
    coding: Literal["binary", "integer"] = "binary"
    """binary: 16 Gray-coded bits per parameter, the article's MVBS; integer: one number per parameter"""
    crossover: Literal["pointwise", "uniform"] = "pointwise"
    """pointwise: cut parents at two places; uniform: choose each element from either parent"""


class ParetoSettings(GeneticSettings):
    """The same for several objectives."""

    population: Population = 20
    generations: Generations = 140
    crossover_rate: Rate = 0.4
    mutation_rate: Rate = 0.2


class MultistartSettings(Settings):
    """Bounded least squares from several random start points (ours; not in the article)."""

    starts: Annotated[int, Field(ge=1, le=100_000)] = 10
    """number of start points"""
    horizons: tuple[Annotated[float, Field(gt=0)], ...] = (0.25, 1.0, 5.0, 20.0)
    """lengths of the logs' beginnings that a start is fitted to before the whole logs, from the first
    command on [s]; those in which nothing moves yet are left out"""
    iterations: Count = 100
    """largest number of steps of each of these fits"""
    gain_tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-4
    """as the refinement's; coarser, since the refinement starts from the best result"""

    @property
    def generations(self) -> int:
        """Starts after the first: what other searches call generations."""
        return self.starts - 1


class RefinementSettings(Settings):
    """The refinement: bounded least squares that start from the search's estimate (ours; not in the
    article)."""

    iterations: Count = 300
    """largest number of steps; a step takes one to three simulations, some a Jacobian besides"""
    gain_tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-8
    """the refinement ends where a step promises to lower the sum of squared errors by less than this
    fraction"""


class SearchSettings(Settings):
    """The search: its algorithm, its seed, and how one estimate is taken from a Pareto set."""

    algorithm: Literal["ga", "nsga2", "multistart"] = "nsga2"
    """the search algorithm; its settings stand under the same name"""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    """seed of all random numbers"""
    compromise: Literal["average", "utopia", "best"] = "average"
    """average: mean of the best candidates of all segments, the article's; utopia: candidate nearest to
    the utopia point; best: candidate of the lowest norm"""
    ga: GeneticSettings = GeneticSettings()
    """the simple genetic algorithm, article 4.1"""
    nsga2: ParetoSettings = ParetoSettings()
    """the multi-objective genetic algorithm NSGA-II, article 4.2"""
    multistart: MultistartSettings = MultistartSettings()
