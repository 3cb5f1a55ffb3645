"""Several hydraulic joints: each alone with the others as logged, then all together."""

from dataclasses import replace

import numpy as np
import pytest
from small_fits import Watcher, steps_of

from hydroid import load_settings
from hydroid.arrays import rms
from hydroid.fitting.baselines import fit_baselines
from hydroid.fitting.first_answer import first_answer
from hydroid.fitting.fit import fit
from hydroid.fitting.multistart import alone, lone_joints
from hydroid.problem.problem import Problem
from hydroid.progress import NOTE

TRUTH = {
    "open_2": 0.35,
    "open_3": 0.5,
    "overlap_2": 0.4,
    "overlap_3": 0.3,
    "M3": 20.0,
    "D": 100.0,
}
LEVELS = {2: [60.0, -80.0, 70.0, 0.0], 3: [-70.0, 80.0, 0.0, -60.0, 90.0]}


def make(noise_deg: float = 0.0, **changes) -> Problem:
    rows = {
        f"{name}_{j}": {"quantity": quantity, "joints": [j], "bounds": bounds}
        for name, quantity, bounds in (
            ("open", "opening", [0.1, 1.0]),
            ("overlap", "overlap", [0.0, 0.8]),
        )
        for j in (2, 3)
    }
    rows |= {"D": {"quantity": "damping", "fixed": 100.0}}
    rows |= {
        "M3": {
            "quantity": "mass",
            "link": "link3",
            "bounds": [10.0, 40.0],
            "start": 22.0,
        }
    }
    small = {"parameters": rows, "outputs": [2, 3], "joint_refinement": False}
    small |= {"objective.segments": 1, "search.algorithm": "multistart"}
    small |= {"search.multistart": {"starts": 1, "horizons": [1.0]}}
    settings = load_settings("fit-hyd", small | changes)
    return Problem(settings, [steps_of(settings, TRUTH, LEVELS, noise_deg)])


@pytest.fixture(scope="module")
def problem() -> Problem:
    return make()


@pytest.fixture(scope="module")
def truth(problem: Problem) -> np.ndarray:
    return problem.parameters.vector(TRUTH, "truth")


def test_a_lone_joint_feels_no_valve_but_its_own(problem):
    assert lone_joints(problem) == (2, 3)
    values = problem.parameters.mapping(problem.parameters.start)
    one, other = (
        alone(problem, 2, problem.parameters.vector(values | more, ""))
        for more in ({}, {"open_3": 0.9, "overlap_3": 0.7})
    )
    free = [
        n
        for n, free in zip(one.parameters.names, one.parameters.free, strict=True)
        if free
    ]
    assert free == ["open_2", "overlap_2"]
    unit = np.full((1, 2), 0.3)
    np.testing.assert_array_equal(
        *(p.output_errors(p.parameters.from_unit(unit)) for p in (one, other))
    )


def test_a_lone_joint_moves_as_with_all_others(problem, truth):
    for joint in lone_joints(problem):
        error = alone(problem, joint, truth).output_errors(truth[None])
        # the logged motion passes a low-pass
        assert np.rad2deg(np.sqrt(np.mean(error**2))) < 0.1


PUMPS = {
    "its flow is shared": {"hydraulics.pump_flow": 1.2},
    "on open centres": {"hydraulics.pump_flow": 3.0, "hydraulics.pump_bypass": 2.0},
    "it comes up": {
        "hydraulics.pump_flow": 3.0,
        "hydraulics.pump_idle": 0.1,
        "hydraulics.pump_rise": 2.0,
    },
}


@pytest.mark.parametrize("pump", PUMPS.values(), ids=PUMPS)
@pytest.mark.parametrize("model", ["dynamic", "quasi-static"])
def test_joints_that_follow_the_log_take_their_part_of_the_pump(truth, pump, model):
    """Two joints share a pump that cannot serve both, or whose oil runs past both
    valves, or that a command brings up: each alone is as slow as beside the other.

    What is left is the low-pass of the motion that is followed, a small part of the
    pump's effect.
    """
    of_model = {"simulation.model": model}
    apart = make(**of_model)
    shared = make(**of_model, **{"hydraulics.line_volume": 20.0}, **pump)
    for joint in lone_joints(shared):
        error = alone(shared, joint, truth).output_errors(truth[None])
        effect = (apart.logs[0].angle - shared.logs[0].angle)[:, joint - 1]
        assert np.rad2deg(np.sqrt(np.mean(effect**2))) > 1
        assert rms(error) < 0.3 * rms(effect)


def test_the_start_pose_is_the_recordings_not_the_joints():
    """Joint 3 rests for longer than joint 2: its lone log must not start amid joint 2's
    motion."""
    (log,) = make(noise_deg=0.1).logs
    log = replace(
        log,
        command=log.command * (np.arange(450) >= 120)[:, None] ** (np.arange(7) == 2),
    )
    np.testing.assert_array_equal(log.driving(3).start, log.start)
    assert log.driving(3).driven.tolist() == [
        False,
        False,
        True,
        False,
        False,
        False,
        False,
    ]


def test_a_lone_joint_knows_the_commands_beside_its_own(problem):
    (log,) = problem.logs
    lone = log.driving(3)
    np.testing.assert_array_equal(lone.command + lone.beside, log.command)
    assert not lone.beside[:, 2].any()
    again = lone.driving(3).part(50, 90)
    np.testing.assert_array_equal(again.beside, lone.beside[50:90])


def test_joint_by_joint_then_together_finds_the_truth(problem, truth):
    watcher = Watcher()
    result = fit(problem, watcher)
    assert [row[0] for row in watcher.rows] == [1]
    own = [n[:4] in ("open", "over") for n in problem.parameters.names]
    assert np.rad2deg(result.estimates["best"].rms) < 0.5
    np.testing.assert_allclose(
        result.estimates["best"].theta[own], truth[own], rtol=0.2
    )
    np.testing.assert_allclose(result.best.theta, truth, rtol=1e-3)
    assert result.refinement is not None
    assert result.refinement.ending.converged


def test_the_first_answer_is_of_each_joint_alone_beside_simple_models(
    problem, truth, caplog
):
    caplog.set_level(NOTE, "hydroid")
    with pytest.raises(KeyboardInterrupt):
        fit(problem, Watcher(stop_at=1))
    said = [r.getMessage() for r in caplog.records if r.levelno == NOTE]
    assert [line.split()[0] for line in said] == ["shoulder", "elbow"]
    own = alone(problem, 3, truth)
    limits = [*problem.settings.arm.ranges.values()][2]
    models = fit_baselines(own.logs, 3, limits)
    line = first_answer(own, 3, truth, models)
    errors = own.output_errors(truth[None])
    assert f"elbow alone errs by {np.degrees(own.rms(errors)[0]):.3g} deg" in line
    for name, model in models.items():
        assert f"{name} {np.degrees(rms(model.errors(own.logs))):.3g} deg" in line
    assert line.endswith("better than each of them")
    # valves that hardly open
    lower = own.parameters.lower
    assert first_answer(own, 3, lower, models).endswith("worse than nine numbers")


def test_a_single_joint_is_fitted_with_the_others_as_the_settings_say(problem):
    assert (
        lone_joints(
            Problem(problem.settings.model_copy(update={"outputs": (2,)}), problem.logs)
        )
        == ()
    )
