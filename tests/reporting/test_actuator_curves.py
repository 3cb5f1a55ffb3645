"""An actuator's curves: what is drawn obeys the laws that it draws."""

import numpy as np
import pytest

from hydroid.errors import SettingsError
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.reporting.actuator_report import JointActuator, draw, joint_actuator
from hydroid.reporting.chart import Panel

SETTINGS = {"hydraulics.overlap_a": 0.4, "hydraulics.flow_limit": 2.0, "parameters.I_max.fixed": 1.2}


def nominal(settings: dict[str, float]) -> IdentifiedModel:
    return load_identified(None, "fit-hyd", settings, nominal=True)


@pytest.fixture(scope="module")
def actuator() -> JointActuator:
    return joint_actuator(nominal(SETTINGS), 2)


PANELS = ("current", "force", "spool", "flow", "torque")


def panel(actuator: JointActuator, name: str) -> Panel:
    return draw(actuator).panels[PANELS.index(name)]


def curve(actuator: JointActuator, name: str, label: str) -> tuple[np.ndarray, np.ndarray]:
    (mark,) = [mark for mark in panel(actuator, name).marks if mark.label == label]
    return mark.x, mark.y


def test_the_force_curve_at_rated_current_runs_through_its_points(actuator: JointActuator):
    stroke, force = curve(actuator, "force", "rated current")
    for at, expected in zip(*curve(actuator, "force", "F1, F2 (rated)"), strict=True):
        assert np.interp(at, stroke, force) == pytest.approx(expected, rel=2e-3)


def test_flow_grows_with_the_root_of_the_drop_up_to_the_pumps_limit(actuator: JointActuator):
    at, ten = curve(actuator, "flow", "10 bar")
    _, fifty = curve(actuator, "flow", "50 bar")
    _, hundred = curve(actuator, "flow", "100 bar")
    partly = (at > 0.6) & (at < 1.4)
    assert fifty[partly] == pytest.approx(np.sqrt(5) * ten[partly], rel=1e-3)
    assert hundred.max() == pytest.approx(2.0)


def test_a_set_without_a_force_stroke_curve_is_refused_in_words():
    infeasible = nominal({"parameters.F1.fixed": 500})
    with pytest.raises(SettingsError, match=r"joint 2: no .* curve runs through 500 N at 0\.8 mm"):
        joint_actuator(infeasible, 2)
    joint_actuator(infeasible, 1)  # the others have one
