"""A refinement that goes on where it was stopped."""

import numpy as np
import pytest
from made_logs import TRUTH, noisy, stepped

from hydroid import load_settings
from hydroid.fitting.refinement import promised, refine
from hydroid.fitting.step import Step
from hydroid.posterior.error_model import make_likelihood
from hydroid.problem.problem import Problem
from hydroid.run.archive import CheckpointFile
from hydroid.search.descent import Descent
from hydroid.settings.search import RefinementSettings

SHORT = RefinementSettings(iterations=6)


class Counted(Problem):
    simulated = 0

    def output_errors(self, theta):
        self.simulated += len(theta)
        return super().output_errors(theta)


@pytest.fixture(scope="module", params=["no prior", "a prior"])
def problem(request):
    priors = (
        {}
        if request.param == "no prior"
        else {"link 3": {"of": "M3", "value": 22.0, "sd": 0.5}}
    )
    settings = load_settings("article-mech", {"priors": priors})
    return Counted(
        settings,
        [noisy(stepped(settings, TRUTH, [60.0, -80.0]), 0.06, exact_start=False)],
    )


ONE, OTHER = Step("refined"), Step("refined", horizon=1)


def begin(problem) -> np.ndarray:
    return 0.8 * problem.parameters.vector(TRUTH, "truth")


def equal(one: Descent, other: Descent) -> bool:
    return np.array_equal(one.point, other.point) and str(one) == str(other)


def stop_after(limit: int):
    def progress(what: Step, simulated: int, rms: float) -> None:
        if simulated > limit:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("limit", [0, 10, 25])
def test_an_interrupted_refinement_goes_on_without_loss(problem, tmp_path, limit):
    file = tmp_path / "refinement.npz"
    problem.simulated = 0
    whole = refine(
        make_likelihood(problem), begin(problem), SHORT, lambda *_: None, {}, ONE
    )
    assert whole.evaluations == problem.simulated
    problem.simulated = 0
    with pytest.raises(KeyboardInterrupt):
        refine(
            make_likelihood(problem),
            begin(problem),
            SHORT,
            stop_after(limit),
            CheckpointFile(file, "a"),
            ONE,
        )
    parts = refine(
        make_likelihood(problem),
        begin(problem),
        SHORT,
        lambda *_: None,
        CheckpointFile(file, "a"),
        ONE,
    )
    assert equal(parts, whole)
    simulated = problem.simulated
    # the steps since the last Jacobian are repeated
    assert simulated < whole.evaluations + limit + 12
    again = refine(
        make_likelihood(problem),
        begin(problem),
        SHORT,
        lambda *_: None,
        CheckpointFile(file, "a"),
        ONE,
    )
    assert equal(again, whole)
    assert problem.simulated == simulated  # the result itself is kept


def test_another_refinement_has_a_checkpoint_of_its_own(problem, tmp_path):
    checkpoints = CheckpointFile(tmp_path / "refinement.npz", "a")
    refine(
        make_likelihood(problem),
        begin(problem),
        SHORT,
        lambda *_: None,
        checkpoints,
        ONE,
    )
    other = refine(
        make_likelihood(problem),
        1.1 * begin(problem),
        SHORT,
        lambda *_: None,
        checkpoints,
        OTHER,
    )
    assert equal(
        other,
        refine(
            make_likelihood(problem),
            1.1 * begin(problem),
            SHORT,
            lambda *_: None,
            {},
            ONE,
        ),
    )


def test_parameters_promise_a_gain_only_off_their_optimum(problem):
    likelihood = make_likelihood(problem)
    settings = RefinementSettings(iterations=60)
    end = refine(likelihood, begin(problem), settings, lambda *_: None, {}, ONE)
    optimum = problem.parameters.from_unit(end.point)
    everything = np.ones(len(optimum), dtype=bool)
    half = np.arange(len(optimum)) % 2 == 0
    assert promised(likelihood, optimum, everything) < 0.01
    off = optimum * np.where(half, 0.9, 1.1)
    assert promised(likelihood, off, everything) > 0.5
    assert promised(likelihood, off, half) >= 0.0
    assert promised(likelihood, off, half) <= promised(likelihood, off, everything)
    assert promised(likelihood, off, ~everything) == 0.0
