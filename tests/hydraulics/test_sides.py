"""What a valve has for each side: symmetry under swapping them, one name for both."""

import numpy as np
import pytest
from hydraulic_reference import changed, rotary, simulate, wheel as lone_wheel

from hydroid.errors import SettingsError
from hydroid.hydraulics.records import nominal_joints
from hydroid.quantity_table import TARGETS
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
    p = changed(
        nominal_joints(arm, SETTINGS)[None, [3]].view(np.recarray),
        damping=5.0,
        **values,
    )
    return simulate(rotary(p), command, SETTINGS, start=0.0, model=lone_wheel(0.05))[0]


def test_swapped_sides_mirror_the_motion(arm: Arm):
    command = np.repeat([60.0, -80.0, 40.0, 0.0, -50.0, 90.0], 80)
    other = {"a": "b", "b": "a"}
    swapped = {f"{name[:-1]}{other[name[-1]]}": value for name, value in UNLIKE.items()}
    here, there = wheel(arm, UNLIKE, command), wheel(arm, swapped, -command)
    assert np.ptp(here) > 0.5
    np.testing.assert_allclose(there, -here, atol=1e-9)
    assert abs(wheel(arm, UNLIKE, -command) + here).max() > 0.05


def test_a_lagging_valve_turns_round_when_its_spool_does(arm: Arm):
    """However large its two openings are: a lag ln 2 time constants after full command
    reverses."""
    command = np.repeat([100.0, -100.0], 100)
    turned = list[int]()
    for opening_b in (0.1, 0.4):
        values = {"opening_lag": 0.3, "opening_a": 0.4, "opening_b": opening_b}
        turned.append(int(np.argmax(wheel(arm, values, command))))
    assert turned[0] == pytest.approx(turned[1], abs=1)
    assert turned[0] == pytest.approx(100 + 0.3 * np.log(2) / 0.01, abs=4)


def test_a_lagging_speed_turns_round_where_both_speeds_are_out(arm: Arm):
    """In a time constant T, a speed V to one side has fallen to V/e; the reversal to a
    speed W takes T ln(1 + V/W)."""
    command = np.repeat([100.0, -100.0], 100)
    for opening_b in (0.1, 0.4):
        values = {"opening_lag": 0.3, "opening_a": 0.4, "opening_b": opening_b}
        turned = int(np.argmax(wheel(arm, values | {"lag_of_speed": 1.0}, command)))
        reversal = 0.3 * np.log(1.0 + 0.4 / opening_b)
        assert turned == pytest.approx(100 + reversal / 0.01, abs=4)


@pytest.mark.parametrize(
    "name", ["delay", "plunger_damping", "opening_exponent", "slot_width", "overlap"]
)
def test_a_name_without_side_sets_both(name: str):
    one, both = (
        validate(values, HydraulicSettings, "here")
        for values in ({name: 0.7}, dict.fromkeys(TARGETS[name], 0.7))
    )
    assert one == both
    with pytest.raises(SettingsError, match=f"{name}_b is given twice"):
        validate({name: 0.7, f"{name}_b": 0.7}, HydraulicSettings, "here")
