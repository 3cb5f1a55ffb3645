"""Several starts over growing horizons: the optimum without noise, what noise can gain,
and resuming."""

from dataclasses import replace

import numpy as np
import pytest
from recovery import refined
from small_fits import Watcher, steps_of

from hydroid import load_settings
from hydroid.fitting.search import search
from hydroid.fitting.watcher import Silent
from hydroid.problem.problem import Problem

TRUTH = {
    "K2": 0.2,
    "D2": 231.8,
    "S2": 53.4,
    "K3": 0.3,
    "D3": 150.0,
    "S3": 40.0,
    "M3": 22.5,
}
WHAT = {"K": "gain", "D": "damping", "S": "stiffness"}
LEVELS = {2: [60.0, -80.0, 40.0, 0.0], 3: [-50.0, 70.0, 20.0, -60.0, 30.0]}


def make(factor: float = 10.0, noise_deg: float = 0.0, **changes) -> Problem:
    """K, D, S of joints 2 and 3 and one mass, bounds a factor off the truth to both
    sides."""
    parameters = {
        name: {"bounds": [value / factor, value * factor]}
        | ({"quantity": "mass", "link": "link3"} if name == "M3" else {})
        | (
            {"quantity": WHAT[name[0]], "joints": [int(name[1])]}
            if name != "M3"
            else {}
        )
        for name, value in TRUTH.items()
    }
    small = {
        "outputs": [2, 3],
        "objective.segments": 1,
        "search.algorithm": "multistart",
    }
    small |= {"parameters": parameters, "search.multistart.starts": 2}
    settings = load_settings("fit-mech", small | changes)
    return Problem(settings, [steps_of(settings, TRUTH, LEVELS, noise_deg)])


@pytest.fixture(scope="module")
def exact() -> Problem:
    return make()


def test_a_part_of_a_problem_is_the_same_problem_for_a_shorter_time(exact):
    theta = exact.theta(
        np.random.default_rng(1).random((1, len(exact.parameters.names)))
    )
    part = exact.varied(
        exact.settings.changed({"objective.segments": 1}), [exact.logs[0].first(1.0)]
    )
    whole = exact.output_errors(theta).reshape(2, -1)
    np.testing.assert_array_equal(
        part.output_errors(theta).reshape(2, -1), whole[:, :151]
    )


def test_a_horizon_in_which_nothing_moves_is_left_out():
    """A joint leaves its stop 0.6 s after the command: its first quarter of a second
    teaches nothing."""
    problem = make(
        **{"search.multistart": {"starts": 1, "iterations": 1, "horizons": [0.25, 2.0]}}
    )
    (log,) = problem.logs
    late = replace(
        log, command=np.roll(log.command, -60, axis=0) * (np.arange(450) < 390)[:, None]
    )
    stored: dict[str, dict] = {}
    search(Problem(problem.settings, [late]), Silent(), stored)
    # two seconds, and all
    assert set(stored) == {"search", "start 1 part 1", "start 1 part 2"}


def test_all_starts_end_at_one_optimum_which_is_the_truth_without_noise(exact):
    found = search(exact, Silent(), {})
    truth = exact.parameters.vector(TRUTH, "truth")
    np.testing.assert_allclose(found.theta, np.tile(truth, (2, 1)), rtol=1e-3)
    assert found.population.objectives.max() < np.deg2rad(1e-5)


def test_a_resumed_search_ends_bit_for_bit_and_gains_no_more_on_noise_than_its_parameters_can():
    how = {"starts": 2, "iterations": 4, "horizons": [0.25, 2.0]}
    problem = make(noise_deg=0.02, **{"search.multistart": how})
    watcher, stopped, last, stored = (
        Watcher(),
        Watcher(stop_at=1, simulations=60),
        Watcher(),
        {},
    )
    whole = search(problem, watcher, {})
    assert [row[0] for row in watcher.rows] == [1, 2]
    assert whole.history[-1, 1] == whole.history[-1, 2] > whole.history[0, 1]
    with pytest.raises(KeyboardInterrupt):
        search(problem, stopped, stored)
    again = search(problem, last, stored)
    assert [row[0] for row in last.rows] == [2]  # the first start is not repeated
    np.testing.assert_array_equal(again.history, whole.history)
    np.testing.assert_array_equal(again.theta, whole.theta)
    # least squares: the estimate fits better than the truth, and by no more than seven
    # parameters can
    best = refined(problem, whole.theta[0])
    both = np.stack([best, problem.parameters.vector(TRUTH, "truth")])
    best, true = (
        np.sum(problem.output_errors(both) ** 2, axis=1) / np.deg2rad(0.02) ** 2
    )
    assert 0 < true - best < 24.3  # chi-square of 7 degrees of freedom, 0.999
