"""A joint whose speed follows its command alone, beside joints that feel load and pump:
a fit keeps it where that predicts better, and nowhere else."""

from pathlib import Path

import numpy as np
import pytest
from recovery import bands_in, model_of
from two_joints import FIT, OPENINGS, PARAMETERS, TRUTH, drive, two_joints

from hydroid.advice.terms import terms
from hydroid.errors import SettingsError
from hydroid.files import Plain
from hydroid.fitting import by_command
from hydroid.fitting.fit import Fit, fit
from hydroid.fitting.starts import valve_alone
from hydroid.fitting.watcher import Silent
from hydroid.plant import Plant
from hydroid.posterior.bench import make_bench
from hydroid.prediction import predict
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings

CHOICES = {
    f"by_command_{joint}": {
        "quantity": "by_command",
        "joints": [joint],
        "fixed": 1,
        "term": f"by_command_{joint}",
    }
    for joint in ("lift", "tilt")
}
SEARCH = {"algorithm": "multistart", "multistart": {"starts": 1, "horizons": []}}
TILT = "refined+by_command_tilt"


def settings_in(
    folder: Path, priors: Plain | None = None, **more: Plain
) -> FitSettings:
    """Two joints with the choices and further parameters."""
    every = PARAMETERS | CHOICES | more
    return two_joints(folder, parameters=every, search=SEARCH, priors=priors or {})


def problem_of(folder: Path, name: str) -> Problem:
    """The fit of two logs of the machine that an estimate of this name describes."""
    settings = settings_in(folder)
    machine = settings.of_estimate(name)
    return Problem(settings, [drive(machine, seed) for seed in (1, 2)])


@pytest.fixture(scope="module")
def problem(tmp_path_factory) -> Problem:
    return problem_of(tmp_path_factory.mktemp("arm"), TILT)


@pytest.fixture(scope="module")
def found(problem: Problem) -> Fit:
    return fit(problem)


def test_settings_lose_what_then_has_no_effect_and_the_priors_on_it(tmp_path):
    idle = {
        "size_tilt": {"quantity": "area", "joints": ["tilt"], "within": 2},
        "D_tilt": {"quantity": "damping", "joints": ["tilt"], "bounds": [0, 9]},
        "F_tilt": {"quantity": "friction", "joints": ["tilt"], "bounds": [0, 9]},
        "K": {"quantity": "compensation", "joints": ["lift", "tilt"], "bounds": [0, 1]},
        "limit": {"quantity": "flow_limit", "joints": ["tilt"], "bounds": [1, 90]},
    }
    priors = {
        "both": {"of": ["D_tilt", "F_tilt"], "value": 3, "sd": 1},
        "pump": {"of": "droop", "value": 60, "sd": 9},
    }
    settings = settings_in(tmp_path, priors=priors, **idle)
    assert settings.terms() == settings.terms_of(2) == ()
    assert settings.by_command_terms == {"by_command_lift": 1, "by_command_tilt": 2}
    without = settings.of_estimate("refined")
    assert {*without.parameters} == {*settings.parameters} - {*CHOICES}
    assert not any(without.is_by_command(joint) for joint in (1, 2))
    mixed = settings.of_estimate(TILT)
    # the lift's share of the compensation is left
    gone = {"size_tilt", "D_tilt", "F_tilt", "limit", "by_command_lift"}
    assert {*settings.parameters} - {*mixed.parameters} == gone
    assert {*mixed.priors} == {"pump"}
    assert (mixed.is_by_command(1), mixed.is_by_command(2)) == (False, True)
    assert mixed.of_estimate(TILT) == mixed
    every = settings.of_estimate("refined+by_command_lift+by_command_tilt")
    assert "K" not in every.parameters
    dynamic = settings.changed({"simulation.model": "ladder"}).of_estimate(
        TILT.replace("refined", "dynamic")
    )
    assert gone - {"by_command_lift"} <= {*dynamic.parameters}


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"fixed": None, "bounds": [0, 1]}, "is not estimated"),
        ({"fixed": 0.5}, "is not estimated"),
        ({"joints": ["lift", "tilt"]}, "names one joint"),
        ({"term": "by_command_lift"}, "one of its own"),
    ],
)
def test_a_choice_is_no_number_and_of_one_joint(tmp_path, entry, words):
    with pytest.raises(SettingsError, match=words):
        settings_in(tmp_path, by_command_tilt=CHOICES["by_command_tilt"] | entry)


def test_the_joint_that_follows_its_command_alone_keeps_it(problem, found):
    assert found.final == TILT
    gained = found.tried["by_command_tilt"]
    assert gained is not None
    assert gained[0] > 100
    # what the true machine leaves is the noise
    assert np.degrees(found.best.rms) == pytest.approx(0.02, rel=0.1)
    values = found.problem.parameters.mapping(found.best.theta)
    for name in OPENINGS:
        assert values[name] == pytest.approx(TRUTH[name], rel=0.02)


def test_a_fit_of_one_joint_chooses_too(problem):
    found = fit(problem.varied(problem.settings.changed({"outputs": (2,)})))
    assert found.final == TILT
    assert found.tried["by_command_lift"] is None


