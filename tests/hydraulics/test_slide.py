"""A telescope: a joint that slides, with its cylinder along it."""

from pathlib import Path

import numpy as np
import pytest
from arms import MODELS, posed
from made_logs import step_log
from recovery import assert_recovered, recover

import hydroid
from hydroid.advice.design import design
from hydroid.arm.locked import lock
from hydroid.arm.model import load_model
from hydroid.errors import SettingsError
from hydroid.fitting.validation import Prediction
from hydroid.fitting.verdict import judge
from hydroid.log import Log
from hydroid.posterior.bench import make_bench
from hydroid.posterior.quantities import joint_measure
from hydroid.problem.bindings import Bindings
from hydroid.progress import no_progress
from hydroid.reporting.predictions import validation_page
from hydroid.settings.fit import FitSettings

TRUTH = {"area_A": 3400.0, "area_B": 1650.0, "delay": 0.12, "M_telescope": 310.0}
PARAMETERS = {
    "area_A": {
        "quantity": "area_a",
        "joints": ["telescope"],
        "bounds": [1500, 6000],
        "start": 3100,
    },
    "area_B": {
        "quantity": "area_b",
        "joints": ["telescope"],
        "bounds": [800, 3500],
        "start": 1750,
    },
    "delay": {
        "quantity": "delay",
        "joints": ["telescope"],
        "bounds": [0, 0.5],
        "start": 0.05,
    },
    "M_telescope": {"quantity": "mass", "link": "telescope", "within": 2},
    "D": {"quantity": "damping", "joints": ["telescope"], "fixed": 2000},
}


@pytest.fixture(scope="module")
def settings() -> FitSettings:
    changes = {
        "arm": str(MODELS / "crane.yaml"),
        "outputs": [2],
        "parameters": PARAMETERS,
    }
    changes |= {
        "start_pose": "up",
        "simulation.threads": 1,
        "hydraulics.supply_pressure": 150,
    }
    return hydroid.load_settings("fit-hyd", changes)


def test_its_cylinder_lies_along_it(settings: FitSettings) -> None:
    joint = settings.arm.joints[1]
    assert (joint.slides, joint.range, joint.limits) == (True, (0.0, 1.8), (0.0, 1.8))
    assert joint.actuator.stroke == pytest.approx(1800)
    assert joint.actuator.length(1.3) - joint.actuator.length(0.2) == pytest.approx(1.1)
    np.testing.assert_array_equal(
        joint.actuator.moment_arm(np.linspace(0, 1.8, 5)), 1.0
    )


def test_locking_the_boom_leaves_a_mass_on_a_slope(settings: FitSettings) -> None:
    """Free of its cylinder it slides down at g sin: the reduced model is the whole
    one."""
    moving = np.array(settings.arm.joint_names) == "telescope"
    locked = lock(
        load_model(settings.arm), settings.arm, moving, settings.arm.pose("up")
    )
    data = posed(locked.model, 0.9)
    assert data.qacc[0] == pytest.approx(-9.81 * np.sin(0.9), rel=1e-9)
    assert data.M[0] == pytest.approx(250)


def test_a_reader_meets_millimetres_and_newtons(settings: FitSettings) -> None:
    assert [p.unit for p in settings.parameter_set().parameters if p.name == "D"] == [
        "N·s/m"
    ]
    time, place = np.arange(300) * 0.01, np.zeros((300, 2))
    log = Log("a.csv", time, np.tile([0.0, 50.0], (300, 1)), place, 0.01)
    one = Prediction("fit", log, (2,), place[:, [1]] - 0.02, {}, None)
    errors = validation_page(
        [one], {"fit": judge(settings, [], {}, [one])}, settings.arm
    ).tables["errors"]
    row = dict(zip(errors.header, errors.rows[0], strict=True))
    assert (row["rms"], row["unit"]) == (pytest.approx(20), "mm")


def test_what_no_experiment_of_it_keeps_is_said_in_millimetres(
    settings: FitSettings,
) -> None:
    """A joint that slides by 1 m counts as one that turns by 1 rad."""
    limits = {"margin_deg": 60, "poses": "any", "effort": 2, "duration_s": 4}
    limits |= {"clearance_m": None}
    tight = settings.changed({"design": settings.design.changed(limits)})
    values = {**TRUTH, "D": 2000.0}
    theta = tight.parameter_set().vector(values, "the truth")
    with pytest.raises(SettingsError, match=r"telescope nearer than 1047 mm to an end"):
        design(tight, theta, [], 1, no_progress)


def test_areas_delay_and_mass_are_recovered(settings: FitSettings) -> None:
    """The slope tells the mass: one log has the boom up, one has it level."""
    levels = {2: [40, -40, 80, -30, 20, -60, 60, -50, 0, 30]}
    logs = [step_log(np.array([boom, 0.4]), levels, dwell=0.8) for boom in (1.2, 0.0)]
    start = {"area_A": 3000.0, "area_B": 1800.0, "delay": 0.05, "M_telescope": 250.0}
    assert_recovered(recover(settings, logs, TRUTH, start), settings, TRUTH)


@pytest.mark.parametrize(
    ("quantity", "unit"),
    [("area", "mm²"), ("area_a", "mm²"), ("dry_friction", "N"), ("damping", "N·s/m")],
)
def test_a_rotary_actuator_on_a_slide_has_the_units_of_a_slide(
    tmp_path: Path, quantity: str, unit: str
) -> None:
    text = (
        (MODELS / "crane.yaml")
        .read_text()
        .replace("model: crane.xml", f"model: {MODELS / 'crane.xml'}")
    )
    lines = [
        line
        for line in text.splitlines()
        if not line.startswith("  telescope: {kind: linear")
    ]
    place = next(i for i, line in enumerate(lines) if line.startswith("actuators:")) + 1
    lines.insert(
        place, "  telescope: {kind: rotary, displacement: 3000, max_opening: 6}"
    )
    (tmp_path / "crane.yaml").write_text("\n".join(lines))
    one = {"quantity": quantity, "joints": ["telescope"], "nominal": 10.0, "within": 2}
    changes = {
        "arm": str(tmp_path / "crane.yaml"),
        "outputs": [2],
        "start_pose": "up",
        "parameters": {"p": one},
    }
    (found,) = hydroid.load_settings("fit-hyd", changes).parameter_set().parameters
    assert found.unit == unit


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_its_flow_is_area_times_speed_and_its_pose_is_said_in_mm(
    settings: FitSettings, sign: float
) -> None:
    log = step_log(settings.arm.pose("up"), {2: [50.0, 100.0]})
    log.angle[-1, 1] += 0.5
    bench = make_bench(settings, [log], 2)
    assert bench.angle == pytest.approx(
        1e-3 * float(bench.pose.removesuffix(" mm")), abs=1e-12
    )
    estimate = Bindings(settings).candidates(
        settings.parameter_set().vector(TRUTH, "truth")[None]
    )
    found = {
        column.label: float(value[0])
        for column, value in joint_measure(bench, estimate)(estimate)
    }
    area = TRUTH["area_A" if sign > 0 else "area_B"] * 1e-6
    word = "extending" if sign > 0 else "retracting"
    name = settings.arm.joint_names[1]
    moves = f"when {word}: 100 % command, {name} at {bench.pose}"
    speed = found[f"speed {moves}"] * 1e-3
    flow = found[f"flow {moves}"]
    assert flow == pytest.approx(6e4 * area * speed, rel=1e-9)
