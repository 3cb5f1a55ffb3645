"""Effects of groups of logs: estimated with all else, and none of another group's
predictions."""

from dataclasses import replace

import numpy as np
import pytest
from recovery import bands_in, model_of, refined
from two_joints import PARAMETERS, TRUTH, drive, two_joints

import hydroid
from hydroid.errors import HydroidError
from hydroid.identified_model import identified
from hydroid.log import Log
from hydroid.prediction import predict
from hydroid.problem.bindings import Bindings
from hydroid.problem.problem import Problem
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import RefinementSettings
from hydroid.simulation.scenario import distinct

EFFECT = {"quantity": "dead_band", "joints": [1], "sd": 3, "per": "group"}
GROUPS = {"monday": "mon_*.csv", "tuesday": ["tue_1.csv", "tue_2.csv"]}
DAY = {"day_monday": 2.0, "day_tuesday": -1.5}
LOGS = {"mon_1.csv": 2.0, "tue_1.csv": -1.5, "tue_2.csv": -1.5}


def of_days(folder, log: object = None, **own: object) -> FitSettings:
    log = {"period_s": 0.05, "groups": GROUPS} if log is None else log
    return two_joints(folder, log=log, parameters=PARAMETERS | {"day": EFFECT} | own)


def shifted(folder, shift: float) -> FitSettings:
    band = {"quantity": "dead_band", "joints": [1], "fixed": 20 + shift}
    return two_joints(folder, parameters=PARAMETERS | {"band": band})


def logs_of_days(folder, logs: dict[str, float] = LOGS) -> list[Log]:
    pairs = enumerate(logs.items())
    return [
        replace(drive(shifted(folder, by), i), source=name) for i, (name, by) in pairs
    ]


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> tuple[Problem, np.ndarray]:
    folder = tmp_path_factory.mktemp("days")
    problem = Problem(of_days(folder), logs_of_days(folder))
    start = problem.parameters.started(TRUTH)
    return problem, refined(problem, start, RefinementSettings(iterations=20))


def test_an_effect_takes_a_quantity_no_further_than_it_can_be(tmp_path):
    settings = of_days(tmp_path)
    parameters = settings.parameter_set()
    effects = np.full((2, len(parameters.names)), parameters.start)
    effects[:, parameters.names.index("day_monday")] = [-500.0, 500.0]
    joints = Bindings(settings).candidates(effects, "mon_1.csv").joints
    assert joints.dead_band_a[:, 0].tolist() == [0.0, 99.0]


def test_effects_of_two_groups_are_recovered(fitted):
    problem, theta = fitted
    values = problem.parameters.mapping(theta)
    assert values["day_other"] == 0.0
    # their sum is the dead band's, which the settings hold
    assert {name: values[name] for name in DAY} == pytest.approx(DAY, abs=0.1)
    assert np.degrees(problem.rms(problem.output_errors(theta[None])))[
        0
    ] == pytest.approx(0.02, rel=0.1)


def test_an_unseen_group_has_the_mean_and_a_wider_band(fitted):
    problem, theta = fitted
    model = model_of(problem, theta)
    summary = model.summary
    other = summary.estimate["day_other"]
    assert (other.source, other.sd) == ("prior only", pytest.approx(3.0, rel=0.01))
    assert "day_other" not in {
        name for finding in summary.findings for name in finding.subjects
    }
    logs = (
        replace(problem.logs[0], source=name) for name in ("mon_9.csv", "wed_1.csv")
    )
    monday, wednesday = (float(np.mean(bands_in(model, log)[1].half)) for log in logs)
    assert np.isfinite(wednesday)
    assert wednesday > 5 * monday


@pytest.mark.parametrize("name", [*LOGS, "other.csv"])
def test_a_log_is_predicted_with_the_effect_of_its_group_alone(tmp_path, name):
    log, values = (
        replace(drive(two_joints(tmp_path)), source=f"elsewhere/{name}"),
        TRUTH | DAY,
    )
    grouped = predict(
        identified(of_days(tmp_path), values | {"day_other": 0.0}, "a fit"), log, (1, 2)
    )
    alone = predict(
        identified(shifted(tmp_path, LOGS.get(name, 0.0)), TRUTH, "a fit"), log, (1, 2)
    )
    np.testing.assert_array_equal(grouped, alone)


def test_candidates_that_differ_in_other_groups_alone_are_simulated_once(tmp_path):
    problem = Problem(of_days(tmp_path), logs_of_days(tmp_path))
    theta = np.tile(
        problem.parameters.vector(TRUTH | DAY | {"day_other": 0.0}, ""), (4, 1)
    )
    column = problem.parameters.names.index("day_other")
    theta[:, column] = np.arange(4)
    theta[3, problem.parameters.names.index("day_monday")] = 1.0
    places = {
        "mon_1.csv": [0, 0, 0, 3],
        "tue_1.csv": [0, 0, 0, 0],
        "wed_1.csv": [0, 1, 2, 3],
    }
    for name, place in places.items():
        candidates = problem.bindings.candidates(theta, name)
        first, same = distinct(candidates.joints, candidates.mass)
        assert first[same].tolist() == place
    each = np.vstack([problem.output_errors(one[None]) for one in theta])
    np.testing.assert_array_equal(problem.output_errors(theta), each)


def test_a_group_may_have_another_prior_or_none(tmp_path):
    settings = of_days(tmp_path, day_monday={"fixed": 0.0}, day_other={"sd": 5})
    days = {
        name: p for name, p in settings.parameters.items() if name.startswith("day")
    }
    assert {n: (p.per, p.sd, p.fixed) for n, p in days.items()} == {
        "day_monday": ("monday", 3, 0.0),
        "day_other": ("other", 5, None),
        "day_tuesday": ("tuesday", 3, None),
    }


@pytest.mark.parametrize(
    ("log", "own", "message"),
    [
        (
            None,
            {"day": {"quantity": "dead_band", "per": "group", "bounds": [0, 1]}},
            "per group needs sd",
        ),
        (
            None,
            {"day": EFFECT | {"per": "sunday"}},
            r"log\.groups\.sunday: none of the logs is in it",
        ),
        (
            {},
            {},
            r"line \d+: parameters.day: per: group needs log\.groups: \{name: pattern\}",
        ),
        ({"groups": {"group": "a.csv"}}, {}, "none of them named group"),
        ({"groups": ["a.csv"]}, {}, r"needs log\.groups: \{name: pattern\}"),
        (
            {"period_s": 0.05, "groups": {"a": "mon_*", "b": "*"}},
            {},
            "mon_1.csv is in the groups a and b",
        ),
        (
            {"period_s": 0.05, "groups": GROUPS | {"x": "fri_*"}},
            {},
            r"log\.groups\.x: none of the logs is in it",
        ),
    ],
)
def test_groups_that_mean_nothing_are_refused_in_one_line(tmp_path, log, own, message):
    with pytest.raises(HydroidError, match=message) as error:
        hydroid.fit(of_days(tmp_path, log, **own), logs_of_days(tmp_path))
    assert "\n" not in str(error.value)
