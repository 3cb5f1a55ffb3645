"""From the command in % to the plunger: calibration (article 2.1), amplifier, solenoid
(2.2), one per side.

The calibration of the Compact Field Point lifts the voltage over the valve's dead zone
as soon as there is a command: A and C are the voltages at the smallest command, B and D
those at full command. The article estimates A and C and does not print B and D. Ours is
the amplifier's full scale of 10 V for both, so that the spool opens over the whole
range of the command.

The article parametrises the solenoid's force, equation (5), by two points (x1, F1),
(x2, F2) of the curve at rated current i0. Read as

    F = k i² / (x + δ)²,   r = √(F1/F2),   δ = (x2 − r x1) / (r − 1),   k i0² = F1 (x1 + δ)²,

the force falls with stroke, and the plunger m ẍ + λ ẋ + K x = F has exactly one
equilibrium x > 0. (The article prints a minus sign, calls λ the stiffness and K the
damping, and gives three constants where two act.) Such a curve exists if F1 > F2 > 0,
x2 > x1 > 0 and F1/F2 < (x2/x1)². Rated current, mass, λ and K are ours.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

from typing import Any

import numpy as np

from hydroid.hydraulics.elementwise import compilable, implicit_weight

# voltage at full command, and from which the current is I_max [V], equation (4)
FULL_SCALE = 10.0


@compilable
def beyond_dead_band(
    start: float, asked: float, steps: float, keep: float, dead_band: float
) -> Any:
    """What a pilot stage passes on beyond its dead band during a step [%], and for
    which part of the step.

    Both are exact: a lag that is short beside the step would else open the valve
    earlier or later. The stage has `start` of the command at the start [%], and is
    first-order behind the one that is `asked` [%]: its lag is so many steps, of which
    each leaves the part `keep` of the error (`elementwise.kept`).
    """
    end = asked + (start - asked) * keep
    if start <= dead_band and end <= dead_band:
        return 0.0, 0.0
    whole = asked - dead_band + (start - asked) * (1.0 - keep) * steps
    if start > dead_band and end > dead_band:
        return whole, 1.0
    # part of the step after which the stage is at the edge of its dead band
    reached = 0.0
    if asked != dead_band:
        reached = steps * np.log((start - asked) / (dead_band - asked))
    until_edge = (start - dead_band) * steps + (asked - dead_band) * reached
    if start > dead_band:
        return until_edge, reached
    return whole - until_edge, 1.0 - reached


@compilable
def side_voltage(beyond, part, onset, dead_band=0.0) -> Any:
    """Voltage of the amplifier that moves the joint in the command's positive
    direction, (2) and (3).

    A mean over a time, for a `part` of which the command exceeds the dead band, by
    `beyond` in the mean [%]. `onset` is the voltage at the smallest command that moves
    it [V]: A of side A, C of side B.
    """
    return part * onset + beyond * (FULL_SCALE - onset) / (100.0 - dead_band)


@compilable
def drive(voltage, c) -> Any:
    """Drive k i² [N·m²] of a coil at a voltage: equations (4) and (5)."""
    current = coil_current(voltage, c.current_max, c.current_min)
    return c.coil * current * current


@compilable
def coil_current(voltage, current_max, current_min) -> Any:
    """Coil current [A], equation (4): I_min at 0 V, I_max from 10 V on, a straight line
    between."""
    share = np.minimum(np.maximum(voltage, 0.0), FULL_SCALE) / FULL_SCALE
    return current_min + share * (current_max - current_min)


def curve_exists(force_1, force_2, stroke_1, stroke_2) -> Any:
    """Whether a force-stroke curve runs through (stroke_1, force_1) and (stroke_2,
    force_2), elementwise."""
    rising = (
        (force_1 > force_2) & (force_2 > 0) & (stroke_2 > stroke_1) & (stroke_1 > 0)
    )
    return rising & (force_1 * stroke_1**2 < force_2 * stroke_2**2)


def force_curve(force_1, force_2, stroke_1, stroke_2, rated_current) -> Any:
    """Return the curve's constants k [N·m²/A²] and δ [m] from forces [N], strokes [m]
    and i0 [A].

    Where no curve exists, it is a coil without force: k = 0, δ = stroke_2.
    """
    exists = curve_exists(force_1, force_2, stroke_1, stroke_2)
    # any ratio but 1 does where there is no curve: what follows from it is not taken
    quotient = np.where(exists, force_1 / np.where(exists, force_2, 1.0), 4.0)
    ratio = np.sqrt(quotient)
    gap = np.where(exists, (stroke_2 - ratio * stroke_1) / (ratio - 1.0), stroke_2)
    at_rated = force_1 * (stroke_1 + gap) ** 2
    return np.where(exists, at_rated / rated_current**2, 0.0), gap


@compilable
def coil_force(drive, stroke, gap) -> Any:
    """Force on the plunger [N], equation (5), from drive k i² [N·m²], stroke [m] and
    gap δ [m]."""
    reach = stroke + gap
    return drive / (reach * reach)


@compilable
def resting_stroke(drive, gap, stiffness) -> Any:
    """Stroke [m] where spring and coil balance: K x (x + δ)² = k i².

    Newton's method from ∛(k i²/K), which lies beyond the only root of a convex
    function, so that every iterate does too; seven reach machine precision from any δ >
    0.
    """
    pull = drive / stiffness
    stroke = np.cbrt(pull)
    for _ in range(7):
        reach = stroke + gap
        # no drive, no gap: 0 / tiny rather than 0 / 0
        slope = reach * (reach + 2.0 * stroke) + 1e-300
        stroke = stroke - (stroke * reach * reach - pull) / slope
    return np.maximum(stroke, 0.0)


@compilable
def plunger_weight(damping, step, c) -> Any:
    """Weight of the new state in `plunger_step`; at rest, spring and coil are together
    at most 3 K stiff.

    The damping is λ of this side [N·s/m].
    """
    natural = np.sqrt(3.0 * c.plunger_stiffness / c.plunger_mass)
    return implicit_weight(step * np.maximum(damping / c.plunger_mass, natural))


@compilable
def plunger_step(motion, drive, damping, step, weight, c) -> Any:
    """Advance m ẍ + λ ẋ + K x = F, x >= 0, by one linearised step [s].

    `motion` is stroke [m] and speed [m/s]; returned are those after the step. The drive
    k i² [N·m²] holds during the step. λ is the `damping` [N·s/m]. A plunger that
    reaches its seat at x = 0 stops there.
    """
    stroke, speed = motion
    force = coil_force(drive, stroke, c.gap)
    slope = c.plunger_stiffness + 2.0 * force / (stroke + c.gap)
    drag = damping + weight * step * slope
    net = force - c.plunger_stiffness * stroke - drag * speed
    gain = step * net / (c.plunger_mass + weight * step * drag)
    after = stroke + step * (speed + weight * gain)
    speed = speed + gain
    if after <= 0.0:
        return 0.0, np.maximum(speed, 0.0)
    return after, speed
