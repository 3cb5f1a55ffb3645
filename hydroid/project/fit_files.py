"""The text of a new project's settings: the whole chain, with starts and priors from the arm and the log."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import yaml

from hydroid.project.arm_file import JointSize, rounded
from hydroid.project.layout import Layout
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import LinearActuator

LONGEST_STEP = 0.025  # of MuJoCo [s], in a log of fewer samples
VALVE_STEP = 0.002  # of valves and oil [s]
DEAD = 0.8  # part of the command below which a joint seems to stand that its dead band is
DRAG = 0.02  # part of the torque at the pump's pressure that damping takes at full speed
RESPONSE = 0.1  # of a valve and its oil without any delay [s]

FIT = """\
# hydroid fit-hyd LOG --config {file}
#
# The whole chain: command, valve, oil, cylinder, arm. Every setting: docs/settings.md.
stage: hyd
arm: {arm}
outputs: {outputs}             # joints whose angles are compared

{log}
{others}
# What is taken to be known of all joints; these are also nominal values of parameters below.
hydraulics:
  supply_pressure: 150             # bar    read it off the gauge
  onset_a: 0                       # V      no jump behind the dead band
  onset_b: 0
  current_min: 0.8                 # A      a coil that moves its spool nearly in proportion to the command,
  slot_width: 0.33                 # mm     which full command opens
  rotary_volume: {volume}             # cm³    of each chamber of a rotary actuator
  opening_exponent: 1.4            #        speed rises with this power of the command behind the dead band
  plunger_mass: 0.008              # kg     and at once: what lags is before the dead band or behind the valve
  plunger_damping: 8               # N·s/m  4 ms, without overshoot
  substeps: {substeps}                     # of valves and oil in one step of the model

# Starts and priors follow from the arm's weight and the speeds in the log. They are wide guesses: write what
# you know. `within: 4`: with 95 % probability between a quarter and four times the nominal value, which is
# the arm file's where none stands here. `fixed: VALUE` holds a parameter. Of a valve, A is the direction of
# positive angles.
parameters:
{parameters}
  M: {{quantity: mass, each: true, within: 2}}    # kg, M_LINK of every link
  # One pump for all joints, whose pressure falls with flow: a term that is kept if the logs ask for it.
  P_flow: {{quantity: pump_flow, fixed: {flow}, term: pump}}    # L/min, four times all joints at full speed
  P_droop: {{quantity: pump_droop, bounds: [0, 2000], start: 5, term: pump}}    # bar, at that flow

# The two sides of a spool are made alike.
priors:
{alike}

# Each joint alone, then all together, without oil stiffness and inertia, which takes seconds; then with the
# pump, and then with oil and inertia: what is not clearly nearer to the logs is not kept.
objective: {{norm: 2, segments: 4}}
search: {{algorithm: multistart, seed: 1, multistart: {{starts: 1, horizons: [], iterations: 40}}}}
refinement: {{iterations: 60, gain_tolerance: 1.0e-5}}
"""
JOINT = """\
{actuator}
  D_{own}: {{quantity: damping, joints: [{name}], nominal: {damping}, within: 5}}    # {unit}
  delay_{own}: {{quantity: delay, joints: [{name}], bounds: [0, 1], start: {delay:.2f}}}    # s
  dead_A_{own}: {{quantity: dead_band_a, joints: [{name}], nominal: {dead}, sd: 15, bounds: [0, 75]}}    # %
  dead_B_{own}: {{quantity: dead_band_b, joints: [{name}], nominal: {dead}, sd: 15, bounds: [0, 75]}}
  open_A_{own}: {{quantity: opening_a, joints: [{name}], within: 4}}    # mm², at full command
  open_B_{own}: {{quantity: opening_b, joints: [{name}], within: 4}}
  exponent_A_{own}: {{quantity: opening_exponent_a, joints: [{name}], within: 3}}
  exponent_B_{own}: {{quantity: opening_exponent_b, joints: [{name}], within: 3}}
  compensation_{own}: {{quantity: compensation, joints: [{name}], bounds: [0, 1], start: 0}}    # of the load
  lag_{own}: {{quantity: opening_lag, joints: [{name}], bounds: [0, 0.6], start: 0.05}}    # s
  pilot_{own}: {{quantity: pilot_lag, joints: [{name}], bounds: [0, 0.6], start: 0.03}}    # s
  draw_A_{own}: {{quantity: draw_a, joints: [{name}], nominal: {draw}, within: 5, term: pump}}    # from the
  draw_B_{own}: {{quantity: draw_b, joints: [{name}], nominal: {draw}, within: 5, term: pump}}    # pump"""
