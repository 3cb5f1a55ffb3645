"""Candidates fail, runs do not: what diverged is counted, told, and never selected."""

import numpy as np
import pytest
from made_logs import TRUTH, stepped

from hydroid import load_settings
from hydroid.errors import HydroidError
from hydroid.findings import Finding
from hydroid.fitting.checkpoints import Memo
from hydroid.fitting.fit import fit
from hydroid.fitting.summary import fit_findings
from hydroid.problem.problem import Problem

STEPS = 2**16 - 1
"""of a parameter's 16 bits"""


class Fragile(Problem):
    """Every set with much damping diverges; so do all that no chromosome can write,
    where `grid` is on."""

    grid = False

    def bad(self, theta) -> np.ndarray:
        unit = self.parameters.to_unit(theta)
        off = np.abs(unit * STEPS - np.round(unit * STEPS)).max(axis=1) > 1e-6
        return (unit[:, 1] > 0.5) | (off & self.grid)

    def responses(self, theta):
        responses = super().responses(theta)
        for response in responses:
            response.angle[self.bad(theta)] = np.nan
        return responses


def make(kind=Fragile, **changes) -> Problem:
    small = {
        f"search.{algorithm}": {"population": 10, "generations": 5}
        for algorithm in ("ga", "nsga2")
    }
    small |= {"objective.segments": 3}
    settings = load_settings("article-mech", small | changes)
    return kind(settings, [stepped(settings, TRUTH, [60.0, -80.0, 30.0])])


@pytest.mark.parametrize("algorithm", ["ga", "nsga2"])
@pytest.mark.parametrize("refinement", [None, {"iterations": 3}])
def test_what_diverged_is_counted_and_told_and_never_an_estimate(algorithm, refinement):
    problem = make(**{"search.algorithm": algorithm, "refinement": refinement})
    stored = {}
    result = fit(problem, checkpoints=stored)
    theta, values = stored["search"].values()
    diverged = int(problem.bad(theta).sum())
    assert 0 < diverged < len(theta)
    assert result.history[-1, 3] == diverged == np.sum(~np.isfinite(values[:, -1]))
    assert all(e.usable and np.isfinite(e.overall) for e in result.estimates.values())
    assert not problem.bad(np.array([e.theta for e in result.estimates.values()])).any()
    front, objectives = result.front
    assert not problem.bad(front).any()
    assert np.isfinite(objectives).all()
    np.testing.assert_array_equal(
        Memo(problem, stored["search"]).evaluate(theta)[:, -1], values[:, -1]
    )
    assert np.isfinite(result.history[:, 4:]).all()


def test_a_compromise_that_diverges_gives_way_to_one_that_does_not():
    """The mean of the best sets is none of the sets, and need not be one that can be
    simulated."""
    problem = make(**{"search.algorithm": "nsga2", "refinement": None})
    problem.grid = True
    result = fit(problem)
    assert not result.estimates["average"].usable
    assert result.final == next(iter(result.estimates)) == "utopia"
    assert result.best.usable
    assert Finding("diverged", "warning", ("average",)) in fit_findings(result)


def test_where_everything_diverges_the_run_says_so():
    class Hopeless(Fragile):
        def bad(self, theta):
            return np.ones(len(theta), bool)

    for algorithm in ("ga", "nsga2"):
        with pytest.raises(
            HydroidError, match="no candidate of the population could be simulated"
        ):
            fit(make(Hopeless, **{"search.algorithm": algorithm}))
