"""One joint of one candidate during a look-ahead: what the compiled loops of `kernel` do with it.

c is its record of coefficients, z what it carries from step to step, w its scratch pad (`records` lists
their fields). Compiled code only: plain numpy belongs to the components, whose laws are called here.
"""

from typing import Any

import numpy as np

from hydroid.hydraulics.amplifier import coil_current
from hydroid.hydraulics.calibration import side_voltage
from hydroid.hydraulics.cylinder import friction_damping, stop_damping, triangle, volume
from hydroid.hydraulics.elementwise import compilable, implicit_share
from hydroid.hydraulics.parameters import LINEAR, NONE, ROTARY
from hydroid.hydraulics.solenoid import plunger_share, plunger_step, resting_stroke
from hydroid.hydraulics.valve import opening, port_flow, spool


@compilable
def drives(c: Any, command: float) -> Any:
    """Drives k i² [N·m²] of coils A and B at a command [%]: equations (2) to (5)."""
    current_a = coil_current(side_voltage(command, c.onset_a, c.full_a), c.current_max, c.current_min)
    current_b = coil_current(side_voltage(-command, c.onset_b, c.full_b), c.current_max, c.current_min)
    return c.coil * current_a * current_a, c.coil * current_b * current_b


@compilable
def begin(c: Any, z: Any, w: Any, angle: float, velocity: float) -> None:
    """Geometry and chamber pressures at the start of the step."""
    z.angle, z.velocity = angle, velocity
    w.way, w.speed, w.torque, w.resistance, w.oil_stiffness = 0.0, velocity, 0.0, 0.0, 0.0
    w.flow_a, w.flow_b = 0.0, 0.0
    if c.kind == LINEAR:
        w.travel, w.arm, w.slope = triangle(angle, c.a, c.b, c.theta0, c.shortest)
        volume_a = volume(w.travel, c.area_a, c.dead_volume)
        volume_b = volume(c.stroke - w.travel, c.area_b, c.dead_volume)
        w.pressure_a = z.oil_a - c.bulk_modulus * np.log(volume_a / c.dead_volume)
        w.pressure_b = z.oil_b - c.bulk_modulus * np.log(volume_b / c.dead_volume)
    elif c.kind == ROTARY:
        w.travel, w.arm, w.slope = 0.0, 1.0, 0.0
        w.pressure_a = z.oil_a - c.bulk_modulus * c.area_a * angle / c.dead_volume
        w.pressure_b = z.oil_b + c.bulk_modulus * c.area_b * angle / c.dead_volume


@compilable
def command(c: Any, w: Any, commands: Any, newest: int, joint: int, period: float, substeps: int) -> None:
    """Drives before and after the delayed command changes, `fresh` sub-steps into this step."""
    late = np.floor(c.delay / period)
    w.fresh = (c.delay / period - late) * substeps
    place = newest - int(late)
    w.new_a, w.new_b = drives(c, commands[place, joint])
    w.old_a, w.old_b = drives(c, commands[place - 1, joint])
    w.plunger_share = plunger_share(c.plunger_mass, c.plunger_damping, c.plunger_stiffness, period / substeps)


@compilable
def _plunger(c: Any, w: Any, stroke: float, speed: float, drive: float, step: float) -> Any:
    mass, damping, stiffness = c.plunger_mass, c.plunger_damping, c.plunger_stiffness
    return plunger_step(stroke, speed, drive, c.gap, mass, damping, stiffness, step, w.plunger_share)


@compilable
def _chamber_flow(c: Any, pressure: float, pump_area: float, tank_area: float) -> Any:
    supply, tank = c.supply_pressure, c.tank_pressure
    transition, limit = c.transition_pressure, c.flow_limit
    return port_flow(pressure, pump_area, tank_area, supply, tank, c.conductance, transition, limit)


@compilable
def move_spool(c: Any, z: Any, w: Any, substep: int, step: float) -> float:
    """Advance both plungers; the mean spool displacement of the sub-step [m]."""
    part = min(max(substep + 1.0 - w.fresh, 0.0), 1.0)
    drive_a = w.old_a + part * (w.new_a - w.old_a)
    drive_b = w.old_b + part * (w.new_b - w.old_b)
    if c.quasi_static:
        z.stroke_a = resting_stroke(drive_a, c.gap, c.plunger_stiffness)
        z.stroke_b = resting_stroke(drive_b, c.gap, c.plunger_stiffness)
        return spool(z.stroke_a, z.stroke_b)
    before = spool(z.stroke_a, z.stroke_b)
    z.stroke_a, z.speed_a = _plunger(c, w, z.stroke_a, z.speed_a, drive_a, step)
    z.stroke_b, z.speed_b = _plunger(c, w, z.stroke_b, z.speed_b, drive_b, step)
    return 0.5 * (before + spool(z.stroke_a, z.stroke_b))


