"""What a model predicts of a log beside its angles: pressures and flows of the oil."""

import numpy as np
import pytest
from made_logs import HYDRAULIC, TRUTH, step_log

from hydroid import load_settings
from hydroid.identified_model import IdentifiedModel, identified
from hydroid.log import Log
from hydroid.prediction import predict, predict_with_oil
from hydroid.settings.cylinder import LinearActuator

BOTH = {name: value for name, value in TRUTH.items() if name != "K"} | HYDRAULIC
JOINTS = (2, 3)


def made(**changes: object) -> tuple[IdentifiedModel, Log]:
    fixed = {f"parameters.{name}.fixed": value for name, value in BOTH.items()}
    settings = load_settings("article-hyd", fixed | {"outputs": [2, 3]} | changes)
    log = step_log(settings.arm.pose("rig"), {2: [50.0, -60.0], 3: [0.0, 40.0]})
    return identified(settings, BOTH, "truth"), log


def volumes(model: IdentifiedModel, joint: int, angle: np.ndarray) -> np.ndarray:
    """What chambers A and B of a joint have taken in at its angles [rad], shape (T, 2)
    [m³]."""
    cylinder = model.settings.arm.joints[joint - 1].actuator
    assert isinstance(cylinder, LinearActuator)
    out = cylinder.length(angle) - cylinder.length(angle[:1])
    areas = [HYDRAULIC["A_A"], HYDRAULIC["A_B"]]
    return 1e-6 * np.outer(out, areas) * [1.0, -1.0]


@pytest.mark.parametrize(("kind", "part"), [("dynamic", 0.03), ("quasi-static", 0.01)])
def test_what_flows_into_a_chamber_fills_it(kind: str, part: float):
    """Oil is nearly stiff: the flows add up to the volumes that the rod opens."""
    model, log = made(**{"simulation.model": kind, "hydraulics.leakage": 0.0})
    angle, oil = predict_with_oil(model, log, JOINTS)
    assert oil is not None
    assert oil.line is None
    assert np.array_equal(angle, predict(model, log, JOINTS))
    for column, joint in enumerate(JOINTS):
        taken = log.period * np.cumsum(oil.flow[:, column], axis=0)
        opened = volumes(model, joint, angle[:, column])
        assert np.ptp(opened) > 1e-5
        assert taken == pytest.approx(opened, abs=part * np.ptp(opened))


@pytest.mark.parametrize("kind", ["dynamic", "quasi-static"])
def test_the_pressure_of_a_pumps_line_falls_while_joints_take_oil(kind: str):
    pump = {"hydraulics.pump_flow": 2.0, "hydraulics.pump_droop": 40.0}
    model, log = made(**pump, **{"simulation.model": kind, "hydraulics.substeps": 10})
    _, oil = predict_with_oil(model, log, JOINTS)
    assert oil is not None
    assert oil.line is not None
    supply = 1e5 * model.settings.hydraulics.supply_pressure
    assert oil.line[0] == pytest.approx(supply)
    assert oil.line.max() <= supply * (1 + 1e-9)
    assert oil.line[150] < 0.95 * supply


def test_a_model_without_hydraulics_has_no_oil():
    settings = load_settings("article-mech")
    model = identified(settings, TRUTH, "truth")
    log = step_log(settings.arm.pose("rig"), [50.0])
    assert predict_with_oil(model, log, (2,))[1] is None
