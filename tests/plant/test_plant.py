"""The plant is the simulation of a fit, one command at a time, bit for bit; it can be
saved and exported."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from log_files import RIG
from made_logs import HYDRAULIC, TRUTH, at_rest, noisy
from made_models import made_model

from hydroid import fit, load_settings, read_logs
from hydroid.arm.model import load_machine, load_model
from hydroid.errors import RunError, SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.plant import Plant, load_plant
from hydroid.problem.bindings import Bindings
from hydroid.settings.fit import FitSettings
from hydroid.simulation import Response, make_simulation

VALUES = (
    TRUTH
    | HYDRAULIC
    | {"A_A": 900.0, "open_A": 0.4, "open_B": 0.4, "delay": 0.0, "friction": 100.0}
)


def model(stage: str = "mech", **changes: object) -> IdentifiedModel:
    return made_model(VALUES, changes, stage)


def log_of(settings: FitSettings, joints: list[int], seconds: float = 4.0) -> Log:
    """Steps and noise on some joints, from the settings' start pose."""
    rng = np.random.default_rng(0)
    period = settings.log.period_s
    time = np.arange(round(seconds / period), dtype=np.float64) * period
    command = np.zeros((len(time), 7))
    for joint in joints:
        levels = np.repeat(rng.uniform(-80, 80, 1 + len(time) // 60), 60)[: len(time)]
        command[:, joint - 1] = levels + rng.normal(0, 2, len(time))
    return at_rest(settings.arm.pose(settings.start_pose), command, period)


def response(fitted: IdentifiedModel, log: Log, joints: list[int]) -> Response:
    settings, columns = fitted.settings, [j - 1 for j in joints]
    pressures = columns if settings.stage == "hyd" else []
    simulation = make_simulation(
        load_model(settings.arm), log, columns, settings, pressures
    )
    return simulation.simulate(Bindings(settings).candidates(fitted.theta[None]))


@pytest.mark.parametrize("joints", [[2], [2, 3, 5], [1, 2, 3, 4, 5, 6, 7]], ids=len)
@pytest.mark.parametrize(
    ("stage", "changes"),
    [
        ("mech", {}),
        (
            "mech",
            {"simulation.other_joints": "passive", "simulation.steps_per_sample": 3},
        ),
        ("hyd", {"hydraulics.delay": 0.033}),
        (
            "hyd",
            {"simulation.other_joints": "passive", "simulation.steps_per_sample": 2},
        ),
        (
            "hyd",
            {
                "hydraulics.pump_flow": 2.0,
                "hydraulics.pump_idle": 0.5,
                "hydraulics.pump_rise": 0.2,
            },
        ),
    ],
)
def test_steps_are_the_simulation_of_the_fit_bit_for_bit(stage, changes, joints):
    fitted = model(stage, **changes)
    log = log_of(fitted.settings, joints)
    found = response(fitted, log, joints)
    expected, plant = found.angle[0], Plant(fitted, joints=joints)
    columns = [j - 1 for j in joints]
    angle: list[np.ndarray] = []
    for _ in range(2):  # and again after a reset
        angle, pressure = [plant.reset()], [plant.pressure]
        for command in log.command[:-1]:
            angle.append(plant.step(command))
            pressure.append(plant.pressure)
        np.testing.assert_array_equal(np.array(angle)[:, columns], expected)
        if found.pressure.size:
            np.testing.assert_array_equal(
                np.array(pressure)[:, columns], found.pressure[0]
            )
        assert np.isnan(
            np.delete(pressure[-1], columns if stage == "hyd" else [], axis=0)
        ).all()
    assert plant.time == pytest.approx(log.time[-1])
    assert np.ptp(expected, axis=0).min() > np.deg2rad(0.2)
    if changes.get("simulation.other_joints") != "passive":
        still = np.delete(np.array(angle), columns, axis=1)
        assert (still == np.delete(fitted.settings.arm.pose("study"), columns)).all()


@pytest.mark.parametrize("stage", ["mech", "hyd"])
def test_a_slower_control_period_holds_the_command(stage):
    fitted = model(stage)
    by_name, by_number = Plant(fitted, joints=["shoulder"]), Plant(fitted, joints=[2])
    np.testing.assert_array_equal(
        by_name.step({"shoulder": 50}), by_number.step([0, 50, 0, 0, 0, 0, 0])
    )
    np.testing.assert_array_equal(
        by_name.step({"shoulder": 500}), by_number.step([0, 100, 0, 0, 0, 0, 0])
    )
    assert repr(by_name) == "<Plant: shoulder; steps of 0.01 s; test>"
    fast, slow = Plant(fitted), Plant(fitted, period=0.05)
    command = np.zeros(7)
    for k in range(40):
        command[1] = 50 * np.sin(k / 5)
        held = [fast.step(command) for _ in range(5)]
        np.testing.assert_array_equal(slow.step(command), held[-1])
    assert slow.time == pytest.approx(fast.time) == pytest.approx(2.0)


def exported(plant: Plant, folder: Path) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """What plain MuJoCo reads of a saved plant, where it starts."""
    plant.save(folder)
    arm = mujoco.MjModel.from_xml_path(str(folder / "model" / "fitted.xml"))
    data = mujoco.MjData(arm)
    mujoco.mj_resetDataKeyframe(arm, data, arm.key("start").id)
    return arm, data


def test_an_external_force_acts_as_in_plain_mujoco(tmp_path):
    fitted = model()
    plant = Plant(fitted)
    arm, data = exported(plant, tmp_path)
    plant.data.xfrc_applied[-1, 2] = data.xfrc_applied[-1, 2] = -100.0  # [N]
    for _ in range(200):
        plant.step(np.zeros(7))
        mujoco.mj_step(arm, data)
        assert plant.angle[1] == pytest.approx(data.qpos[0], abs=1e-9)
    assert fitted.settings.arm.pose("study")[1] - plant.angle[1] > np.deg2rad(1)
    plant.data.xfrc_applied[:] = 0.0
    assert plant.reset()[1] == fitted.settings.arm.pose("study")[1]


def test_resets_to_other_poses_are_plants_made_there():
    fitted = model("hyd")
    plant = Plant(fitted)
    command = [0, 40.0, 0, 0, 0, 0, 0]
    for pose in ("rig", fitted.settings.arm.pose("home"), "study"):
        np.testing.assert_array_equal(plant.reset(pose)[0], plant.angle[0])
        other = Plant(fitted)
        other.reset(pose)
        for _ in range(30):
            np.testing.assert_array_equal(plant.step(command), other.step(command))


@pytest.mark.parametrize("stage", ["mech", "hyd"])
def test_a_saved_plant_is_the_same_plant(stage, tmp_path):
    plant = Plant(model(stage), joints=[2, 5])
    plant.save(tmp_path / "saved")
    (tmp_path / "saved").rename(tmp_path / "moved")
    again = load_plant(tmp_path / "moved")
    assert again.joints == (2, 5)
    for _ in range(50):
        command = [0, 70.0, 0, 0, -30.0, 0, 0]
        np.testing.assert_array_equal(again.step(command), plant.step(command))
    arm, moved = plant.identified.settings.arm, again.identified.settings.arm
    assert moved.pair is not None
    assert moved.pair.is_relative_to(tmp_path)
    there, here = (load_machine(one, pair=True).model for one in (moved, arm))
    np.testing.assert_allclose(there.body_mass, here.body_mass)
    assert there.nmesh == here.nmesh
    meshes = {path.name for path in (arm.model.parent.parent / "meshes").glob("*.stl")}
    assert {
        mesh.name for mesh in (tmp_path / "moved" / "model" / "meshes").iterdir()
    } == meshes


@pytest.mark.parametrize("joints", [[2], [2, 5]])
def test_plain_mujoco_steps_the_exported_mjcf_to_the_fits_response(joints, tmp_path):
    """Stage 1 on the demo's log: from the XML, with the commands as controls and
    nothing else."""
    fitted = model()
    (log,) = read_logs([RIG / "rig_shoulder_1.csv"], fitted.settings)
    log.command[:, 4] = 0.3 * log.command[:, 1] if 5 in joints else 0.0
    expected = response(fitted, log, joints).angle[0]
    plant = Plant(fitted, joints=joints)
    plant.reset(log.start)
    arm, data = exported(plant, tmp_path)
    angle = [data.qpos.copy()]
    for command in log.command[:-1]:
        data.ctrl[:] = command[[j - 1 for j in joints]]
        mujoco.mj_step(arm, data)
        angle.append(data.qpos.copy())
    assert np.ptp(expected, axis=0).min() > np.deg2rad(1)
    np.testing.assert_allclose(angle, expected, rtol=0, atol=1e-6)
    assert arm.nmesh == plant.model.nmesh > 0


def test_stage_2_exports_no_motors_and_says_that_mujoco_alone_is_not_enough(tmp_path):
    plant = Plant(model("hyd"))
    plant.save(tmp_path)
    names = {path.name for path in (tmp_path / "model").iterdir()}
    assert names == {
        "arm.xml",
        "pair.xml",
        "meshes",
        "mechanics.xml",
        "actuators.yaml",
        "README.txt",
    }
    assert (
        "MuJoCo alone cannot step this arm"
        in (tmp_path / "model" / "README.txt").read_text()
    )
    bare = mujoco.MjModel.from_xml_path(str(tmp_path / "model" / "mechanics.xml"))
    assert bare.nu == 0
    np.testing.assert_allclose(bare.body_mass, plant.model.body_mass)
    assert bare.dof_damping[0] == VALUES["D"]
    text = (tmp_path / "model" / "actuators.yaml").read_text()
    assert 900.0 in [
        round(float(area), 9) for area in re.findall(r"area_a: ([\d.]+)", text)
    ]


def test_a_plant_of_a_run_takes_commands_for_the_joints_that_the_fit_drove(tmp_path):
    """The fit compares the shoulder alone, and one of its logs drives the elbow too."""
    small = {"start_pose": "study", "search.algorithm": "ga", "refinement": None}
    settings = load_settings(
        "fit-mech", small | {"search.ga": {"generations": 1, "population": 6}}
    )
    # a sensor that shows no noise would have failed
    logs = [noisy(log_of(settings, joints, 1.0)) for joints in ([2], [2, 3])]
    result = fit(settings, logs, tmp_path / "run")
    assert load_plant(tmp_path / "run").joints == Plant(result.model).joints == (2, 3)
    assert load_plant(tmp_path / "run", joints=[2]).joints == (2,)


@pytest.mark.parametrize("stage", ["mech", "hyd"])
def test_a_plant_that_diverges_says_when(stage, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plant = Plant(model(stage))
    plant.step(np.zeros(7))
    plant.data.qvel[:] = np.nan
    with pytest.raises(RunError, match=r"diverged before 0\.02 s"):
        plant.step(np.zeros(7))
    plant.reset()
    assert np.isfinite(plant.step(np.zeros(7))).all()
    assert capfd.readouterr() == ("", "")
    assert not Path("MUJOCO_LOG.TXT").exists()


@pytest.mark.parametrize(
    ("refused", "says"),
    [
        (lambda: Plant(model(), joints=[2, 8]), "joints 1 to 7"),
        (lambda: Plant(model(), period=0.015), r"multiple of 0\.01 s"),
        (lambda: Plant(model()).reset([0.0, 0.1]), "7 finite angles"),
        (lambda: Plant(model()).reset("nowhere"), "no pose 'nowhere'"),
        (
            lambda: load_plant("fit-hyd", overrides={"parameters.F1.fixed": 500}),
            "force-stroke curve",
        ),
        (lambda: load_plant("fit-mech"), "no nominal gain"),
        (lambda: Plant(model()).step([0, 1]), "command"),
        (lambda: Plant(model()).step(5.0), "command"),
        (lambda: Plant(model()).step([0, np.nan, 0, 0, 0, 0, 0]), "command"),
        (lambda: Plant(model()).step([1, 0, 0, 0, 0, 0, 0]), "only shoulder take"),
        (
            lambda: Plant(model()).step({"boom": 1.0}),
            "no joint boom; the arm has azimuth",
        ),
        (lambda: Plant(model(), joints=["boom"]), "joints 1 to 7: azimuth, shoulder"),
    ],
)
def test_what_no_plant_can_be_or_do_is_refused(refused, says):
    with pytest.raises((SettingsError, ValueError), match=says):
        refused()
