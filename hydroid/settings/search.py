"""Settings of the searches, by default the article's table 5, and ours where it is
silent; and of designs."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from hydroid.settings.load import Joints, NotNegative, Positive, Settings

Rate = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1)]
Part = Annotated[float, Field(gt=0, lt=1)]
Population = Annotated[int, Field(ge=4, le=100_000)]
Generations = Annotated[int, Field(ge=0)]


class GeneticSettings(Settings):
    """A genetic algorithm of the article.

    For NSGA-II table 5 says "proportional" parent selection too. With several
    objectives there is no one fitness to be proportional to, and the article names
    NSGA-II: parents come from its crowded tournament.
    """

    population: Population = 70
    """number of candidates in a population"""
    generations: Generations = 40
    """number of populations after the first one"""
    crossover_rate: Rate = 0.8
    """probability P_c that a pair of parents is crossed; otherwise its children are
    copies"""
    mutation_rate: Rate = 0.05
    """probability P_m that an element (one parameter) of a child changes"""
    coding: Literal["binary", "integer"] = "binary"
    """binary: 16 Gray-coded bits per parameter, the article's MVBS; integer:
    one number per parameter"""
    crossover: Literal["pointwise", "uniform"] = "pointwise"
    """pointwise: cut parents at two places; uniform: choose each element from either
    parent"""


class ParetoSettings(GeneticSettings):
    """The same for several objectives."""

    population: Population = 20
    generations: Generations = 140
    crossover_rate: Rate = 0.4
    mutation_rate: Rate = 0.2


class PymooSettings(Settings):
    """A multi-objective algorithm of the package pymoo, beside NSGA-II (ours; not in
    the article).

    It needs `pip install 'hydroid[moo]'`.
    """

    algorithm: Literal["moead", "mopso-cd", "nsga3", "spea2"] = "moead"
    """moead: MOEA/D, by decomposition; mopso-cd: a particle swarm; nsga3: NSGA-III;
    spea2: SPEA2"""
    population: Population = 20
    """number of candidates in a population"""
    generations: Generations = 140
    """number of populations after the first one"""


class RefinementSettings(Settings):
    """The refinement: bounded least squares that start from the search's estimate
    (ours; not in the article)."""

    iterations: Count = 300
    """largest number of steps; a step takes one to three simulations, some a Jacobian
    besides"""
    gain_tolerance: Part = 1e-8
    """the refinement ends where a step promises to lower the sum of squared errors by
    less than this fraction"""


class MultistartSettings(RefinementSettings):
    """Bounded least squares from several random start points (ours; not in the
    article)."""

    starts: Annotated[int, Field(ge=1, le=100_000)] = 10
    """number of start points"""
    horizons: tuple[Positive, ...] = (0.25, 1.0, 5.0, 20.0)
    """lengths of the logs' beginnings that a start is fitted to before the whole logs,
    from the first command on [s]; those in which nothing moves yet are left out"""
    iterations: Count = 100
    """largest number of steps of each of these fits"""
    gain_tolerance: Part = 1e-4
    """as the refinement's; coarser, since the refinement starts from the best result"""

    @property
    def generations(self) -> int:
        """Starts after the first: what other searches call generations."""
        return self.starts - 1


class SearchSettings(Settings):
    """The search: its algorithm, its seed, and how one estimate is taken from a Pareto
    set."""

    algorithm: Literal["ga", "nsga2", "multistart", "pymoo"] = "nsga2"
    """the search algorithm; its settings stand under the same name"""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    """seed of all random numbers"""
    compromise: Literal["average", "utopia", "best"] = "average"
    """average: mean of the best candidates of all segments, the article's; utopia:
    candidate nearest to the utopia point; best: candidate of the lowest norm"""
    ga: GeneticSettings = GeneticSettings()
    """the simple genetic algorithm, article 4.1"""
    nsga2: ParetoSettings = ParetoSettings()
    """the multi-objective genetic algorithm NSGA-II, article 4.2"""
    multistart: MultistartSettings = MultistartSettings()
    pymoo: PymooSettings = PymooSettings()


class DesignSettings(Settings):
    """Settings of `hydroid design`, the search for the next experiment; a fit does not
    use them."""

    duration_s: Annotated[float, Field(ge=1, le=3600)] = 60.0
    """length of the experiment [s]"""
    joints: Annotated[Joints, Field(min_length=1)] | None = None
    """joints that may be driven; null: the outputs"""
    poses: Annotated[tuple[str, ...], Field(min_length=1)] | Literal["any"] | None = (
        None
    )
    """names of the arm's poses to start from; any: also random ones within the ranges;
    null: all named poses"""
    command_pct: Annotated[float, Field(gt=0, le=100)] = 100.0
    """largest command [%]"""
    rest_s: NotNegative = 1.0
    """time without a command at the beginning [s]; a fit takes its start pose from
    it"""
    slew_pct_s: Positive | None = 500.0
    """fastest change of a command [%/s]; null: it jumps"""
    dwell_s: tuple[Positive, Positive] = (1.0, 5.0)
    """shortest and longest time between two changes of a command [s];
    the shortest limits the bandwidth"""
    speed_deg_s: Positive = 30.0
    """largest joint speed in the simulated experiment [deg/s]; a joint that slides by
    1 m counts as one that turns by 1 rad"""
    margin_deg: NotNegative = 5.0
    """smallest distance of the simulated motion from the ends of the joints' ranges
    [deg]; of a joint that slides as for `speed_deg_s`"""
    clearance_m: Positive | None = 0.05
    """smallest distance of the simulated arm from itself and from the floor; where the
    arm's file has a pair, also from the carrier and the other arm, at rest in
    start_pose [m]; null: collisions are not checked"""
    noise_deg: Positive = 0.1
    """standard deviation of the angles' noise [deg]"""
    drift_deg: NotNegative = 0.0
    """standard deviation of the drift of a prediction after 10 s [deg]; 0: white noise
    alone"""
    effort: Annotated[int, Field(ge=2, le=1_000_000)] = 240
    """number of experiments that are tried: one in six, but 8 at least, drawn at random,
    the others changes of the best"""

    @model_validator(mode="after")
    def _ordered(self) -> "DesignSettings":
        if not self.dwell_s[0] <= self.dwell_s[1] <= self.duration_s:
            raise ValueError(
                "dwell_s must be [shortest, longest], not longer than duration_s"
            )
        if self.rest_s + self.dwell_s[0] > self.duration_s:
            raise ValueError("rest_s leaves no time for a command within duration_s")
        return self