@compilable
def meter(c: Any, w: Any, displacement: float) -> None:
    """Flows into both chambers and how they fall with pressure."""
    area = opening(
        displacement, c.opening_a, c.opening_b, c.slot_width, c.overlap_a, c.overlap_b, c.opening_exponent
    )
    ahead, back = c.leakage, c.leakage  # pump to A and B to tank, pump to B and A to tank
    if displacement > 0.0:
        ahead += area
    else:
        back += area
    # oil that cavitates pushes with vapour pressure, whatever volume is missing, and does not resist
    w.wet_a = 1.0 if w.pressure_a > c.vapour_pressure else 0.0
    w.wet_b = 1.0 if w.pressure_b > c.vapour_pressure else 0.0
    w.pushed_a, w.pushed_b = max(w.pressure_a, c.vapour_pressure), max(w.pressure_b, c.vapour_pressure)
    w.q_a, w.g_a = _chamber_flow(c, w.pushed_a, ahead, back)
    w.q_b, w.g_b = _chamber_flow(c, w.pushed_b, back, ahead)


@compilable
def load(c: Any, w: Any, damping: float, step: float) -> None:
    """Torque, oil stiffness and resistance of the sub-step, with both chambers eliminated."""
    turn = w.way + 0.5 * step * w.speed
    arm = w.arm + w.slope * turn
    if c.kind == LINEAR:
        travel = w.travel + turn * (w.arm + 0.5 * w.slope * turn)
        volume_a = volume(travel, c.area_a, c.dead_volume)
        volume_b = volume(c.stroke - travel, c.area_b, c.dead_volume)
        rub = stop_damping(travel, arm * w.speed, c.stroke, c.stop_penetration)
    else:
        volume_a, volume_b, rub = c.dead_volume, c.dead_volume, 0.0
    w.resist = damping + arm * arm * (rub + friction_damping(arm * w.speed, c.dry_friction))
    w.arm_a, w.arm_b = arm * c.area_a, arm * c.area_b
    w.rate_a, w.rate_b = step * c.bulk_modulus / volume_a, step * c.bulk_modulus / volume_b
    relax_a, relax_b = w.wet_a * w.rate_a * w.g_a, w.wet_b * w.rate_b * w.g_b
    w.share_a, w.share_b = implicit_share(relax_a), implicit_share(relax_b)
    w.give_a = w.rate_a / (1.0 + w.share_a * relax_a)
    w.give_b = w.rate_b / (1.0 + w.share_b * relax_b)
    w.stiff = w.wet_a * w.arm_a * w.arm_a * w.give_a + w.wet_b * w.arm_b * w.arm_b * w.give_b
    w.share = implicit_share(max(np.sqrt(step * w.stiff / w.inertia), step * w.resist / w.inertia))
    w.push = w.arm_a * w.pushed_a - w.arm_b * w.pushed_b
    w.push += w.share * (w.wet_a * w.arm_a * w.give_a * w.q_a - w.wet_b * w.arm_b * w.give_b * w.q_b)


@compilable
def coast(z: Any, w: Any, damping: float, step: float) -> None:
    """The load of a joint without actuator, the same in all sub-steps."""
    w.resist, w.stiff, w.push = damping, 0.0, z.hold
    w.share = implicit_share(step * damping / w.inertia)


@compilable
def settle(c: Any, z: Any, w: Any, gain: float, step: float) -> None:
    """Take over a velocity gain [rad/s]: pressures, oil, way and torque of the sub-step."""
    mean = w.speed + w.share * gain
    if c.kind != NONE:
        rise_a = w.give_a * (w.q_a - w.arm_a * mean)
        rise_b = w.give_b * (w.q_b + w.arm_b * mean)
        mean_a = w.q_a - w.share_a * w.wet_a * w.g_a * rise_a
        mean_b = w.q_b - w.share_b * w.wet_b * w.g_b * rise_b
        w.pressure_a += rise_a
        w.pressure_b += rise_b
        z.oil_a += w.rate_a * mean_a
        z.oil_b += w.rate_b * mean_b
        w.flow_a += mean_a
        w.flow_b += mean_b
        w.oil_stiffness += w.stiff / step
    w.torque += w.push - (w.share * w.stiff + w.resist) * mean
    w.resistance += w.resist
    w.way += step * mean
    w.speed += gain
