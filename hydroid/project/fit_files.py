"""The text of a new project's settings: the whole chain, with starts and priors from the arm and the log."""

import math
from collections.abc import Sequence
from typing import Any

import yaml

from hydroid.project.layout import Layout
from hydroid.project.sizes import JointSize
from hydroid.settings.arm import Arm
from hydroid.settings.linkage import LinearActuator

COARSE = 0.05
"""sample period that a quasi-static model needs no finer [s]"""
LEVER = 0.1
"""moment arm of a cylinder with which its friction is bounded [m]"""
DEAD = 0.8
"""part of the command below which a joint seems to stand that its dead band is"""
RESPONSE = 0.1
"""of a valve and its oil without any delay [s]"""

FIT = """\
# hydroid fit-hyd LOG --config {file}
#
# The whole chain: command, valve, cylinder, arm. Every setting: docs/settings.md. More terms that a machine
# may need: configs/fit-hyd-machine.yaml of hydroid.
stage: hyd
arm: {arm}
outputs: {outputs}             # joints whose angles are compared

{log}
# quasi-static: speeds follow valve and load at once, which takes seconds to fit. Logs fast enough to show the
# oil's stiffness and the arm's inertia may want `dynamic`, started from the quasi-static fit: --start RUN.
# Joints without a command are locked, passive or measured (they follow the log).
simulation: {{model: quasi-static, other_joints: {other}}}

# What is taken to be known of all joints; these are also nominal values of parameters below.
hydraulics:
  supply_pressure: 150             # bar    read it off the gauge
  onset_a: 0                       # V      no jump behind the dead band
  onset_b: 0
  opening_exponent: 1.4            #        above 1: a valve opens slowly at first
  plunger_damping: 200             # N·s/m  a spool that lags by 0.1 s
  rotary_volume: {volume}             # cm³    of each chamber of a rotary actuator
  substeps: 4                      # of valves and oil in one step

# Starts and priors follow from the arm's weight and the speeds in the log. They are wide guesses: write what
# you know. `within: 4`: with 95 % probability between a quarter and four times the nominal value, which is
# the arm file's where none stands here. `fixed: VALUE` holds a parameter. Of a valve, A is the direction of
# positive angles. A pilot stage lags before the dead band, the spool behind it.
parameters:
{parameters}{pump}
  M: {{quantity: mass, each: true, within: 1.5}}    # kg, M_LINK of every link

# Each joint alone, then all together, from the nominal values.
objective: {{norm: 2, segments: {{equal: 4}}}}
search:
  algorithm: multistart
  seed: 1
  multistart: {{starts: 1, horizons: [], iterations: 40, gain_tolerance: 0.001}}
refinement: {{iterations: 100, gain_tolerance: 1.0e-5}}
"""
JOINT = """\
{actuator}
  delay_{own}: {{quantity: delay, joints: [{name}], bounds: [0, 1], start: {delay:.2f}}}    # s
  pilot_A_{own}: {{quantity: pilot_lag_a, joints: [{name}], bounds: [0, 0.6], start: 0.03}}
  pilot_B_{own}: {{quantity: pilot_lag_b, joints: [{name}], bounds: [0, 0.6], start: 0.03}}
  dead_A_{own}: {{quantity: dead_band_a, joints: [{name}], nominal: {dead}, sd: 10, bounds: [0, 80]}}    # %
  dead_B_{own}: {{quantity: dead_band_b, joints: [{name}], nominal: {dead}, sd: 10, bounds: [0, 80]}}
  open_A_{own}: {{quantity: opening_a, joints: [{name}], within: 10}}    # mm², at full command
  open_B_{own}: {{quantity: opening_b, joints: [{name}], within: 10}}
  exponent_A_{own}: {{quantity: opening_exponent_a, joints: [{name}], within: 3, bounds: [0.4, 5]}}
  exponent_B_{own}: {{quantity: opening_exponent_b, joints: [{name}], within: 3, bounds: [0.4, 5]}}
  lag_{own}: {{quantity: plunger_damping, joints: [{name}], within: 10}}    # N·s/m  2000 N·s/m are 1 s
  friction_{own}: {{quantity: dry_friction, joints: [{name}], bounds: [0, {friction}], start: {little}}}  # {unit}"""