ALIKE = """\
  dead_{own}: {{of: {{dead_A_{own}: 1, dead_B_{own}: -1}}, value: 0, sd: 5}}
  exponent_{own}: {{of: {{exponent_A_{own}: 1, exponent_B_{own}: -1}}, value: 0, sd: 0.2}}"""
CYLINDER = """\
  area_A_{own}: {{quantity: area_a, joints: [{name}], within: 1.5}}    # mm²
  area_B_{own}: {{quantity: area_b, joints: [{name}], within: 1.5}}"""
STAND_IN = """\
  size_{own}: {{quantity: area, joints: [{name}], within: 5}}    # cm³/rad, of the stand-in
  slope_{own}: {{quantity: lever_slope, joints: [{name}], nominal: 0, sd: 0.2}}    # of its lever
  bend_{own}: {{quantity: lever_bend, joints: [{name}], nominal: 0, sd: 0.2}}"""
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
    lines, alike, volumes = list[str](), list[str](), list[float]()
    outputs = range(1, len(arm.joints) + 1) if layout is None else layout.outputs
    flows = {joint: 0.06 * sizes[joint - 1].displacement * sizes[joint - 1].speed for joint in outputs}
    middle = np.median([*flows.values()])
    for joint in outputs:
        name, size, own = arm.joint_names[joint - 1], sizes[joint - 1], arm.joints[joint - 1]
        motion = layout.motions.get(joint) if layout else None
        linear = isinstance(own.actuator, LinearActuator)
        if not linear:
            volumes.append(size.displacement * math.radians(own.range[1] - own.range[0]) / 2)
        words = {"own": name.removesuffix("_joint"), "name": name}
        alike.append(ALIKE.format(**words))
        lines.append(
            JOINT.format(
                actuator=(CYLINDER if linear else STAND_IN).format(**words),
                damping=short(DRAG * size.damping),
                delay=min(max(motion.likely_lag - RESPONSE, 0.0), 0.9) if motion else 0.0,
                # a stand-in's size is a guess, but the valves of one machine let like flows through
                unit="N·s/m" if own.slides else "N·m·s/rad",
                draw=1 if linear else short(middle / flows[joint]),
                dead=short(DEAD * min(max(motion.dead_band, 5.0), 40.0) if motion else 10.0),
                **words,
            )
        )
    period = 0.01 if layout is None else float(layout.section["period_s"])
    steps = math.ceil(period / LONGEST_STEP - 1e-9)
    return FIT.format(
        file=file,
        arm=flow(arm_file),
        outputs=flow([arm.joint_names[joint - 1] for joint in outputs]),
        log=_log(arm, layout),
        others=_others(layout, steps),
        substeps=math.ceil(period / steps / VALVE_STEP - 1e-9),
        volume=short(min(volumes, default=50.0)),
        flow=short(4 * sum(flows.values())),  # so large that it limits no flow
        parameters="\n".join(lines),
        alike="\n".join(alike),
    )


def short(value: float) -> str:
    """Write three digits of a number."""
    return f"{rounded(value):g}"


def _log(arm: Arm, layout: Layout | None) -> str:
    if layout is None:
        return NO_LOG
    section = layout.section
    lines = [
        "# GUESSED from the log: check every line.",
        *(f"# - {reason}" for reason in layout.reasons),
        "log:",
        *(f"  {key}: {flow(value)}" for key, value in section.items() if key != "joints"),
        "  joints:",
        *(f"    {arm.joint_names[joint - 1]}: {flow(entry)}" for joint, entry in section["joints"].items()),
    ]
    return "\n".join(lines) + "\n"


def _others(layout: Layout | None, steps: int) -> str:
    """Settings of the simulation."""
    other = "measured" if layout is not None and layout.followed else "locked"
    text = f"simulation: {{model: ladder, steps_per_sample: {steps}, other_joints: {other}}}"
    return f"{text}    # joints without a command: locked, passive or measured (they follow the log)\n"


def flow(value: Any) -> str:
    """Write a value as YAML, on one line."""
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000, allow_unicode=True, sort_keys=False)
    return text.removesuffix("...\n").strip()
