"""A fit climbs: it keeps the dynamic model, and a term, where the logs ask for them,
and nowhere else."""

import numpy as np
import pytest
from made_logs import noisy, simulate_log, step_log
from recovery import settings_of

from hydroid.commands.progress import FitProgress
from hydroid.fitting.fit import fit
from hydroid.fitting.left_out import is_clear
from hydroid.fitting.watcher import Silent
from hydroid.problem.problem import Problem
from hydroid.search.descent import Ending
from hydroid.settings.search import MultistartSettings, RefinementSettings
from hydroid.studies import Task, perform

SHOULDER = (60, -40, 90, -80, 40, 0, -30, 70, -60, 30)
ELBOW = (-50, 80, -70, 50, 0, 60, -80, 40, 30, -60)
TRUTH = {"open_A": 0.35, "open_B": 0.3, "P_flow": 3.0, "P_droop": 100.0}
CONFIG = {
    "open_A": {"quantity": "opening_a", "nominal": 0.3, "within": 2},
    "open_B": {"quantity": "opening_b", "nominal": 0.3, "within": 2},
    "P_flow": {"quantity": "pump_flow", "fixed": 3.0, "term": "pump"},
    "P_droop": {
        "quantity": "pump_droop",
        "bounds": [0, 140],
        "start": 20,
        "term": "pump",
    },
}
JOINT = {"simulation.model": "quasi-static", "joint_refinement": True}
CHANGES = {
    "outputs": (2, 3),
    "simulation.model": "ladder",
    "search.algorithm": "multistart",
    "search.multistart": MultistartSettings(starts=1, horizons=()),
    "refinement": RefinementSettings(iterations=40),
}


def _problem(name, term="pump", **more):
    """The fit of a simulated log whose machine is what an estimate of this name has."""
    rows = {
        n: row | {"term": term} if "term" in row else row for n, row in CONFIG.items()
    }
    ladder = settings_of(rows, bulk_modulus=20.0).changed(CHANGES | more)
    machine = ladder.of_estimate(name)
    log = step_log(machine.arm.pose("study"), {2: SHOULDER, 3: ELBOW})
    exact = simulate_log(
        machine, log, {n: TRUTH[n] for n in CONFIG if n in machine.parameters}
    )
    return Problem(ladder, [noisy(exact, 0.02, 1, exact_start=False)])


def _rms_of_the_truth(problem, name):
    """What the machine itself leaves of its log, noise and start included [deg]."""
    own = problem.varied(problem.settings.of_estimate(name))
    values = own.parameters.mapping(own.parameters.start)
    theta = own.parameters.vector(
        values | {n: TRUTH[n] for n in TRUTH if n in values}, "truth"
    )
    return float(np.degrees(own.rms(own.output_errors(theta[None]))[0]))


@pytest.mark.parametrize("name", ["refined", "refined+pump", "dynamic", "dynamic+pump"])
def test_a_fit_keeps_what_the_logs_ask_for(name, monkeypatch):
    """Soft oil shows in the logs, and a droop shows where two joints move together."""
    shown, problem = [], _problem(name)
    ladder, (log,) = problem.settings, problem.logs
    monkeypatch.setattr(FitProgress, "__call__", lambda _, *line: shown.append(line))
    found = fit(problem, FitProgress(ladder))
    assert found.final == name
    times = [what.split(",")[0] for what, *_ in shown if what != "generation"]
    assert times == sorted(times)
    assert shown[-1][0] == f"{times[-1]}, {name}, all joints"
    assert f"rms error {np.degrees(found.best.rms):.3g} deg" in shown[-1][-1]
    assert 0.02 < np.degrees(found.best.rms) < 1.01 * _rms_of_the_truth(problem, name)
    if found.best.gained:
        rise, error = found.best.gained
        assert rise > 1.64 * error
    # a study measures the estimate as it is, though its search has another model
    if name == "dynamic+pump":
        measures = perform(Task(name, 1, ladder, (log,)))["measures"]
        assert measures["rms error"] == pytest.approx(np.degrees(found.best.rms))


