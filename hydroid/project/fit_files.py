"""The texts of a new project's settings: both stages, with starts and priors from the arm and the log."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from hydroid.project.layout import Layout
from hydroid.project.sizes import JointSize
from hydroid.settings.arm import Arm
from hydroid.settings.linkage import LinearActuator

LONGEST_STEP = 0.025
"""of MuJoCo [s], in a log of fewer samples"""
DEAD = 0.8
"""part of the command below which a joint seems to stand that its dead band is"""
RESPONSE = 0.05
"""of a valve and its oil without any delay [s]"""

MECH = """\
# Stage 1: hydroid fit-mech LOG --config {file}
#
# The hydraulics are a gain: torque [N·m] = K [N·m/%] · command [%]. A damper D and a spring S at each joint
# stand for what the oil and the friction do. Every setting: docs/settings.md.
stage: mech
arm: {arm}
outputs: {outputs}             # joints whose angles are compared

{log}
{others}
# Starts and priors follow from the arm's weight and the speeds in the log: they are wide guesses; write
# what you know. `within: 4`: with 95 % probability between a quarter and four times the nominal value. A
# mass is nominally what the arm's file says. `fixed: VALUE` holds a parameter.
parameters:
{parameters}
  M: {{quantity: mass, each: true, within: 2}}              # kg, M_LINK of every link

# Least squares from the nominal values; more `starts` are random.
objective: {{norm: 2, segments: {{equal: 4}}}}
search: {{algorithm: multistart, seed: 1, multistart: {{starts: 1, iterations: 50}}}}
"""
HYD = """\
# Stage 2: hydroid fit-hyd LOG --mech RUN --config {file}
#
# The whole chain: command, valve, oil, cylinder. The masses of stage 1 hold. Every setting:
# docs/settings.md. More terms that a machine may need: configs/fit-hyd-machine.yaml of hydroid.
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
  rotary_volume: {volume}             # cm³    of each chamber of a rotary actuator
  substeps: 5                      # of valves and oil in one MuJoCo step

# Wide guesses; write what you know. Of a valve, A is the direction of positive angles. `each: true` gives
# every compared joint its own.
parameters:
{parameters}
  M: {{quantity: mass, each: true, within: 2}}              # kg     stage 1's hold (with --mech)
  open_A: {{quantity: opening_a, each: true, within: 4}}    # mm²    valve opening at full command
  open_B: {{quantity: opening_b, each: true, within: 4}}
  lag: {{quantity: plunger_damping, each: true, within: 10}}                    # N·s/m  2000 N·s/m are 1 s
  # friction: {{quantity: dry_friction, each: true, bounds: [0, 5000], start: 100}}   # N; N·m of a rotary one
  # exponent: {{quantity: opening_exponent, each: true, within: 2}}       # 1: the opening follows the command

# Each joint alone, then all together, from the nominal values.
objective: {{norm: 2, segments: {{equal: 4}}}}
search: {{algorithm: multistart, seed: 1, multistart: {{starts: 1, iterations: 30, gain_tolerance: 0.001}}}}
refinement: {{iterations: 60, gain_tolerance: 1.0e-6}}
"""
NO_LOG = """\
# Columns of your log. `hydroid init --log LOG` guesses them.
# log:
#   time: {column: time, unit: s}
#   command: null
#   angle: null
#   joints:
#     JOINT: {command: {column: u1, scale: 10}, angle: {column: q1, unit: deg}}     # ±10 V are ±100 %
"""


@dataclass(frozen=True)
class Names:
    """The settings' file as a command takes it, and the arm's file as the settings name it."""

    file: str
    arm: str


def mech_text(arm: Arm, layout: Layout | None, sizes: Sequence[JointSize], names: Names) -> str:
    """Return the settings of stage 1."""
    lines: list[str] = []
    for joint in _outputs(arm, layout):
        name, size = arm.joint_names[joint - 1], sizes[joint - 1]
        low, start, high = (short(factor * size.torque) for factor in (1e-4, 0.1, 10))
        lines += [
            _row("K", "gain", name, f"nominal: {short(size.gain)}, within: 4"),
            _row("D", "damping", name, f"nominal: {short(size.damping)}, within: 10"),
            _row("S", "stiffness", name, f"bounds: [{low}, {high}], start: {start}"),
        ]
    return MECH.format(parameters="\n".join(lines), **_common(arm, layout, names))


def hyd_text(arm: Arm, layout: Layout | None, sizes: Sequence[JointSize], names: Names) -> str:
    """Return the settings of stage 2."""
    lines, volumes = list[str](), list[float]()
    for joint in _outputs(arm, layout):
        name, size, own = arm.joint_names[joint - 1], sizes[joint - 1], arm.joints[joint - 1]
        motion = layout.motions.get(joint) if layout else None
        delay = min(max(motion.lag - RESPONSE, 0.0), 0.9) if motion else 0.0
        band = DEAD * min(max(motion.dead_band, 5.0), 70.0) if motion else 5.0
        dead = f"nominal: {short(band)}, sd: 10, bounds: [0, 75]"
        if isinstance(own.actuator, LinearActuator):
            lines.append(_row("area_A", "area_a", name, "within: 1.5"))
            lines.append(_row("area_B", "area_b", name, "within: 1.5"))
        else:
            lines.append(_row("size", "area", name, "within: 3") + "    # cm³/rad, of the stand-in")
            volumes.append(size.displacement * math.radians(own.range[1] - own.range[0]) / 2)
        lines += [
            _row("D", "damping", name, f"nominal: {short(0.1 * size.damping)}, within: 10"),
            _row("delay", "delay", name, f"bounds: [0, 1], start: {delay:.2f}") + "    # s",
            _row("dead_A", "dead_band_a", name, dead) + "    # %",
            _row("dead_B", "dead_band_b", name, dead),
        ]
    common = _common(arm, layout, names)
    return HYD.format(parameters="\n".join(lines), volume=short(min(volumes, default=50.0)), **common)


def short(value: float) -> str:
    """Write three digits of a number."""
    return f"{float(f'{value:.3g}'):g}"


def _row(name: str, quantity: str, joint: str, rest: str) -> str:
    """One parameter of one joint."""
    own = f"{name}_{joint.removesuffix('_joint')}"
    return f"  {own}: {{quantity: {quantity}, joints: [{joint}], {rest}}}"


def _outputs(arm: Arm, layout: Layout | None) -> Sequence[int]:
    return range(1, len(arm.joints) + 1) if layout is None else layout.outputs


def _common(arm: Arm, layout: Layout | None, names: Names) -> dict[str, Any]:
    outputs = flow([arm.joint_names[joint - 1] for joint in _outputs(arm, layout)])
    log, others = _log(arm, layout), _others(layout)
    return {"file": names.file, "arm": flow(names.arm), "outputs": outputs, "log": log, "others": others}


def _log(arm: Arm, layout: Layout | None) -> str:
    if layout is None:
        return NO_LOG
    section = layout.section
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


def _others(layout: Layout | None) -> str:
    """Settings of the simulation."""
    period = 0.01 if layout is None else float(layout.section["period_s"])
    steps = max(math.ceil(period / LONGEST_STEP - 1e-9), 1)
    other = "measured" if layout is not None and layout.followed else "locked"
    text = f"simulation: {{steps_per_sample: {steps}, other_joints: {other}}}"
    return f"{text}    # joints without a command: locked, passive or measured (they follow the log)\n"


def flow(value: Any) -> str:
    """Write a value as YAML, on one line."""
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000, allow_unicode=True, sort_keys=False)
    return text.removesuffix("...\n").strip()
