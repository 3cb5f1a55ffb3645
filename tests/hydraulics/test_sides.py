"""What a valve has for each side: symmetry under swapping them, one name for both, recovery from a log."""

import numpy as np
import pytest
from hydraulic_reference import changed, simulate
from hydraulic_reference import wheel as lone_wheel
from recovery import assert_recovered, duties, recover, settings_of

from hydroid.errors import SettingsError
from hydroid.hydraulics.records import BARS, LINKAGE, ROTARY, nominal_joints
from hydroid.quantity_table import QUANTITIES, ROWS, TARGETS
from hydroid.settings.arm import Arm
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.load import validate

SETTINGS = HydraulicSettings()
UNLIKE = {
    "delay_a": 0.05, "delay_b": 0.12, "plunger_damping_a": 60.0, "plunger_damping_b": 20.0,
    "opening_exponent_a": 2.0, "opening_exponent_b": 1.3, "slot_width_a": 2.5, "slot_width_b": 1.5,
    "overlap_a": 0.2, "overlap_b": 0.1, "opening_a": 0.4, "opening_b": 0.3, "onset_a": 1.0, "onset_b": 2.0,
    "dead_band_a": 5.0, "dead_band_b": 12.0,
}  # fmt: skip


def wheel(arm: Arm, values: dict[str, float], command: np.ndarray) -> np.ndarray:
    """Angles [rad], (T,), of a lone wheel under a rotary actuator."""
    linkage = np.array([(ROTARY, 0.0, 0.0, 0.0, *[0.0] * len(BARS))], LINKAGE).view(np.recarray)
    p = changed(nominal_joints(arm, SETTINGS)[None, [3]].view(np.recarray), damping=5.0, **values)
    return simulate(p, command, SETTINGS, start=0.0, model=lone_wheel(0.05), linkage=linkage)[0]


def test_swapped_sides_mirror_the_motion(arm: Arm):
    command = np.repeat([60.0, -80.0, 40.0, 0.0, -50.0, 90.0], 80)
    other = {"a": "b", "b": "a"}
    swapped = {f"{name[:-1]}{other[name[-1]]}": value for name, value in UNLIKE.items()}
    here, there = wheel(arm, UNLIKE, command), wheel(arm, swapped, -command)
    assert np.ptp(here) > 0.5
    np.testing.assert_allclose(there, -here, atol=1e-9)
    assert abs(wheel(arm, UNLIKE, -command) + here).max() > 0.05


@pytest.mark.parametrize("name", ["delay", "plunger_damping", "opening_exponent", "slot_width", "overlap"])
def test_a_name_without_side_sets_both(name: str):
    one, both = (
        validate(values, HydraulicSettings, "here")
        for values in ({name: 0.7}, dict.fromkeys(TARGETS[name], 0.7))
    )
    assert one == both
    with pytest.raises(SettingsError, match=f"{name}_b is given twice"):
        validate({name: 0.7, f"{name}_b": 0.7}, HydraulicSettings, "here")


def test_every_side_has_its_other():
    for row in ROWS:
        a, b = (QUANTITIES[name] for name in TARGETS[row.name]) if row.sides else (QUANTITIES[row.name],) * 2
        assert (a.unit, a.factor, a.span) == (b.unit, b.factor, b.span)
        assert "{" not in a.meaning + b.meaning + a.plain


def test_two_parameters_for_one_side_are_refused():
    bounds = {"bounds": [0.0, 1.0], "joints": [2]}
    settings = settings_of({"d": {"quantity": "delay", **bounds}, "d_B": {"quantity": "delay_b", **bounds}})
    with pytest.raises(SettingsError, match="d and d_B both set the delay_b"):
        recover(settings, [], {}, {})


def test_a_valve_that_differs_by_side_is_recovered():
    """Dead band, delay, lag and exponent of each direction, from one log of duties."""
    truth = {"t_A": 0.15, "t_B": 0.06, "lag_A": 160.0, "lag_B": 60.0, "n_A": 1.8, "n_B": 1.2}
    truth |= {"dead_A": 20.0, "dead_B": 8.0}
    rows = {
        "t_A": ("delay_a", 0.0, 0.5), "t_B": ("delay_b", 0.0, 0.5), "n_A": ("opening_exponent_a", 0.7, 3.0),
        "lag_A": ("plunger_damping_a", 5.0, 500.0), "lag_B": ("plunger_damping_b", 5.0, 500.0),
        "n_B": ("opening_exponent_b", 0.7, 3.0),
        "dead_A": ("dead_band_a", 0.0, 40.0), "dead_B": ("dead_band_b", 0.0, 40.0),
    }  # fmt: skip
    parameters = {
        name: {"quantity": quantity, "joints": [2], "bounds": [low, high]}
        for name, (quantity, low, high) in rows.items()
    }
    settings = settings_of(parameters)
    pose = settings.arm.pose("study")
    log = duties(pose, {2: [50, -40, 80, -90, 60, 0, -60, 40, -30, 90, -70, 30]}, dwell=0.8)
    start = {"t_A": 0.1, "t_B": 0.1, "lag_A": 100.0, "lag_B": 100.0, "n_A": 1.5, "n_B": 1.5}
    start |= {"dead_A": 12.0, "dead_B": 12.0}
    assert_recovered(recover(settings, [log], truth, start), settings, truth)


def test_notches_and_a_slow_return_are_recovered():
    """A valve curve of five parts towards A, and a plunger that returns slower, from one log of duties."""
    truth = {"notch_1": 0.5, "notch_2": 2.0, "notch_3": 0.6, "notch_4": 1.5, "lag": 100.0, "back": 2.5}
    parameters: dict[str, dict[str, object]] = {
        name: {"quantity": f"{name}_a", "joints": [2], "bounds": [0.2, 5.0]} for name in list(truth)[:4]
    }
    parameters["lag"] = {"quantity": "plunger_damping_a", "joints": [2], "bounds": [5.0, 500.0]}
    parameters["back"] = {"quantity": "plunger_back_a", "joints": [2], "bounds": [0.2, 5.0]}
    settings = settings_of(parameters)
    pose = settings.arm.pose("study")
    log = duties(pose, {2: [15, -60, 25, 0, 40, -70, 60, 0, 20, -50, 90, -90, 30, 10]}, dwell=0.8)
    start = dict.fromkeys(list(truth)[:4], 1.0) | {"lag": 60.0, "back": 1.0}
    assert_recovered(recover(settings, [log], truth, start), settings, truth)