@pytest.mark.parametrize("term", ["refined", "start"])
def test_a_term_may_be_called_as_a_model_or_a_step(term, monkeypatch):
    shown, problem = [], _problem(f"refined+{term}", term)
    monkeypatch.setattr(FitProgress, "__call__", lambda _, *line: shown.append(line))
    found = fit(problem, FitProgress(problem.settings))
    assert found.final == f"refined+{term}"
    assert np.degrees(found.best.rms) == pytest.approx(0.02, rel=0.1)
    models = {what.split(", ")[1] for what, *_ in shown if what != "generation"}
    assert {"refined", f"refined+{term}"} <= models


def test_a_joint_refinement_keeps_a_term_that_is_called_as_its_model():
    problem = _problem("refined+refined_pump", "refined_pump", **JOINT)
    found = fit(problem)
    assert found.final == "joint+refined_pump"
    assert "P_droop" in found.problem.parameters.names
    assert np.degrees(found.best.rms) == pytest.approx(0.02, rel=0.1)


OF_JOINTS = {
    **{
        f"open_{j}": {"quantity": "opening", "joints": [j], "nominal": 0.3, "within": 2}
        for j in (2, 3)
    },
    "bend": {"quantity": "curve", "joints": [2], "term": "curve_shoulder"},
    "P_flow": CONFIG["P_flow"],
    "P_droop": CONFIG["P_droop"],
}
MACHINES = {
    "refined": {},
    "refined+curve_shoulder": {f"bend_{part}": 0.1 for part in range(1, 4)}
    | {"bend_4": 1.0},
    "refined+pump": {"P_droop": 120.0},
}


@pytest.mark.parametrize("name", MACHINES)
def test_a_curve_and_a_pump_do_not_stand_in_for_each_other(name):
    """Where joints share a pump, a valve's curve explains a part of what the pump does,
    until the pump is there."""
    one_model = {"simulation.model": "quasi-static"}
    ladder = settings_of(OF_JOINTS).changed(CHANGES | one_model)
    machine = ladder.of_estimate(name)
    truth = {"open_2": 0.35, "open_3": 0.3, "P_flow": 3.0} | MACHINES[name]
    known = {one: value for one, value in truth.items() if one in machine.parameters}
    log = step_log(machine.arm.pose("study"), {2: SHOULDER, 3: ELBOW})
    exact = simulate_log(machine, log, known)
    found = fit(Problem(ladder, [noisy(exact, 0.02, 1, exact_start=False)]))
    assert found.final == name
    # what the term of a joint gained there is known, whether it was kept or not
    gained = found.tried["curve_shoulder"]
    if name == "refined+curve_shoulder":
        assert gained is not None
        assert is_clear(*gained, among=1)
    else:
        assert gained is None or not is_clear(*gained)


class Hurried(Silent):
    """Says that time is up after so many calls."""

    def __init__(self, calls):
        self.calls = calls

    def refining(self, step, simulated, rms):
        self.calls -= 1
        return self.calls < 0


def test_a_fit_without_time_says_so_and_goes_on_to_the_bits_of_one_with_time():
    problem, stored, calls = _problem("refined+pump"), {}, Hurried(10_000)
    whole = fit(problem, calls)
    used = 10_000 - calls.calls
    early = [
        fit(problem, Hurried(round(part * used)), stored) for part in (0.02, 0.2, 0.3)
    ]
    assert early[0].refinement.ending is Ending.TIME
    assert not early[0].refinement.ending.converged
    late = fit(problem, checkpoints=stored)
    assert late.final == whole.final
    np.testing.assert_array_equal(late.best.theta, whole.best.theta)
    assert whole.ends == late.ends
    assert [*whole.ends] == [0]  # no joint has parameters of its own
