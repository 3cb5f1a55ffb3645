"""Settings of the searches; the defaults are the article's table 5, and ours where it is silent."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from hydroid.settings.load import Settings

Rate = Annotated[float, Field(ge=0, le=1)]


class PopulationSettings(Settings):
    """What all searches by populations share: their size and how long they run."""

    population: Annotated[int, Field(ge=2, le=100_000)]
    generations: Annotated[int, Field(ge=0)]
    """Populations bred after the first one. Ours: all defaults cost about 2,800 simulations."""


class GeneticSettings(PopulationSettings):
    """What both genetic algorithms share: coding and operators."""

    crossover_rate: Rate
    """Chance P_c that a pair of parents crosses; otherwise its children are copies."""
    mutation_rate: Rate
    """Chance P_m that one element (one parameter) of a child changes."""
    coding: Literal["binary", "integer"] = "binary"
    """Binary: 16 Gray-coded bits a parameter, the article's MVBS. Integer: one number a parameter."""
    crossover: Literal["pointwise", "uniform"] = "pointwise"
    points: Annotated[int, Field(ge=1)] = 2
    """Cuts of the pointwise crossover (the article gives no number)."""


class GaSettings(GeneticSettings):
    """The simple genetic algorithm, article 4.1."""

    population: Annotated[int, Field(ge=2, le=100_000)] = 70
    generations: Annotated[int, Field(ge=0)] = 40
    crossover_rate: Rate = 0.8
    mutation_rate: Rate = 0.05
    elitism: Annotated[int, Field(ge=0)] = 1
    """Best candidates carried over unchanged (the article is silent)."""
    target: float | None = None
    """The search stops once its best objective is this low."""

    @model_validator(mode="after")
    def _someone_new(self) -> "GaSettings":
        if self.elitism >= self.population:
            raise ValueError("elitism must leave room for children: below population")
        return self


class Nsga2Settings(GeneticSettings):
    """The multi-objective genetic algorithm, article 4.2.

    Table 5 says "proportional" parent selection here too. With several objectives there is no one
    fitness to be proportional to, and the article names NSGA-II: parents come from its crowded tournament.
    """

    population: Annotated[int, Field(ge=2, le=100_000)] = 20
    generations: Annotated[int, Field(ge=0)] = 140
    crossover_rate: Rate = 0.4
    mutation_rate: Rate = 0.2


class CmaesSettings(PopulationSettings):
    """CMA-ES (Hansen), of the library cma: one objective, the error over the whole record."""

    population: Annotated[int, Field(ge=6, le=100_000)] = 20
    generations: Annotated[int, Field(ge=0)] = 140
    """The search ends before, where cma finds that it has converged."""
    sigma: Annotated[float, Field(gt=0, le=1)] = 0.3
    """Standard deviation of the first population about the middle of the bounds, in terms of their widths."""


class PymooSettings(PopulationSettings):
    """An algorithm of the library pymoo."""

    algorithm: str = "NSGA3"
    """Its class there: NSGA3, MOEAD, RVEA, AGEMOEA, SMSEMOA, ... with the segments as objectives; DE, PSO,
    GA, ... with the error over the whole record."""
    population: Annotated[int, Field(ge=4, le=100_000)] = 40
    generations: Annotated[int, Field(ge=0)] = 70


class MultistartSettings(Settings):
    """Bounded least squares from several random starts (ours; not in the article)."""

    starts: Annotated[int, Field(ge=1, le=100_000)] = 10
    horizons: tuple[Annotated[float, Field(gt=0)], ...] = (0.25, 1.0, 5.0)
    """Seconds of every log, from its first command on, that a start is fitted to before the whole logs."""
    iterations: Annotated[int, Field(ge=1)] = 40
    """Steps at most, of each of these fits."""
    step_tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-4
    """As the refinement's; coarser, since the refinement follows from the best point found."""

    @property
    def generations(self) -> int:
        """Starts after the first: what other searches call generations."""
        return self.starts - 1


class RefinementSettings(Settings):
    """The bounded least squares that starts from a search's estimate (ours; not in the article)."""

    iterations: Annotated[int, Field(ge=1)] = 100
    step_tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-14
    """Relative length of a step, in units of the bounds' widths, below which the refinement ends."""
