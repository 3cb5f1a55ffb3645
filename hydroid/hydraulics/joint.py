"""One joint of one candidate during a look-ahead: what the compiled loops of `kernel`
do with it.

c is its record of COEFFICIENTS, z its JOINT_STATE, w its SCRATCH space:
`hydroid.hydraulics.records` lists their fields. Each has a record for side A and one
for B, whose lever is negative. Only compiled code calls these functions; the
components' laws, called here, also work on numpy. They run millions of times a second,
so a branch leaves out what is switched off.
"""

# pyright: reportMissingParameterType=false
# a law takes floats or arrays that broadcast, and compiled code whatever has its fields

import numpy as np

from hydroid.hydraulics.cylinder import contact_torque, stop_damping
from hydroid.hydraulics.elementwise import compilable, implicit_weight, kept
from hydroid.hydraulics.oil import begin_oil, press, take_flow, volumes
from hydroid.hydraulics.records import LINEAR, NONE
from hydroid.hydraulics.seals import friction_damping
from hydroid.hydraulics.solenoid import (
    beyond_dead_band,
    drive,
    plunger_step,
    plunger_weight,
    side_voltage,
)
from hydroid.hydraulics.valve import curved, power_law, slot_share

STILL = 1e-15
"""speed of a plunger before and after a sub-step, below which rounding alone moves it
[m/s]"""


@compilable
def begin(c, z, w, angle: float, velocity: float) -> None:
    """Geometry and chamber pressures at the start of the step."""
    z.angle = angle
    z.velocity = velocity
    w.way = 0.0
    w.speed = velocity
    w.torque = 0.0
    w.resistance = 0.0
    w.oil_stiffness = 0.0
    w.a.flow = 0.0
    w.b.flow = 0.0
    begin_oil(c, z, w, angle)


@compilable
def command(c, z, w, commands, now: int) -> None:
    """Take the delayed commands [%]: that towards each side changes `fresh` sub-steps
    into this step.

    `commands` are those of all steps, of which that at `now` is given in this one.
    """
    w.a.before = z.a.asked
    w.b.before = z.b.asked
    w.a.after = commands[now - c.a.delay_steps]
    w.b.after = -commands[now - c.b.delay_steps]
    z.a.asked = w.a.after
    z.b.asked = w.b.after


@compilable
def _advance(c, side, z, asked: float, step: float, whole: bool) -> float:
    """Advance a pilot stage and its plunger under a command towards their side [%]; the
    mean stroke [m].

    `whole`: whether the step is a sub-step, and not a part of one.
    """
    pilot_steps = side.pilot_steps
    keep = side.pilot_keep
    weight = side.plunger_weight
    if not whole:
        pilot_steps = side.pilot_lag / step
        keep = kept(pilot_steps)
        weight = plunger_weight(side.plunger_damping, step, c)
    driven = z.drive
    # a command that has settled leaves the coil's drive as it is
    if z.held != asked:
        # while the pilot stage follows, the drive is another mean in every sub-step
        z.held = asked if z.pilot == asked else np.nan
        beyond, part = beyond_dead_band(
            z.pilot, asked, pilot_steps, keep, side.dead_band
        )
        z.pilot = asked + (z.pilot - asked) * keep
        z.drive = drive(side_voltage(beyond, part, side.onset, side.dead_band), c)
    before = z.stroke
    speed = z.speed
    # a coil pulls a plunger off its seat again
    balanced = before > 0.0 or z.drive == 0.0
    if balanced and speed == 0.0 and z.drive == driven:
        return before
    z.stroke, z.speed = plunger_step(
        (before, speed), z.drive, side.plunger_damping, step, weight, c
    )
    # in a short part of a step no plunger is fast, even if a new command pulls it
    steady = whole or z.drive == driven
    if steady and abs(speed) < STILL and abs(z.speed) < STILL:
        z.speed = 0.0
    return 0.5 * (before + z.stroke)


@compilable
def move_plunger(c, side, z, w, substep: int, step: float) -> float:
    """Advance a side over a sub-step, up to the moment at which its command changes and
    on; mean stroke."""
    # part of the sub-step under the new command
    later = min(max(substep + 1.0 - side.fresh, 0.0), 1.0)
    if later in (0.0, 1.0) or w.before == w.after:
        asked = w.after if later > 0.0 else w.before
        return _advance(c, side, z, asked, step, True)
    earlier = 1.0 - later
    mean = earlier * _advance(c, side, z, w.before, earlier * step, False)
    return mean + later * _advance(c, side, z, w.after, later * step, False)


@compilable
def open_share(side, travel: float) -> float:
    """Share of a side's full opening at a spool travel towards it [m], without
    leakage."""
    share = slot_share(travel, side)
    if side.opening_exponent != 1.0:
        share = power_law(share, side.opening_exponent)
    if side.has_curve:
        share = curved(share, side)
    return share


