"""A plunger by its law: where it ends, and its way there against an independent
integrator with a seat."""

import numpy as np
import pytest
from hydraulic_reference import parameters, watched
from scipy.integrate import solve_ivp

from hydroid.hydraulics.records import Records
from hydroid.hydraulics.solenoid import (
    coil_current,
    force_curve,
    resting_stroke,
    side_voltage,
)
from hydroid.settings.hydraulics import HydraulicSettings

SETTINGS = HydraulicSettings()
# [N·s/m]; up to 7.5 it reaches its seat
DAMPINGS = (0.3, 1.0, 3.0, 5.0, 7.5, 10.0, 20.0, 100.0, 1000.0)
HELD = 400  # samples of 0.01 s; the slowest of these plungers settle in 3 s
GIVEN_AGAIN = np.repeat([60.0, 0.0, 60.0, 0.0, -80.0, 0.0], HELD)  # [%]


def drive(p: Records, command: float) -> float:
    """Drive k i² [N·m²] of the coil of side A under a steady command [%]."""
    one = p[0, 0]
    coil, _ = force_curve(
        one.force_1, one.force_2, one.stroke_1, one.stroke_2, one.rated_current
    )
    voltage = side_voltage(command, 1.0, one.onset_a) if command > 0 else 0.0
    return float(coil * coil_current(voltage, one.current_max, one.current_min) ** 2)


def gap(p: Records) -> float:
    one = p[0, 0]
    return float(
        force_curve(
            one.force_1, one.force_2, one.stroke_1, one.stroke_2, one.rated_current
        )[1]
    )


def strokes(p: Records, commands: np.ndarray, period: float) -> np.ndarray:
    """Stroke of side A after each command [m], by an integrator that stops the plunger
    at its seat."""
    one = p[0, 0]
    delta = gap(p)
    # a field of a record takes longer than the law itself
    damping = float(one.plunger_damping_a)
    stiffness = float(one.plunger_stiffness)
    mass = float(one.plunger_mass)
    state = np.array([resting_stroke(drive(p, 0.0), delta, stiffness), 0.0])
    ends: list[float] = []

    def reaches_seat(_: float, z: np.ndarray, __: float) -> float:
        return z[0] + 1e-15

    reaches_seat.terminal, reaches_seat.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]

    def motion(_: float, z: np.ndarray, pull: float) -> list[float]:
        stroke, speed = z.tolist()
        force = pull / (stroke + delta) ** 2 - damping * speed - stiffness * stroke
        return [speed, force / mass]

    for command in commands:
        time = 0.0
        while time < period:
            how = {
                "args": (drive(p, command),),
                "events": reaches_seat,
                "rtol": 1e-7,
                "atol": 1e-11,
            }
            part = solve_ivp(motion, (time, period), state, method="Radau", **how)
            time, state = part.t[-1], part.y[:, -1]
            if part.status == 1:  # inelastic, and the coil pulls it off at once
                state = np.array([0.0, 0.0])
        ends.append(float(state[0]))
    return np.array(ends)


@pytest.mark.parametrize("damping", DAMPINGS)
def test_a_command_taken_away_and_given_again_ends_where_statics_say(damping: float):
    p = parameters(SETTINGS, plunger_damping=damping)
    _, seen, _ = watched(p, GIVEN_AGAIN, SETTINGS)
    ends = seen.spool[HELD - 1 :: HELD]
    stiffness = p[0, 0].plunger_stiffness
    pulled, idle = (
        float(resting_stroke(drive(p, u), gap(p), stiffness)) for u in (60.0, 0.0)
    )
    moved = pulled - idle
    np.testing.assert_allclose(
        ends[[0, 1, 2, 3, 5]], [moved, 0.0, moved, 0.0, 0.0], atol=1e-3 * moved
    )
    assert ends[4] < -moved


@pytest.mark.parametrize("damping", [1.0, 5.0, 7.5, 20.0])
def test_a_plunger_moves_as_an_independent_integrator_with_a_seat_says(damping: float):
    commands = np.repeat([90.0, 0.0, 90.0], 20)
    p = parameters(SETTINGS, plunger_damping=damping)
    _, seen, _ = watched(p, commands, HydraulicSettings(substeps=40))
    rest = resting_stroke(drive(p, 0.0), gap(p), p[0, 0].plunger_stiffness)
    exact = strokes(p, commands, 0.01)
    np.testing.assert_allclose(seen.spool + rest, exact, atol=0.03 * np.ptp(exact))


def test_a_delay_that_ends_a_rounding_before_a_step_moves_the_plunger_all_the_same():
    parts = [
        parameters(SETTINGS, delay=0.01 * steps)
        for steps in (3.0, np.nextafter(3.0, 0.0))
    ]
    spools = [watched(p, np.full(60, 50.0), SETTINGS)[1].spool for p in parts]
    assert spools[0][-1] > 1e-4
    np.testing.assert_allclose(spools[1], spools[0], atol=1e-12)
