"""The plugin against Radau on the full coupled equations; at length in
benchmarks/hydraulic_accuracy.py."""

from itertools import pairwise

import numpy as np
import pytest
from hydraulic_reference import draw, parameters, pulses, reference, simulate, watched

from hydroid.hydraulics.records import Records
from hydroid.settings.hydraulics import HydraulicSettings

SETTINGS = HydraulicSettings()


def errors(
    p: Records, command: np.ndarray, exact: np.ndarray, **steps: int
) -> np.ndarray:
    return np.degrees(simulate(p, command, SETTINGS, steps.get("steps", 1)) - exact)


def test_default_settings_hold_the_bound_over_the_search_space():
    rng = np.random.default_rng(21)
    command, p = pulses(rng, 300), parameters(SETTINGS, **draw(rng, 3))
    exact = np.array(
        [reference(p[i : i + 1].view(np.recarray), command)[0] for i in range(3)]
    )
    error = errors(p, command, exact)
    assert np.ptp(exact, axis=1).max() > np.radians(10)
    assert np.median(np.sqrt((error**2).mean(axis=1))) < 0.1
    assert abs(error).max() < 0.5


def test_pressures_follow_the_reference_and_refinement_is_first_order_or_better():
    command, p = pulses(np.random.default_rng(23), 200), parameters(SETTINGS)
    exact, pressure = reference(p, command)
    found = watched(p, command, SETTINGS)[1].pressure
    assert np.sqrt(((found - pressure[1:]) ** 2).mean()) < 0.5e5
    sizes = [
        np.sqrt((errors(p, command, exact, steps=k) ** 2).mean()) for k in (1, 2, 4, 8)
    ]
    assert all(b < 0.6 * a for a, b in pairwise(sizes)), sizes


@pytest.mark.parametrize(
    "optional",
    [
        {"overlap_a": 0.2, "overlap_b": 0.3, "opening_exponent": 1.6, "opening_b": 0.3},
        {
            "opening_exponent": 1.3,
            "curve_1_a": 8.0,
            "curve_2_a": 0.4,
            "curve_3_b": 2.5,
            "curve_4_b": 0.5,
        },
        {"dry_friction": 500.0, "leakage": 0.002, "supply_pressure": 180.0},
        {"return_a": 2.5, "return_b": 0.6, "anticavitation": 2.0},
        {"plunger_mass": 0.1, "plunger_damping": 15.0, "bulk_modulus": 3000.0},
        {"pump_flow": 1.0},
        {"pump_flow": 1.0, "line_volume": 50.0},
        {"pump_flow": 2.0, "pump_droop": 60.0},
        {"pump_flow": 1.0, "pump_droop": 60.0, "pump_limit": 25.0},
        {"pump_flow": 1.0, "pump_droop": 60.0, "pump_exponent": 2.5},
        {"pump_flow": 2.0, "pump_droop": 60.0, "pump_bypass": 1.0},
    ],
)
def test_optional_physics_agrees_too(optional: dict[str, float]):
    command, p = (
        pulses(np.random.default_rng(24), 200),
        parameters(SETTINGS, **optional),
    )
    exact, _ = reference(p, command)
    error = errors(p, command, exact[None])
    assert np.ptp(exact) > np.radians(3)
    assert np.sqrt((error**2).mean()) < 0.05
    assert abs(error).max() < 0.2