@compilable
def net_opening(c, z, w, substep: int, step: float) -> float:
    """Advance both plungers over a sub-step; the mean opening [m²], below 0 towards
    B."""
    a = move_plunger(c, c.a, z.a, w.a, substep, step)
    b = move_plunger(c, c.b, z.b, w.b, substep, step)
    return spool_opening(c, z, a - b)


@compilable
def spool_opening(c, z, displacement: float) -> float:
    """Move the spool to a displacement [m], equation (6), over a sub-step; the mean
    opening as `net_opening`."""
    # else the spool rests, and its power law is not worked out again
    if z.displacement != displacement:
        z.displacement = displacement
        if displacement > 0.0:
            z.unlagged = c.a.lagging * open_share(c.a, displacement)
        else:
            z.unlagged = -c.b.lagging * open_share(c.b, -displacement)
    # a spool passes its neutral when it does, however large the openings of its two
    # sides are; a speed that lags, as of a mass, passes 0 by the speeds of both
    left = (z.lagged - z.unlagged) * (1.0 - c.opening_keep)
    z.lagged -= left
    mean = z.unlagged + left * c.opening_steps
    side = c.a if mean > 0.0 else c.b
    return side.opening * (mean / side.lagging)


@compilable
def mean_opening(c, z, w, commands, now: int, plugin) -> float:
    """Advance the plungers over a step of the `plugin` under `command`; the mean
    opening as `net_opening`."""
    command(c, z, w, commands, now)
    net = 0.0
    for i in range(plugin.substeps):
        net += net_opening(c, z, w, i, plugin.period / plugin.substeps)
    return net / plugin.substeps


@compilable
def _rest(z, w, step: float) -> float:
    """Torque [N·m] of what a joint rests on; its stiffness and damping join those of
    the joint."""
    torque = contact_torque(z.stop - z.angle - w.way, z.contact)
    if torque != 0.0:
        w.stiffness += step * abs(z.contact)
        # further in: damped, so that it does not bounce
        if z.contact * w.speed < 0.0:
            w.drag += 2.0 * np.sqrt(abs(z.contact) * w.inertia)
    return torque


@compilable
def _joint_weight(w, step: float) -> float:
    """Weight of the new velocity, from how fast the joint rings and fades."""
    rings = step * w.stiffness
    fades = step * w.drag
    # most sub-steps resolve both rates, and then the weight is a half without the root
    if rings <= 4.0 * w.inertia and fades <= 2.0 * w.inertia:
        return 0.5
    return implicit_weight(max(np.sqrt(rings / w.inertia), fades / w.inertia))


@compilable
def load(c, z, w, step: float) -> None:
    """Torque, oil stiffness and resistance of the sub-step, with both chambers
    eliminated."""
    # lever and volumes are those of the middle of the sub-step
    turn = w.way + 0.5 * step * w.speed
    arm = w.arm + w.slope * turn
    rub = 0.0
    volume_a = c.dead_volume
    volume_b = c.dead_volume
    if c.kind == LINEAR:
        travel = w.travel + turn * (w.arm + 0.5 * w.slope * turn)
        volume_a, volume_b = volumes(travel, c)
        rub = stop_damping(travel, arm * w.speed, c.stroke, c.stop_penetration)
    if c.dry_friction > 0.0:
        rub += friction_damping(arm * w.speed, c.dry_friction)
    w.drag = c.damping + arm * arm * rub
    pressed = step * c.bulk_modulus
    w.stiffness = press(w.a, arm * c.a.area, pressed / volume_a)
    w.stiffness += press(w.b, -arm * c.b.area, pressed / volume_b)
    rest = 0.0
    if z.contact != 0.0:
        rest = _rest(z, w, step)
    w.weight = _joint_weight(w, step)
    w.push = rest + w.a.lever * w.a.pushing + w.b.lever * w.b.pushing
    flowing = (
        w.a.filled * w.a.lever * w.a.rise * w.a.inflow
        + w.b.filled * w.b.lever * w.b.rise * w.b.inflow
    )
    w.push += w.weight * flowing


@compilable
def coast(c, z, w, step: float) -> None:
    """The load of a joint without actuator, the same in all sub-steps."""
    w.drag = c.damping
    w.stiffness = 0.0
    w.push = z.hold
    w.weight = implicit_weight(step * c.damping / w.inertia)


@compilable
def settle(c, z, w, gain: float, step: float) -> None:
    """Take over a velocity gain [rad/s]: pressures, oil, way and torque of the
    sub-step."""
    mean = w.speed + w.weight * gain
    if c.kind != NONE:
        take_flow(z.a, w.a, mean)
        take_flow(z.b, w.b, mean)
        w.oil_stiffness += w.stiffness / step
    w.torque += w.push - (w.weight * w.stiffness + w.drag) * mean
    w.resistance += w.drag
    w.way += step * mean
    w.speed += gain
