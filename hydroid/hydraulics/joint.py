"""One joint of one candidate during a look-ahead: what the compiled loops of `kernel` do with it.

c is its record of COEFFICIENTS, z its JOINT_STATE, w its SCRATCH space: `hydroid.hydraulics.records` lists
their fields. Only compiled code calls these functions; the components' laws, called here, also work on numpy.
"""

from typing import Any

import numpy as np

from hydroid.hydraulics.cylinder import (
    contact_torque,
    four_bar,
    friction_damping,
    stop_damping,
    triangle,
    volume,
)
from hydroid.hydraulics.elementwise import compilable, implicit_weight
from hydroid.hydraulics.records import LINEAR, NONE, ROTARY
from hydroid.hydraulics.solenoid import coil_current, drag_of, plunger_step, plunger_weight, side_voltage
from hydroid.hydraulics.valve import opening, port_flow, spool


@compilable
def drive_a(c: Any, command: float) -> float:
    """Drive k i² [N·m²] of coil A at a command [%]: equations (2) to (5)."""
    voltage = side_voltage(command, c.onset_a, c.full_a, c.dead_band_a)
    current = coil_current(voltage, c.current_max, c.current_min)
    return c.coil * current * current


@compilable
def drive_b(c: Any, command: float) -> float:
    """Drive k i² [N·m²] of coil B at a command [%]."""
    voltage = side_voltage(-command, c.onset_b, c.full_b, c.dead_band_b)
    current = coil_current(voltage, c.current_max, c.current_min)
    return c.coil * current * current


@compilable
def begin(c: Any, z: Any, w: Any, angle: float, velocity: float) -> None:
    """Geometry and chamber pressures at the start of the step."""
    z.angle, z.velocity = angle, velocity
    w.way, w.speed, w.torque, w.resistance, w.oil_stiffness = 0.0, velocity, 0.0, 0.0, 0.0
    w.flow_a, w.flow_b = 0.0, 0.0
    if c.kind == LINEAR:
        if c.rocker > 0.0:
            psi, first, second = four_bar(angle, c)
            w.travel, arm, slope = triangle(psi, c.a, c.b, c.theta0, c.shortest)
            w.arm, w.slope = arm * first, slope * first * first + arm * second
        else:
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
def command(c: Any, w: Any, recent: Any, period: float, substeps: int) -> None:
    """Each coil's drive before and after its delayed command changes, `fresh` sub-steps into this step.

    `recent` holds the joint's commands up to now, newest last [%].
    """
    step = period / substeps
    late = np.floor(c.delay_a / period)
    w.fresh_a = (c.delay_a / period - late) * substeps
    place = recent.size - 1 - int(late)
    w.new_a, w.old_a = drive_a(c, recent[place]), drive_a(c, recent[place - 1])
    w.plunger_weight_a = plunger_weight(c.plunger_damping_a * max(c.plunger_back_a, 1.0), step, c)
    late = np.floor(c.delay_b / period)
    w.fresh_b = (c.delay_b / period - late) * substeps
    place = recent.size - 1 - int(late)
    w.new_b, w.old_b = drive_b(c, recent[place]), drive_b(c, recent[place - 1])
    w.plunger_weight_b = plunger_weight(c.plunger_damping_b * max(c.plunger_back_b, 1.0), step, c)


@compilable
def move_spool(c: Any, z: Any, w: Any, substep: int, step: float) -> float:
    """Advance both plungers; the mean spool displacement of the sub-step [m]."""
    part_a = min(max(substep + 1.0 - w.fresh_a, 0.0), 1.0)
    part_b = min(max(substep + 1.0 - w.fresh_b, 0.0), 1.0)
    pull_a, pull_b = w.old_a + part_a * (w.new_a - w.old_a), w.old_b + part_b * (w.new_b - w.old_b)
    before = spool(z.stroke_a, z.stroke_b)
    a, b = (z.stroke_a, z.speed_a), (z.stroke_b, z.speed_b)
    drag_a = drag_of(c.plunger_damping_a, c.plunger_back_a, pull_a, z.stroke_a, c)
    drag_b = drag_of(c.plunger_damping_b, c.plunger_back_b, pull_b, z.stroke_b, c)
    z.stroke_a, z.speed_a = plunger_step(a, pull_a, drag_a, step, w.plunger_weight_a, c)
    z.stroke_b, z.speed_b = plunger_step(b, pull_b, drag_b, step, w.plunger_weight_b, c)
    return 0.5 * (before + spool(z.stroke_a, z.stroke_b))


