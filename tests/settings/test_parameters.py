"""Settings of parameters: nominal values, priors, the bounds that follow, one parameter
per joint."""

import math

import numpy as np
import pytest

from hydroid import load_settings
from hydroid.errors import SettingsError
from hydroid.parameters import Parameter, ParameterSet


def parameter(config: str = "fit-hyd", name: str = "A_A", **entry) -> Parameter:
    changes = {f"parameters.{name}": entry}
    found = load_settings(config, changes).parameter_set()
    return found.parameters[found.names.index(name)]


def test_nominal_values_come_from_the_arm_and_the_hydraulics():
    area = parameter(quantity="area_a", joints=[2], within=2)
    assert area.prior is not None
    assert area.prior.nominal == 1000
    assert parameter(name="M3", quantity="mass", link="link3", within=2).start == 22.5
    assert parameter(name="A", quantity="onset_a", joints=[2], sd=0.2).start == 1.4
    # joints 2 and 3 agree, joint 1 does not
    assert parameter(quantity="area_a", joints=[2, 3], within=2).start == 1000
    with pytest.raises(
        SettingsError, match=r"parameters.A_A: within: needs a nominal value"
    ):
        parameter(quantity="area_a", joints=[1, 2], within=2)
    own = parameter(quantity="area_a", joints=[1, 2], nominal=700, within=2)
    assert own.start == 700


def test_within_holds_95_percent_of_a_log_normal_prior():
    prior = parameter(quantity="area_a", joints=[2], within=2).prior
    assert prior is not None
    assert prior.value(1.96) == pytest.approx(2000)
    assert prior.value(-1.96) == pytest.approx(500)
    assert prior.score(np.array([1000.0, 2000.0, 500.0])) == pytest.approx(
        [0.0, 1.96, -1.96]
    )


def test_bounds_follow_from_the_prior():
    area = parameter(quantity="area_a", joints=[2], within=2)
    assert area.upper == pytest.approx(1000 * math.exp(4 * math.log(2) / 1.96))
    assert area.log
    wide = parameter(name="A", quantity="onset_a", joints=[2], nominal=1.0, sd=0.5)
    assert (wide.lower, wide.upper) == (0.0, 3.0)
    assert not wide.log
    band = parameter(quantity="dead_band", joints=[2], nominal=40, within=4)
    assert band.upper == 99.0
    mass = parameter(name="M3", quantity="mass", link="link3", sd=10)
    assert mass.lower == pytest.approx(0.225)
    assert mass.log


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"within": 2, "sd": 1.0}, "not both"),
        ({"within": 1.0}, "must be greater than 1"),
        ({"sd": 0.0}, "must be greater than 0"),
        ({"nominal": 3.0}, "needs bounds"),
        ({"bounds": [10, 20], "nominal": 30}, "nominal 30 lies outside the bounds"),
        ({"bounds": [10, 20], "start": 30}, "start 30 lies outside the bounds"),
        (
            {"bounds": [10, 20], "within": 2},
            "nominal value 1000 mm² lies outside the bounds",
        ),
        ({"nominal": 0.0, "within": 2}, "nominal value above 0"),
        ({"nominal": -1.0, "sd": 2}, "cannot be negative"),
        ({"quantity": "lever_slope", "fixed": -1}, "cannot be below -0.9"),
        ({"quantity": "compensation", "fixed": 7}, "cannot be above 1"),
        ({"quantity": "dead_band", "bounds": [0, 150]}, "cannot be above 99 %"),
        ({"each": True, "within": 2}, "not both"),
        ({"quantity": "pump_flow", "bounds": [1, 2]}, "all joints share the pump"),
        ({"quantity": "curve_a", "start": 2.0}, "a list of 4 factors"),
        ({"quantity": "curve_a", "start": [1, 1, 1]}, "a list of 4 factors"),
        (
            {"quantity": "curve_a", "start": [1, 1, 1, 0]},
            "start 0 lies outside the bounds",
        ),
    ],
)
def test_settings_that_make_no_sense_are_refused(entry, words):
    with pytest.raises(SettingsError, match=words):
        parameter(**{"quantity": "area_a", "joints": [2]} | entry)


