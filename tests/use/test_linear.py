"""The linear system against small steps of the plant."""

import json

import numpy as np
import pytest
from made_models import VALUES, made_model
from scipy.signal import StateSpace, lsim

from hydroid.errors import SettingsError
from hydroid.plant import Plant
from hydroid.reporting.linear_page import linear_page
from hydroid.reporting.page_file import write_page
from hydroid.use.linear import linearise

HELD = {"shoulder": 40.0, "elbow": -50.0}


def made(model: str, **hydraulics: float) -> Plant:
    changes = {"simulation.model": model, "log.period_s": 0.002}
    made = made_model(VALUES, changes, hydraulics={"leakage": 0.0} | hydraulics)
    return Plant(made, joints=[2, 3])


def response(plant: Plant, change: dict[str, float], seconds: float) -> np.ndarray:
    """Angles of both joints under held commands that change after a second, (T, 2),
    from then on."""
    plant.reset("study")
    held = dict(HELD)
    while plant.time < 1.0 - 1e-9:
        plant.step(held)
    angle = [plant.angle[[1, 2]]]
    for _ in range(round(seconds / plant.period)):
        angle.append(
            plant.step(
                {name: one + change.get(name, 0.0) for name, one in held.items()}
            )[[1, 2]]
        )
    return np.array(angle)


@pytest.mark.parametrize(
    ("model", "values", "close"),
    [
        ("quasi-static", {}, 0.03),
        (
            "quasi-static",
            {"opening_lag": 0.1, "pilot_lag_a": 0.05, "pilot_lag_b": 0.05},
            0.03,
        ),
        (
            "quasi-static",
            {
                "oil_frequency": 3.0,
                "oil_damping": 0.3,
                "oil_damping_share": 0.6,
                "pump_flow": 5.0,
                "pump_droop": 100.0,
            },
            0.05,
        ),
        ("dynamic", {}, 0.1),
    ],
)
@pytest.mark.parametrize("name", ["shoulder", "elbow"])
def test_a_small_step_moves_the_plant_as_the_linear_system_says(
    model, values, close, name
):
    plant, seconds = made(model, **values), 0.8
    before = response(plant, {}, seconds)
    after = response(plant, {name: 2.0}, seconds)
    plant.reset("study")
    while plant.time < 1.0 - 1e-9:
        plant.step(HELD)
    command = np.array([HELD.get(one, 0.0) for one in plant.names])
    linear = linearise(plant, command)
    time = np.arange(len(before)) * plant.period
    late = np.searchsorted(time, linear.delay[linear.joints.index(name)] - 1e-9)
    given = np.zeros((len(time), 2))
    given[late:, linear.joints.index(name)] = 2.0
    system = StateSpace(linear.a, linear.b, linear.c, linear.d)
    found = lsim(system, given, time, interp=False)[1][:, :2]
    moved = after - before
    size = np.abs(moved).max()
    assert np.abs(found - moved).max() < close * size


def test_it_reads_as_json_with_names_and_units():
    plant = made("quasi-static", opening_lag=0.1)
    command = np.array([HELD.get(one, 0.0) for one in plant.names])
    read = json.loads(linearise(plant, command).text())
    assert read["joints"] == ["shoulder", "elbow"]
    assert read["inputs"] == ["shoulder command [%]", "elbow command [%]"]
    assert read["outputs"] == [
        "shoulder angle [rad]",
        "elbow angle [rad]",
        "shoulder speed [rad/s]",
        "elbow speed [rad/s]",
    ]
    states = len(read["states"])
    assert np.shape(read["A"]) == (states, states)
    assert np.shape(read["B"]) == (states, 2)
    assert np.shape(read["C"]) == (4, states)
    assert read["delay"][0] == pytest.approx(0.05)
    speed = plant.speeds(command)[[1, 2]]
    np.testing.assert_allclose(read["speed"], speed)


@pytest.mark.parametrize(
    ("shoulder", "says"),
    [
        (20.0, "shoulder at 20 % is within its dead band.*beyond 25.5 % it moves"),
        (-25.2, "shoulder at -25.2 % is within its dead band"),
        (100.1, "the command of shoulder is 100.1 %; allowed are -100 to 100 %"),
        (np.nan, "the command of shoulder is nan %"),
        (np.inf, "the command of shoulder is inf %"),
    ],
)
def test_a_command_about_which_no_speed_has_a_slope(shoulder: float, says: str):
    plant = made("quasi-static", dead_band=25.0)
    with pytest.raises(SettingsError, match=says):
        linearise(plant, np.array([0, shoulder, 40.0, 0, 0, 0, 0]))


def test_joints_without_a_command_stand():
    """The others are a system of their own, with the slopes that the plant has so."""
    plant = made("quasi-static", opening_lag=0.1)
    command = np.array([0, 0, 40.0, 0, 0, 0, 0])
    linear = linearise(plant, command)
    assert linear.joints == ("elbow",)
    assert linear.b.shape == (len(linear.states), 1)
    more = plant.speeds({"elbow": 40.5})[2]
    less = plant.speeds({"elbow": 39.5})[2]
    slope = linear.response(0, np.array([0.05]))[0]
    assert abs(slope) == pytest.approx(abs(more - less), rel=0.03)
    with pytest.raises(SettingsError, match="no joint has a command"):
        linearise(plant, np.zeros(7))


def test_the_slope_at_full_command_is_that_from_below():
    plant = made("quasi-static")
    full, below = (
        linearise(plant, np.array([0, command, 40.0, 0, 0, 0, 0]))
        for command in (100.0, 99.0)
    )
    row = full.states.index("shoulder angle")
    column = full.states.index("shoulder plunger")
    assert full.a[row, column] == pytest.approx(below.a[row, column], rel=0.02)
    assert full.a[row, column] > 0.0


def test_step_and_bode_are_those_of_the_system():
    """A step is late by delay and lag, and a sine of the command comes out as Bode's
    plot says."""
    plant = made("quasi-static", opening_lag=0.1)
    command = np.array([HELD.get(one, 0.0) for one in plant.names])
    linear = linearise(plant, command)
    time = np.linspace(0.0, 4.0, 4001)
    system = StateSpace(linear.a, linear.b, linear.c, linear.d)
    for k in range(2):
        step = linear.step(k, time)
        delay = linear.delay[k]
        assert not step[time < delay - 1e-9].any()
        # three time constants after the delay 95 % of the speed is there
        late = np.searchsorted(time, delay + 0.3)
        assert step[late] / np.abs(step).max() == pytest.approx(0.95, abs=0.05)
        given = np.zeros((len(time), 2))
        given[:, k] = np.sin(2.0 * np.pi * 2.0 * time)
        speed = lsim(system, given, time)[1][:, 2 + k]
        # over the last whole second, two periods
        last = slice(3000, 4000)
        wave = np.exp(-2j * np.pi * 2.0 * (time + delay))
        swing = 2j * np.mean(speed[last] * wave[last])
        assert linear.response(k, np.array([2.0]))[0] == pytest.approx(swing, rel=0.03)


def test_its_page_draws_both_with_bands(tmp_path):
    plant = made("quasi-static", opening_lag=0.1)
    command = np.array([HELD.get(one, 0.0) for one in plant.names])
    linear = linearise(plant, command)
    other = linearise(made("quasi-static", opening_lag=0.2), command)
    page = linear_page(linear, [other, linear], plant.identified.settings.arm)
    plots = [plot.make() for plot in page.plots]
    assert len(plots) == 2
    for chart in plots:
        for panel in chart.panels:
            assert [mark.kind for mark in panel.marks] == ["band", "line"]
    assert write_page(page, tmp_path).is_file()
