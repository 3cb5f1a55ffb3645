from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_fits import Watcher

from hydroid import load_settings, read_logs
from hydroid.fitting.fit import fit
from hydroid.fitting.search import search
from hydroid.log import Log, write_log
from hydroid.prediction import simulate_log
from hydroid.problem.problem import Problem
from hydroid.run.folder import RunFolder

TRUTH = {"K2": 0.2, "D2": 231.8, "S2": 53.4, "K3": 0.3, "D3": 150.0, "S3": 40.0, "M3": 22.5}
JOINTS = {"K": "gain", "D": "damping", "S": "stiffness"}


def parameters(factor: float) -> dict:
    """K, D, S of joints 2 and 3 and one mass, bounds a factor off the truth to both sides."""
    bounds = {name: [value / factor, value * factor] for name, value in TRUTH.items()}
    own = {"M3": {"quantity": "mass", "link": "link3", "bounds": bounds.pop("M3")}}
    return own | {
        name: {"quantity": JOINTS[name[0]], "joints": [int(name[1])], "bounds": b}
        for name, b in bounds.items()
    }


def make(factor: float = 10.0, noise_deg: float = 0.0, **changes):
    """Eight seconds of steps on joints 2 and 3, after half a second at rest."""
    settings = load_settings(
        "fit-mech",
        {
            "parameters": parameters(factor),
            "outputs": [2, 3],
            "objective.segments": {"equal": 1},
            "search.algorithm": "multistart",
            "search.multistart.starts": 3,
        }
        | changes,
    )
    time = np.arange(850) * 0.01
    command = np.zeros((850, 7))
    command[50:, 1] = np.repeat([60.0, -80.0, 40.0, 0.0], 200)
    command[50:, 2] = np.repeat([-50.0, 70.0, 20.0, -60.0, 30.0], 160)
    log = Log("steps", time, command, np.tile(settings.arm.pose("study"), (850, 1)), 0.01)
    log = simulate_log(settings, log, TRUTH, "truth")
    noise = np.random.default_rng(0).normal(0.0, np.deg2rad(noise_deg), log.angle.shape)
    noise[0] = 0.0
    return settings, replace(log, angle=log.angle + noise)


def test_the_first_seconds_count_from_the_first_command():
    _, log = make()
    part = log.first(1.0)
    assert part.time[-1] == pytest.approx(0.5 + 1.0)
    np.testing.assert_array_equal(part.command, log.command[:151])
    np.testing.assert_array_equal(part.angle, log.angle[:151])
    assert len(log.first(1e3).time) == len(log.time)


def test_a_part_of_a_problem_is_the_same_problem_for_a_shorter_time():
    settings, log = make()
    problem = Problem(settings, [log])
    theta = problem.theta(np.random.default_rng(0).random((1, len(problem.parameters.names))))
    part = problem.varied(settings.in_one_segment(), [log.first(1.0)])
    whole = problem.residuals(theta).reshape(2, -1)
    np.testing.assert_array_equal(part.residuals(theta).reshape(2, -1), whole[:, :151])


def test_a_horizon_in_which_nothing_moves_is_left_out():
    """A joint leaves its stop 0.6 s after the command: its first quarter of a second teaches nothing."""
    few = {"starts": 1, "iterations": 1, "horizons": [0.25, 2.0]}
    settings, log = make(**{"search.multistart": few})
    late = replace(log, command=np.roll(log.command, -60, axis=0) * (np.arange(850) < 790)[:, None])
    stored: dict[str, dict] = {}
    search(Problem(settings, [late]), lambda row: None, lambda n, rms: None, stored)
    assert set(stored) == {"search", "start 1 part 1", "start 1 part 2"}  # two seconds, and all


def test_starts_fill_positive_bounds_evenly_by_decades():
    settings, log = make(factor=100.0, **{"parameters.S2.bounds": [0.0, 500.0]})
    problem = Problem(settings, [log])
    drawn = problem.theta(np.random.default_rng(1).random((2000, len(problem.parameters.names))))
    low, high = problem.parameters.lower, problem.parameters.upper
    assert ((drawn >= low) & (drawn <= high)).all()
    names = problem.parameters.names
    wide, plain = names.index("K2"), names.index("S2")
    # a uniform distribution's mean is known to 0.29 / sqrt(2000)
    assert np.mean(np.log10(drawn[:, wide] / low[wide]) / 4) == pytest.approx(0.5, abs=0.03)
    assert np.mean(drawn[:, plain] / 500) == pytest.approx(0.5, abs=0.03)


def test_starts_hold_what_is_known():
    known = {"priors": {"elbow": {"of": "D3", "value": 150.0, "sd": 1.0}}}
    settings, log = make(**known)
    problem = Problem(settings, [log])
    drawn = problem.theta(np.random.default_rng(2).random((20, len(problem.parameters.names))))
    assert np.abs(problem.priors.scores(drawn)).max() <= 2 + 1e-9


def test_all_starts_end_at_one_optimum_which_is_the_truth_without_noise():
    settings, log = make()
    problem = Problem(settings, [log])
    found = search(problem, lambda row: None, lambda n, rms: None, {})
    truth = problem.parameters.vector(TRUTH, "truth")
    np.testing.assert_allclose(found.theta, np.tile(truth, (3, 1)), rtol=1e-3)
    assert found.population.objectives.max() < np.deg2rad(1e-5)


def test_a_fit_to_noise_gains_no_more_than_its_parameters_can():
    settings, log = make(noise_deg=0.02, **{"search.multistart.starts": 2})
    problem = Problem(settings, [log])
    watcher = Watcher()
    result = fit(problem, watcher)
    assert [row[0] for row in watcher.rows] == [1, 2]
    truth = problem.parameters.vector(TRUTH, "truth")
    # least squares: the estimate fits better than the truth, and by no more than seven parameters can
    cost = [float(np.sum(problem.residuals(theta[None]) ** 2)) for theta in (result.best.theta, truth)]
    gain = (cost[1] - cost[0]) / np.deg2rad(0.02) ** 2
    assert 0 < gain < 24.3  # chi-square of 7 degrees of freedom, 0.999
    assert result.history[-1, 1] == result.history[-1, 2] > result.history[0, 1]


def test_a_resumed_run_ends_bit_for_bit_where_it_would_have(tmp_path: Path):
    few = {"starts": 3, "iterations": 4, "horizons": [0.25, 2.0]}
    settings, log = make(noise_deg=0.05, refinement=None, **{"search.multistart": few})
    problem = Problem(settings, [log])
    whole = fit(problem)
    folder = RunFolder(tmp_path / "run")
    write_log(tmp_path / "log.csv", log, settings.log)
    folder.begin(settings, read_logs([tmp_path / "log.csv"], settings))
    with pytest.raises(KeyboardInterrupt):
        fit(problem, Watcher(stop_at=1, simulations=60), folder.checkpoints())
    watcher = Watcher()
    again = fit(problem, watcher, folder.checkpoints())
    assert [row[0] for row in watcher.rows] == [2, 3]  # the first start is not repeated
    np.testing.assert_array_equal(again.history, whole.history)
    np.testing.assert_array_equal(again.best.theta, whole.best.theta)
    np.testing.assert_array_equal(again.front[0], whole.front[0])
