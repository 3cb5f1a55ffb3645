"""Every term is estimated from simulated logs: the truth lies within the interval."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pytest
from made_logs import step_log
from recovery import STOPPED, assert_recovered, recover, settings_of

DUTIES = [60, -40, 90, -80, 40, 0, -30, 70, -60, 30]
ROTARY = 4
"""the roll: a rotary actuator turns it"""
NOTHING: Mapping[str, float] = {}


class Case(NamedTuple):
    """Quantities with (lowest, highest, truth, start), what else the chain has, and
    commands [%] by joint."""

    rows: Mapping[str, tuple[float, float, float, float]]
    hydraulics: Mapping[str, float] = NOTHING
    commands: Sequence[Mapping[int, Sequence[float]]] = ({2: DUTIES},)
    dwell: float = 1.0
    pose: np.ndarray | None = None
    model: str = "dynamic"


# A limit of the flow, or of the droop, starts where it is felt: above what the log
# reaches it has no effect. The effect of the start pressure fades with the first
# movement, and a log of several has a second optimum.
CASES = {
    "lag of a pilot stage": Case(
        {"pilot_lag": (0.005, 1, 0.15, 0.05), "delay": (0, 0.5, 0.05, 0.1)}, {"dead_band": 20.0}
    ),
    "lag of the opening": Case({"opening_lag": (0.005, 1, 0.12, 0.04), "delay": (0, 0.5, 0.05, 0.1)}),
    "whether valve or speed lags": Case(
        {"lag_of_speed": (0, 1, 0.7, 0.2), "opening_lag": (0.005, 1, 0.12, 0.1),
         "opening_a": (0.05, 2, 0.4, 0.3), "opening_b": (0.05, 2, 0.15, 0.2)},
        NOTHING, ({2: [70, -70, 90, -90, 60, -80]},),
    ),
    "lever of a rotary actuator": Case(
        {"lever_slope": (-0.8, 0.8, 0.2, 0.0), "lever_bend": (-0.8, 0.8, -0.3, 0.0)},
        NOTHING, ({ROTARY: [90, 90, -90, -90, -90, 60, -80, 90]},),
    ),
    "a joint that rings on its oil": Case(
        {"oil_frequency": (0.5, 20, 1.4, 3), "oil_damping": (0, 0.9, 0.2, 0.5)}, model="quasi-static"
    ),
    "droop": Case({"pump_droop": (1, 150, 60, 20)}, {"pump_flow": 3.0}),
    "droop that ends at a limit": Case(
        {"pump_droop": (1, 300, 120, 60), "pump_limit": (1, 140, 40, 20)}, {"pump_flow": 3.0},
        model="quasi-static",
    ),
    "width of the slots": Case({"slot_width_a": (0.5, 5, 2.4, 1.5), "slot_width_b": (0.5, 5, 1.6, 2.2)}),
    "volume of the line": Case(
        {"line_volume": (20, 3000, 600, 200)}, {"pump_flow": 1.5}, ({2: [80, 0, -80, 0] * 5},), 0.25
    ),
    "anti-cavitation": Case({"anticavitation": (0.005, 5, 0.05, 0.2)}, {"return_a": 5.0, "return_b": 5.0}),
    "start pressure": Case({"start_pressure": (10, 120, 35, 60)}, {"dead_volume": 300.0}, ({2: [100]},), 0.5),
    "first pivot": Case({"pivot_distance_1": (0.2, 0.4, 0.3, 0.26)}),
    "dead volume": Case({"dead_volume": (5, 500, 120, 40)}),
    "friction": Case({"dry_friction": (10, 3000, 400, 1000)}),
    "overlap": Case({"overlap_a": (0.01, 1, 0.3, 0.1), "overlap_b": (0.01, 1, 0.15, 0.3)}),
    "friction of a rotary actuator": Case({"dry_friction": (0.5, 100, 15, 30)}, NOTHING, ({ROTARY: DUTIES},)),
    "leakage": Case({"leakage": (1e-4, 1, 0.02, 0.005)}),
    "flow limit": Case({"flow_limit": (0.1, 20, 0.5, 0.8)}),
    "the edges of a valve": Case(
        {
            "opening_a": (0.05, 1, 0.3, 0.4), "opening_b": (0.05, 1, 0.35, 0.4),
            "return_a": (0.2, 5, 2.2, 1), "return_b": (0.2, 5, 0.7, 1),
        },
        {"anticavitation": 3.0},
    ),
    "pivots": Case(  # with known areas the speed at each angle tells the moment arm
        {"pivot_distance_2": (0.05, 0.12, 0.075, 0.08), "pivot_angle": (45, 85, 78, 70)},
        NOTHING, ({2: [60, 60, -70, -70, 40, -50, -90, 80]},),
    ),
    "a shared pump that comes up": Case(
        {
            "pump_flow": (0.2, 10, 1.6, 2.5), "pump_idle": (0.05, 1, 0.5, 0.8),
            "pump_delay": (0, 2, 0.4, 0.3), "pump_rise": (0.01, 2, 0.2, 0.1),
        },
        NOTHING, ({2: [80, -60, 0, 50, -90, 0, 70], 3: [-70, 90, 0, 0, -80, 0, 60]},),
    ),
    "oil that is fed back": Case(
        {"draw_a": (0.05, 2, 0.4, 0.8), "draw_b": (0.05, 2, 0.7, 1.0)},
        {"pump_flow": 1.0}, ({2: [80, -60, 0, 50, -90, 0, 70], 3: [-70, 90, 0, 0, -80, 0, 60]},),
    ),
    "a valve that differs by side": Case(
        {
            "delay_a": (0, 0.5, 0.15, 0.1), "delay_b": (0, 0.5, 0.06, 0.1),
            "plunger_damping_a": (5, 500, 160, 100), "plunger_damping_b": (5, 500, 60, 100),
            "opening_exponent_a": (0.7, 3, 1.8, 1.5), "opening_exponent_b": (0.7, 3, 1.2, 1.5),
            "dead_band_a": (0, 40, 20, 12), "dead_band_b": (0, 40, 8, 12),
        },
        NOTHING, ({2: [50, -40, 80, -90, 60, 0, -60, 40, -30, 90, -70, 30]},), 0.8,
    ),
    "the curve of a valve": Case(
        {f"curve_{k}_a": (0.05, 100, true, 1) for k, true in enumerate((20.0, 0.5, 2.0, 0.4), start=1)}
        | {"dead_band_a": (0, 40, 10, 14)},
        {"opening_exponent": 1.4},
        ({2: [13, 15, -50, 25, 20, -40, 40, 60, -70, 0, 75, 85, -80, 20, 100, -90, 30, 50, 14]},), 0.6,
    ),
    "trapped pressure": Case(
        {"trapped_pressure": (0, 100, 25, 10), "dead_volume": (5, 300, 60, 40)},
        NOTHING, ({2: [25]}, {2: [50]}, {2: [100]}), pose=STOPPED,
    ),
    "a sensor's scale and lag": Case(
        {"sensor_scale": (0.8, 1.2, 1.04, 1), "sensor_lag": (0, 0.5, 0.08, 0.03)},
        NOTHING, ({2: [60, -40, 80, -70, 30]},),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", [*CASES])
def test_a_term_is_recovered(name):
    case = CASES[name]
    joints = tuple(case.commands[0])
    settings = settings_of(
        {
            q: {"quantity": q, "bounds": [low, high]}
            | (
                {}
                if q.startswith("pump_") or q == "line_volume"
                else {"joints": list(joints)}
            )
            for q, (low, high, _, _) in case.rows.items()
        },
        **case.hydraulics,
    ).changed({"outputs": joints, "simulation.model": case.model})
    pose = settings.arm.pose("study") if case.pose is None else case.pose
    logs = [step_log(pose, levels, case.dwell) for levels in case.commands]
    truth, start = ({q: row[k] for q, row in case.rows.items()} for k in (2, 3))
    assert_recovered(recover(settings, logs, truth, start), settings, truth)