CYLINDER = """\
  area_A_{own}: {{quantity: area_a, joints: [{name}], within: 1.5}}    # mm²
  area_B_{own}: {{quantity: area_b, joints: [{name}], within: 1.5}}"""
STAND_IN = """\
  size_{own}: {{quantity: area, joints: [{name}], within: 6}}    # cm³/rad, of the stand-in
  slope_{own}: {{quantity: lever_slope, joints: [{name}], nominal: 0, sd: 0.2}}    # its lever over the range
  bend_{own}: {{quantity: lever_bend, joints: [{name}], nominal: 0, sd: 0.2}}"""
PUMP = """
  P_flow: {{quantity: pump_flow, fixed: {flow}}}    # L/min, of all joints at full speed; with P_droop it says how the
  P_droop: {{quantity: pump_droop, bounds: [0, 140], start: 15}}    # bar    supply falls when joints move together"""
NO_LOG = """\
# Columns of your log. `hydroid init --log LOG` guesses them.
# log:
#   time: {column: time, unit: s}
#   command: null
#   angle: null
#   joints:
#     JOINT: {command: {column: u1, scale: 10}, angle: {column: q1, unit: deg}}     # ±10 V are ±100 %
"""


def fit_text(arm: Arm, layout: Layout | None, sizes: Sequence[JointSize], file: str, arm_file: str) -> str:
    """Return the settings of a fit of the whole chain.

    `file` is their own name as a command takes it, and `arm_file` that of the arm as they name it.
    """
    lines, volumes = list[str](), list[float]()
    outputs = range(1, len(arm.joints) + 1) if layout is None else layout.outputs
    full = 0.0
    for joint in outputs:
        name, size, own = arm.joint_names[joint - 1], sizes[joint - 1], arm.joints[joint - 1]
        motion = layout.motions.get(joint) if layout else None
        linear = isinstance(own.actuator, LinearActuator)
        full += size.displacement * size.speed
        if not linear:
            volumes.append(size.displacement * math.radians(own.range[1] - own.range[0]) / 2)
        words = {"own": name.removesuffix("_joint"), "name": name}
        lines.append(
            JOINT.format(
                actuator=(CYLINDER if linear else STAND_IN).format(**words),
                delay=min(max(motion.follows(joint)[1] - RESPONSE, 0.0), 0.9) if motion else 0.0,
                dead=short(DEAD * min(max(motion.dead_band, 5.0), 70.0) if motion else 5.0),
                friction=short(size.torque / (1.0 if not linear else LEVER)),
                little=short(1e-3 * size.torque),
                unit="N" if linear else "N·m",
                **words,
            )
        )
    return FIT.format(
        file=file,
        arm=flow(arm_file),
        outputs=flow([arm.joint_names[joint - 1] for joint in outputs]),
        log=_log(arm, layout),
        other="measured" if layout is not None and layout.followed else "locked",
        volume=short(min(volumes, default=50.0)),
        parameters="\n".join(lines),
        pump=PUMP.format(flow=short(0.06 * full)) if len(lines) > 1 else "",
    )


def short(value: float) -> str:
    """Write three digits of a number."""
    return f"{float(f'{value:.3g}'):g}"


def _log(arm: Arm, layout: Layout | None) -> str:
    if layout is None:
        return NO_LOG
    section = layout.section | {"period_s": max(COARSE, float(layout.section["period_s"]))}
    lines = [
        "# GUESSED from the log: check every line.",
        *(f"# - {reason}" for reason in layout.reasons),
        *([f"# - not used: {', '.join(layout.unused)}"] if layout.unused else []),
        "log:",
        *(f"  {key}: {flow(value)}" for key, value in section.items() if key != "joints"),
        "  joints:",
        *(f"    {arm.joint_names[joint - 1]}: {flow(entry)}" for joint, entry in section["joints"].items()),
    ]
    return "\n".join(lines) + "\n"


def flow(value: Any) -> str:
    """Write a value as YAML, on one line."""
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000, allow_unicode=True, sort_keys=False)
    return text.removesuffix("...\n").strip()