def test_each_writes_one_parameter_per_joint_with_its_own_nominal_value():
    changes = {
        "outputs": [1, 2],
        "parameters.A_A": {"quantity": "area_a", "each": True, "within": 2},
        "parameters.A_A_shoulder.within": 1.5,
        "parameters.C": {"quantity": "onset_b", "each": [2], "bounds": [0.1, 3.0]},
    }
    settings = load_settings("fit-hyd", changes)
    parameters = {p.name: p for p in settings.parameter_set().parameters}
    assert (parameters["A_A_azimuth"].start, parameters["A_A_shoulder"].start) == (
        800,
        1000,
    )
    assert parameters["A_A_shoulder"].prior.sd == pytest.approx(math.log(1.5) / 1.96)
    assert settings.parameters["A_A_azimuth"].joints == (1,)
    assert settings.parameters["C"].joints == (2,)


def test_a_curve_stands_for_its_factors_and_their_smoothness():
    changes = {
        "outputs": [1, 2],
        "parameters.C": {"quantity": "curve_a", "each": True, "start": [5, 2, 1, 1]},
        "parameters.C_shoulder_3.start": 1.5,
        "parameters.F": {"quantity": "curve_b", "joints": [2], "fixed": 1},
    }
    settings = load_settings("fit-hyd", changes)
    parameters = {p.name: p for p in settings.parameter_set().parameters}
    own = [parameters[f"C_shoulder_{part}"] for part in (1, 2, 3, 4)]
    assert [p.start for p in own] == [5, 2, 1.5, 1]
    assert all(p.log and p.lower < 0.01 and p.upper > 100 for p in own)
    assert settings.parameters["C_azimuth_2"].quantity == "curve_2_a"
    assert settings.priors["C_shoulder"].smooth == tuple(p.name for p in own)
    assert parameters["F_4"].fixed == 1
    assert "F" not in settings.priors
    again = load_settings(
        "fit-hyd", settings.model_dump(mode="json", include={"parameters", "priors"})
    )
    assert again.parameters == settings.parameters
    assert again.priors == settings.priors


def test_a_log_scale_maps_the_unit_box_by_ratios_and_back():
    parameters = ParameterSet(
        (Parameter("a", "", 0.1, 1000.0, log=True), Parameter("b", "", 0.0, 4.0))
    )
    theta = parameters.from_unit(np.array([[0.0, 0.0], [0.25, 0.25], [1.0, 1.0]]))
    assert theta[:, 0] == pytest.approx([0.1, 1.0, 1000.0])
    assert theta[-1, 0] == 1000.0
    assert theta[:, 1] == pytest.approx([0.0, 1.0, 4.0])
    assert parameters.to_unit(theta)[1] == pytest.approx([0.25, 0.25])


def test_a_start_is_stated_clipped_or_in_the_middle_of_the_scale():
    entry = {"quantity": "area_a", "joints": [2], "bounds": [250.0, 4000.0]}
    assert parameter(**entry, start=300.0).start == 300
    assert (
        parameter(**entry | {"bounds": [1500.0, 4000.0], "nominal": 2000.0}).start
        == 2000
    )
    plain = load_settings("article-hyd").parameter_set()
    assert plain.start[plain.names.index("A_A")] == 0.5 * (250 + 2500)


@pytest.mark.parametrize("model", ["dynamic", "quasi-static", "ladder"])
def test_stage_1_takes_its_steps_per_sample_whatever_the_model_of_stage_2(model: str):
    changes = {"simulation.model": model, "simulation.steps_per_sample": 4}
    assert load_settings("fit-mech", changes).stepping.steps == 4
    assert load_settings("fit-hyd", changes).stepping.steps == (
        4 if model == "dynamic" else 1
    )