@compilable
def meter(c: Any, w: Any, displacement: float, supply: float) -> None:
    """Flows into both chambers from `supply` pressure [Pa], and how they fall with the chambers' own."""
    area = opening(displacement, c)
    pump_a, tank_a, pump_b, tank_b = c.leakage, c.leakage, c.leakage, c.leakage
    if displacement > 0.0:
        pump_a += area
        tank_b += area * c.return_b
    else:
        pump_b += area
        tank_a += area * c.return_a
    # oil that cavitates pushes with vapour pressure, whatever volume is missing, and does not resist
    w.filled_a = 1.0 if w.pressure_a > c.vapour_pressure else 0.0
    w.filled_b = 1.0 if w.pressure_b > c.vapour_pressure else 0.0
    w.pushing_a, w.pushing_b = max(w.pressure_a, c.vapour_pressure), max(w.pressure_b, c.vapour_pressure)
    w.inflow_a, w.relief_a, w.pumped_a, w.give_a = port_flow(w.pushing_a, supply, pump_a, tank_a, c)
    w.inflow_b, w.relief_b, w.pumped_b, w.give_b = port_flow(w.pushing_b, supply, pump_b, tank_b, c)


@compilable
def load(c: Any, z: Any, w: Any, damping: float, step: float) -> None:
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
    w.drag = damping + arm * arm * (rub + friction_damping(arm * w.speed, c.dry_friction))
    w.lever_a, w.lever_b = arm * c.area_a, arm * c.area_b
    w.rate_a, w.rate_b = step * c.bulk_modulus / volume_a, step * c.bulk_modulus / volume_b
    relax_a, relax_b = w.filled_a * w.rate_a * w.relief_a, w.filled_b * w.rate_b * w.relief_b
    w.weight_a, w.weight_b = implicit_weight(relax_a), implicit_weight(relax_b)
    w.rise_a = w.rate_a / (1.0 + w.weight_a * relax_a)
    w.rise_b = w.rate_b / (1.0 + w.weight_b * relax_b)
    w.stiffness = (
        w.filled_a * w.lever_a * w.lever_a * w.rise_a + w.filled_b * w.lever_b * w.lever_b * w.rise_b
    )
    rest = 0.0
    if z.contact != 0.0:
        rest = contact_torque(z.stop - z.angle - w.way, z.contact)
        if rest != 0.0:
            w.stiffness += step * abs(z.contact)
            if z.contact * w.speed < 0.0:  # further in: damped, so that it does not bounce
                w.drag += 2.0 * np.sqrt(abs(z.contact) * w.inertia)
    w.weight = implicit_weight(max(np.sqrt(step * w.stiffness / w.inertia), step * w.drag / w.inertia))
    w.push = rest + w.lever_a * w.pushing_a - w.lever_b * w.pushing_b
    w.push += w.weight * (
        w.filled_a * w.lever_a * w.rise_a * w.inflow_a - w.filled_b * w.lever_b * w.rise_b * w.inflow_b
    )


@compilable
def coast(z: Any, w: Any, damping: float, step: float) -> None:
    """The load of a joint without actuator, the same in all sub-steps."""
    w.drag, w.stiffness, w.push = damping, 0.0, z.hold
    w.weight = implicit_weight(step * damping / w.inertia)


@compilable
def settle(c: Any, z: Any, w: Any, gain: float, step: float) -> None:
    """Take over a velocity gain [rad/s]: pressures, oil, way and torque of the sub-step."""
    mean = w.speed + w.weight * gain
    if c.kind != NONE:
        gain_a = w.rise_a * (w.inflow_a - w.lever_a * mean)
        gain_b = w.rise_b * (w.inflow_b + w.lever_b * mean)
        mean_a = w.inflow_a - w.weight_a * w.filled_a * w.relief_a * gain_a
        mean_b = w.inflow_b - w.weight_b * w.filled_b * w.relief_b * gain_b
        w.pressure_a += gain_a
        w.pressure_b += gain_b
        z.oil_a += w.rate_a * mean_a
        z.oil_b += w.rate_b * mean_b
        w.flow_a += mean_a
        w.flow_b += mean_b
        w.oil_stiffness += w.stiffness / step
    w.torque += w.push - (w.weight * w.stiffness + w.drag) * mean
    w.resistance += w.drag
    w.way += step * mean
    w.speed += gain
