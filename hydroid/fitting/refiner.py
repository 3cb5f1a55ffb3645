"""Least squares of one model of a fit after another."""

from collections.abc import Callable, Mapping, Sequence

from hydroid.arrays import Array, record
from hydroid.fitting.checkpoints import Checkpoints
from hydroid.fitting.refinement import Refinement, refine
from hydroid.fitting.step import Step
from hydroid.fitting.watcher import Watcher
from hydroid.posterior.error_model import Likelihood, make_likelihood
from hydroid.problem.problem import Problem
from hydroid.search.descent import Ending
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings

FIRST = 10
"""iterations that show whether another beginning is worth more of them"""
FIRM = 1e-3
"""gain below which least squares ends where another model may follow"""


@record
class Place:
    """A model of a fit, and a point of it.

    Attributes:
        step: the model and its terms.
        problem: with the settings of that model.
        theta: the point, shape (P,).
    """

    step: Step
    problem: Problem
    theta: Array

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters by name."""
        return self.problem.parameters.mapping(self.theta)

    def lacking(self, terms: Sequence[str]) -> list[str]:
        """Return the terms that its model does not have."""
        return [term for term in terms if term not in self.step.terms]


class Refiner:
    """Refines the models of a fit, shows the progress, and stores checkpoints.

    Each least squares begins at a theta, shape (P,), and has the step's name. It ends
    early on the way to another one (`FIRM`).

    Attributes:
        whole: the problem of the whole fit, with every term.
        leads_on: whether least squares of all joints is done more than once, so that
            only the last one need be exact.
        late: whether time is up: what was refined last has then not ended.
    """

    def __init__(
        self,
        whole: Problem,
        settings: RefinementSettings,
        watch: Watcher,
        checkpoints: Checkpoints,
    ) -> None:
        self.whole = whole
        self.leads_on = _leads_on(whole.settings)
        self.late = False
        self._to_the_end = settings
        self._on_the_way = settings
        if self.leads_on:
            tolerance = max(FIRM, settings.gain_tolerance)
            self._on_the_way = settings.changed({"gain_tolerance": tolerance})
        self._watch = watch
        self._checkpoints = checkpoints

    def problem_of(self, step: Step) -> Problem:
        """Return the problem with the model and the terms of a step."""
        return self.whole.varied(self.whole.settings.of_estimate(step.estimate))

    def on_the_way(
        self,
        problem: Problem,
        theta: Array,
        step: Step,
        how: Callable[..., Refinement] = refine,
    ) -> Refinement:
        """Refine a model that another one may follow."""
        likelihood = make_likelihood(problem)
        return self._refined(likelihood, theta, self._on_the_way, step, how)

    def to_the_end(self, problem: Problem, theta: Array, step: Step) -> Refinement:
        """Refine a model to the tolerance of the settings."""
        likelihood = make_likelihood(problem)
        return self._refined(likelihood, theta, self._to_the_end, step)

    def at_first(self, problem: Problem, theta: Array, step: Step) -> Refinement:
        """Refine a model a little, by output errors."""
        few = self._on_the_way.changed({"iterations": FIRST})
        likelihood = make_likelihood(problem).of_output_errors
        return self._refined(likelihood, theta, few, step)

    def far_end(self, problem: Problem, theta: Array, step: Step) -> Refinement:
        """Return where output errors lead if they were independent."""
        afar = step.changed(phase="from afar")
        likelihood = make_likelihood(problem).of_independent_errors
        return self._refined(likelihood, theta, self._on_the_way, afar)

    def anew(self, problem: Problem, theta: Array, step: Step) -> Refinement:
        """Refine from where output errors lead if they were independent."""
        far = self.far_end(problem, theta, step)
        near = problem.parameters.from_unit(far.point)
        return self.on_the_way(problem, near, step)

    def _refined(
        self,
        likelihood: Likelihood,
        theta: Array,
        settings: RefinementSettings,
        step: Step,
        how: Callable[..., Refinement] = refine,
    ) -> Refinement:
        result = how(
            likelihood, theta, settings, self._watch.refining, self._checkpoints, step
        )
        self.late |= result.ending is Ending.TIME
        return result


def _leads_on(settings: FitSettings) -> bool:
    """Return whether a fit has further models, terms, or starts."""
    choices = settings.rungs[1:] or settings.terms() or settings.by_command_terms
    return bool(choices) or settings.search.algorithm == "multistart"
