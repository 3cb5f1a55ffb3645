"""Terms that no other test recovers: each is estimated from a simulated log of one joint."""

from typing import NamedTuple

import pytest
from recovery import assert_recovered, duties, recover, settings_of


class Case(NamedTuple):
    """Rows of (quantity, lowest, highest, truth, start), what else the chain has, and the commands [%]."""

    rows: tuple[tuple[str, float, float, float, float], ...]
    hydraulics: dict[str, float]
    commands: tuple[float, ...]
    dwell: float = 1.0
    joint: int = 2


# The flow limit starts where it is felt: above the largest flow of the log it has no effect. The
# effect of the start pressure fades with the first movement, and a log of several has a second optimum.
DUTIES = (60, -40, 90, -80, 40, 0, -30, 70, -60, 30)
ROTARY = 4
"""the roll: a rotary actuator turns it"""
CASES = {
    "droop": Case((("pump_droop", 1, 150, 60, 20),), {"pump_flow": 3.0}, DUTIES),
    "width of the slots": Case(
        (("slot_width_a", 0.5, 5, 2.4, 1.5), ("slot_width_b", 0.5, 5, 1.6, 2.2)), {}, DUTIES
    ),
    "volume of the line": Case(
        (("line_volume", 20, 3000, 600, 200),), {"pump_flow": 1.5}, (80, 0, -80, 0) * 5, 0.25
    ),
    "anti-cavitation": Case(
        (("anticavitation", 0.005, 5, 0.05, 0.2),), {"return_a": 5.0, "return_b": 5.0}, DUTIES
    ),
    "start pressure": Case((("start_pressure", 10, 120, 35, 60),), {"dead_volume": 300.0}, (100,), 0.5),
    "first pivot": Case((("pivot_distance_1", 0.2, 0.4, 0.3, 0.26),), {}, DUTIES),
    "dead volume": Case((("dead_volume", 5, 500, 120, 40),), {}, DUTIES),
    "friction": Case((("dry_friction", 10, 3000, 400, 1000),), {}, DUTIES),
    "overlap": Case((("overlap_a", 0.01, 1, 0.3, 0.1), ("overlap_b", 0.01, 1, 0.15, 0.3)), {}, DUTIES),
    "friction of a rotary actuator": Case((("dry_friction", 0.5, 100, 15, 30),), {}, DUTIES, joint=ROTARY),
    "leakage": Case((("leakage", 1e-4, 1, 0.02, 0.005),), {}, DUTIES),
    "flow limit": Case((("flow_limit", 0.1, 20, 0.5, 0.8),), {}, DUTIES),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_term_is_recovered(name):
    case = CASES[name]
    shared = ("pump_droop", "line_volume")
    parameters = {
        q: {"quantity": q, "bounds": [low, high]} | ({} if q in shared else {"joints": [case.joint]})
        for q, low, high, _, _ in case.rows
    }
    settings = settings_of(parameters, **case.hydraulics).model_copy(update={"outputs": (case.joint,)})
    truth = {q: value for q, _, _, value, _ in case.rows}
    start = {q: value for q, *_, value in case.rows}
    log = duties(settings.arm.pose("study"), {case.joint: case.commands}, case.dwell)
    assert_recovered(recover(settings, [log], truth, start), settings, truth)
