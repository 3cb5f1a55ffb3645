"""A refinement that goes on where it was stopped."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import step_log
from small_fits import TRUTH

from hydroid import load_settings
from hydroid.errors import RunError
from hydroid.fitting.memo import Memo
from hydroid.fitting.multistart import Multistart
from hydroid.fitting.refinement import Refinement, refine
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.run.checkpoint import RefinementCheckpoints
from hydroid.settings.search import RefinementSettings

SHORT = RefinementSettings(iterations=6)


class Counted(Problem):
    """Counts the candidates that it simulates."""

    simulated = 0

    def residuals(self, theta):
        self.simulated += len(theta)
        return super().residuals(theta)


@pytest.fixture(scope="module", params=["no prior", "a prior"])
def problem(request, arm):
    priors = {} if request.param == "no prior" else {"link 3": {"of": "M3", "value": 22.0, "sd": 0.5}}
    settings = load_settings("article-mech", {"priors": priors})
    log = simulate_log(settings, step_log(arm.pose("study"), [60.0, -80.0]), TRUTH, "truth")
    noise = np.random.default_rng(0).normal(0, 1e-3, log.angle.shape)
    return Counted(settings, [replace(log, angle=log.angle + noise)])


def begin(problem) -> np.ndarray:
    return 0.8 * problem.parameters.vector(TRUTH, "truth")


def equal(one: Refinement, other: Refinement) -> bool:
    return np.array_equal(one.point, other.point) and str(one) == str(other)


def stop_after(limit: int):
    def progress(simulated: int, rms: float) -> None:
        if simulated > limit:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("limit", [0, 10, 25])
def test_an_interrupted_refinement_goes_on_without_loss(problem, tmp_path, limit):
    file = tmp_path / "refinement.npz"
    problem.simulated = 0
    whole = refine(problem, begin(problem), SHORT, lambda n, rms: None)
    assert whole.evaluations == problem.simulated
    problem.simulated = 0
    with pytest.raises(KeyboardInterrupt):
        refine(problem, begin(problem), SHORT, stop_after(limit), RefinementCheckpoints(file, "a"))
    parts = refine(problem, begin(problem), SHORT, lambda n, rms: None, RefinementCheckpoints(file, "a"))
    assert equal(parts, whole)
    assert problem.simulated == whole.evaluations
    again = refine(problem, begin(problem), SHORT, lambda n, rms: None, RefinementCheckpoints(file, "a"))
    assert equal(again, whole)
    assert problem.simulated == whole.evaluations  # the result itself is kept


def test_another_refinement_has_a_checkpoint_of_its_own(problem, tmp_path):
    checkpoints = RefinementCheckpoints(tmp_path / "refinement.npz", "a")
    refine(problem, begin(problem), SHORT, lambda n, rms: None, checkpoints, "one")
    other = refine(problem, 1.1 * begin(problem), SHORT, lambda n, rms: None, checkpoints, "another")
    assert equal(other, refine(problem, 1.1 * begin(problem), SHORT, lambda n, rms: None))


@pytest.mark.parametrize("keep", [0.0, 0.5, 0.99])
def test_a_damaged_checkpoint_is_put_aside_and_the_refinement_done_again(tmp_path, keep, caplog):
    file = tmp_path / "refinement.npz"
    RefinementCheckpoints(file, "a")["x"] = {"point": np.arange(100.0)}
    assert "x" in RefinementCheckpoints(file, "a")
    content = file.read_bytes()
    file.write_bytes(content[: int(keep * len(content))])
    assert "x" not in RefinementCheckpoints(file, "a")
    assert "is damaged" in caplog.text
    assert not file.exists()


def test_the_checkpoint_of_another_run_is_refused(tmp_path):
    RefinementCheckpoints(tmp_path / "r.npz", "a")["x"] = {"point": np.arange(3.0)}
    with pytest.raises(RunError, match="another run"):
        RefinementCheckpoints(tmp_path / "r.npz", "b")


def test_a_start_that_was_interrupted_goes_on_within_it(problem, tmp_path):
    changes = {"starts": 1, "iterations": 3, "horizons": [0.25]}
    settings = problem.settings.search.model_copy(update={"algorithm": "multistart"})
    settings = settings.model_copy(update={"multistart": settings.multistart.model_copy(update=changes)})

    def search(progress, checkpoints):
        made = Multistart(problem, settings, Memo(problem), progress, checkpoints)
        return made.run(None, lambda state, memo: None, lambda row: None)

    whole = search(lambda n, rms: None, RefinementCheckpoints(tmp_path / "whole.npz", "a"))
    with pytest.raises(KeyboardInterrupt):
        search(stop_after(30), RefinementCheckpoints(tmp_path / "parts.npz", "a"))
    parts = search(lambda n, rms: None, RefinementCheckpoints(tmp_path / "parts.npz", "a"))
    np.testing.assert_array_equal(parts.population.chromosomes, whole.population.chromosomes)
    np.testing.assert_array_equal(parts.history, whole.history)