def test_a_joint_that_errs_far_less_than_simple_models_is_not_tried(
    problem, monkeypatch
):
    """The bar is put above every error."""
    monkeypatch.setattr(by_command, "FAR_LESS", np.inf)
    found = fit(problem)
    assert found.final == "refined"
    assert {found.tried[name] for name in CHOICES} == {None}


def test_it_begins_at_the_full_speeds_that_it_had_or_at_those_of_the_logs(problem):
    last, own = (
        problem.varied(problem.settings.of_estimate(name)) for name in ("refined", TILT)
    )
    starts = valve_alone(own, 2, last, last.parameters.start)

    def full_speeds(one: Problem, theta: np.ndarray) -> list[float]:
        bench = make_bench(one.settings, one.logs, 2)
        candidates = one.bindings.candidates(theta[None])
        moved = (bench.movement(full).speeds(candidates) for full in (100.0, -100.0))
        return [float(speeds.max()) for speeds in moved]

    had = full_speeds(last, last.parameters.start)
    assert full_speeds(own, starts[0]) == pytest.approx(had, rel=1e-6)
    true = own.parameters.vector(
        {name: TRUTH.get(name, 1.0) for name in own.parameters.names}, "truth"
    )
    shown = full_speeds(own, starts[1])
    assert shown == pytest.approx(full_speeds(own, true), rel=0.05)


def test_no_joint_that_a_load_slows_takes_it(tmp_path):
    problem = problem_of(tmp_path, "refined")
    found = fit(problem)
    assert found.final == "refined"
    assert found.tried["by_command_lift"] is None  # only noise is left
    # a model that errs, but not in what the load does
    late = {"hydraulics.delay_a": 0.14, "hydraulics.delay_b": 0.14}
    found = fit(problem.varied(problem.settings.changed(late)))
    assert found.final == "refined"
    for gained in found.tried.values():
        # where it errs much more it is not even refined
        assert gained is None or gained[0] < 0


def test_a_joint_whose_load_the_logs_do_not_show_takes_it(tmp_path):
    """A valve that makes all of its load good does as well there, but leaves a load that
    is none to other poses. A joint that feels its load keeps it, at the noise, too."""
    good = {
        f"K_{joint}": {
            "quantity": "compensation",
            "joints": [joint],
            "bounds": [0, 1],
            "start": 0.2,
        }
        for joint in ("lift", "tilt")
    }
    pump = ("flow", "droop")
    own = {name: entry for name, entry in PARAMETERS.items() if name not in pump}
    oil = {
        name: value for name, value in FIT["hydraulics"].items() if "pump" not in name
    }
    settings = two_joints(
        tmp_path, parameters=own | good | CHOICES, hydraulics=oil, search=SEARCH
    )
    machine = settings.of_estimate(TILT)
    truth = {name: value for name, value in TRUTH.items() if name not in pump}
    truth |= {"K_lift": 0.0}
    logs = [drive(machine, seed, truth) for seed in (1, 2)]
    found = fit(Problem(settings, logs))
    assert np.degrees(found.best.rms) == pytest.approx(0.02, rel=0.1)
    assert found.final == TILT


class Hurried(Silent):
    """Says that time is up after so many calls."""

    def __init__(self, calls: int) -> None:
        self.calls = calls

    def refining(self, step, simulated, rms):
        self.calls -= 1
        return self.calls < 0


def test_a_fit_that_is_cut_goes_on_to_the_same_bits(problem, found):
    counted, stored = Hurried(10_000), {}
    fit(problem, counted)
    used = 10_000 - counted.calls
    for part in (0.6, 0.8, 0.9):
        fit(problem, Hurried(round(part * used)), stored)
    late = fit(problem, checkpoints=stored)
    assert late.final == found.final
    np.testing.assert_array_equal(late.best.theta, found.best.theta)


def test_what_uses_the_fit_has_the_joint_by_command(problem, found):
    model = model_of(found.problem, found.best.theta)
    assert [
        f.subjects for f in model.summarise().findings if f.kind == "by command"
    ] == [("tilt",)]
    (log, _) = problem.logs
    assert bands_in(model, log)[2].inside > 0.9
    plant = Plant(model)
    plant.reset(log.start)
    for command in log.command[:-1]:
        plant.step(command)
    predicted = predict(model, log, (1, 2))
    np.testing.assert_allclose(plant.angle, predicted[-1], atol=1e-9)
    # no load and no other joint changes its settled speed
    steady = plant.steady()
    poses = np.array([[0.2, 0.1], [0.2, 0.1], [0.6, 0.5]])
    commands = np.array([[0.0, 70.0], [100.0, 70.0], [0.0, 70.0]])
    speeds = steady.speeds(commands, poses)[:, 1]
    np.testing.assert_allclose(speeds, speeds[0], rtol=1e-12)


def test_suggest_frees_nothing_that_has_no_effect(found):
    offered = {term.kind[:2] for term in terms(found.problem, found.best.theta)}
    assert ("compensation", (1,)) in offered
    idle = ("compensation", "friction", "damping", "area", "by_command", "return")
    assert not {(name, (2,)) for name in idle} & offered
    assert not any(kind[0] == "by_command" for kind in offered)
