"""A plant under other conditions than the references is the simulation of a log that
holds them; what else is made of a fit is as at the references."""

from dataclasses import replace

import numpy as np
import pytest
from made_logs import HYDRAULIC, TRUTH, at_rest
from made_models import made_model

from hydroid.errors import SettingsError
from hydroid.plant import Plant, PlantBatch, load_plant
from hydroid.prediction import predict

VALUES = (
    TRUTH
    | HYDRAULIC
    | {"A_A": 900.0, "open_A": 0.4, "open_B": 0.4, "delay": 0.0, "friction": 100.0}
)
COLUMNS = {
    "log.engine_speed": {"column": "n", "unit": "rev/s", "reference": 30.0},
    "log.oil_temperature": {"column": "T", "reference": 45.0},
}
EFFECTS = {
    "hydraulics.engine_exponent": 0.6,
    "hydraulics.temperature_effect": 1.0,
    "hydraulics.pump_flow": 2.0,
    "hydraulics.pump_droop": 40.0,
}
CONDITIONS = {"engine_speed": 18.0, "oil_temperature": 65.0}
RELATIVE = [0.6, 20.0]


def model(which="quasi-static"):
    changes = COLUMNS | EFFECTS | {"simulation.model": which}
    return made_model(VALUES, changes, "hyd")


def log_of(settings, joints, seconds):
    """Steps of some joints, from the settings' start pose."""
    rng = np.random.default_rng(0)
    period = settings.log.period_s
    command = np.zeros((round(seconds / period), 7))
    for joint in joints:
        levels = np.repeat(rng.uniform(-80, 80, 1 + len(command) // 60), 60)
        command[:, joint - 1] = levels[: len(command)]
    return at_rest(settings.arm.pose(settings.start_pose), command, period)


def moved(plant, log):
    return np.array([plant.reset(), *map(plant.step, log.command[:-1])])


@pytest.mark.parametrize("which", ["quasi-static", "dynamic"])
def test_a_plant_under_conditions_is_the_simulation_of_a_log_that_holds_them(which):
    fitted = model(which)
    plain = log_of(fitted.settings, [2, 3], 2.0)
    held = replace(plain, conditions=np.tile(RELATIVE, (len(plain.time), 1)))
    expected = predict(fitted, held, [2, 3])
    angle = moved(Plant(fitted, joints=[2, 3], conditions=CONDITIONS), plain)[:, 1:3]
    np.testing.assert_allclose(angle, expected, atol=1e-8)
    as_usual = predict(fitted, plain, [2, 3])
    assert np.abs(as_usual - expected).max() > 0.01
    # by default, and at the references themselves
    at = {"engine_speed": 30.0, "oil_temperature": 45.0}
    for conditions in (None, at):
        plant = Plant(fitted, joints=[2, 3], conditions=conditions)
        np.testing.assert_array_equal(moved(plant, plain)[:, 1:3], as_usual)


def test_speeds_commands_and_batches_are_those_of_the_conditions():
    fitted = model()
    usual, there = (
        Plant(fitted, joints=[2, 3], conditions=given) for given in (None, CONDITIONS)
    )
    command = {usual.names[1]: 60.0}
    speed = there.speeds(command)[1]
    assert 0.0 < abs(speed) < abs(usual.speeds(command)[1])
    wished = np.zeros(len(usual.names))
    wished[1] = 0.9 * speed
    assert abs(there.commands(wished).command[1]) > abs(
        usual.commands(wished).command[1]
    )
    log = log_of(fitted.settings, [2, 3], 1.0)
    alone = [moved(plant, log)[-1] for plant in (usual, there)]
    batch = PlantBatch([usual, there], threads=1)
    batch.reset()
    for row in log.command[:-1]:
        batch.step(row)
    np.testing.assert_array_equal(batch.angle, alone)


def test_a_saved_plant_is_as_at_the_references(tmp_path):
    fitted = model()
    log = log_of(fitted.settings, [2], 1.0)
    Plant(fitted, joints=[2], conditions=CONDITIONS).save(tmp_path)
    np.testing.assert_array_equal(
        moved(load_plant(tmp_path), log), moved(Plant(fitted, joints=[2]), log)
    )
    again = load_plant(tmp_path, conditions=CONDITIONS)
    assert np.abs(moved(again, log) - moved(load_plant(tmp_path), log)).max() > 1e-3


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"engine_speed": 0.0}, "0 rev/s is not from 3 to 300"),
        ({"oil_temperature": 900.0}, "900 degC is not from -60 to 200"),
        ({"throttle": 1.0}, "choose engine_speed and oil_temperature"),
    ],
)
def test_conditions_that_cannot_be_are_refused(given, said):
    with pytest.raises(SettingsError, match=said):
        Plant(model(), conditions=given)
