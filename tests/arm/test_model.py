"""The shipped models: what the article and the meshes say of them, and mechanics that a
reader can check."""

import shutil
import subprocess
import sys

import mujoco
import numpy as np
import pytest
import trimesh
from arms import posed

from hydroid.arm.model import load_machine, load_model
from hydroid.errors import ModelError, SettingsError
from hydroid.files import assets
from hydroid.settings.arm import load_arm

ARM = load_arm("hydrolek")
MODEL = load_model(ARM).compile()
MESHES = sorted((assets() / "meshes").glob("*.stl"))


def test_making_the_models_again_changes_no_byte(tmp_path):
    """The inertias come from the meshes, and the two arms from the one."""
    for folder in ("meshes", "models"):
        shutil.copytree(assets() / folder, tmp_path / folder)
    arm, dual = (
        tmp_path / "models" / name for name in ("hydrolek.xml", "hydrolek_dual.xml")
    )
    arm.write_text(arm.read_text().replace('pos="0.27776318921062887 ', 'pos="0 '))
    dual.unlink()
    subprocess.run([sys.executable, tmp_path / "meshes" / "make_models.py"], check=True)
    for path in (arm, dual):
        assert path.read_bytes() == (assets() / "models" / path.name).read_bytes()


@pytest.mark.slow  # manifold3d cuts all meshes twice
def test_the_committed_meshes_are_those_of_the_script(tmp_path):
    pytest.importorskip("manifold3d")
    folders = [tmp_path / name for name in ("once", "again")]
    for folder in folders:
        folder.mkdir()
        make = [sys.executable, assets() / "meshes" / "make_meshes.py", folder]
        subprocess.run(make, check=True, capture_output=True)
    assert [path.name for path in MESHES] == sorted(
        path.name for path in folders[0].iterdir()
    )
    # another release of manifold3d may cut other triangles from the same solid
    for path in MESHES:
        assert (folders[0] / path.name).read_bytes() == (
            folders[1] / path.name
        ).read_bytes()
        kept, fresh = trimesh.load_mesh(path), trimesh.load_mesh(folders[0] / path.name)
        for name in ("volume", "center_mass", "moment_inertia"):
            np.testing.assert_allclose(
                getattr(fresh, name), getattr(kept, name), rtol=1e-4, atol=1e-5
            )
        assert path.stat().st_size < 100_000


@pytest.mark.parametrize("joint", ["shoulder", "elbow", "wrist"])
def test_positive_pitch_lifts_the_jaws(joint):
    angle = 0.1 * (np.array(ARM.joint_names) == joint)
    there, here = (
        posed(MODEL, q).body("jaw_left").xipos[2] for q in (angle, 0 * angle)
    )
    assert there > here + 0.01


def test_motors_are_joint_torques_and_nothing_else_pushes():
    data = mujoco.MjData(MODEL)
    data.ctrl[:] = np.arange(1.0, 8.0)
    mujoco.mj_forward(MODEL, data)
    np.testing.assert_allclose(data.qfrc_actuator, data.ctrl)
    np.testing.assert_array_equal(data.qfrc_passive, 0)
    assert [MODEL.actuator(k).name for k in range(MODEL.nu)] == list(ARM.joint_names)
    assert MODEL.opt.timestep == 0.01


def test_each_arm_of_a_pair_is_the_one_that_stands_alone():
    """Its gravity and inertia, on both sides."""
    machine = load_machine(ARM, pair=True)
    rng = np.random.default_rng(1)
    for _ in range(3):
        pose = rng.uniform(np.maximum(ARM.lower, -3), np.minimum(ARM.upper, 3))
        one, data = posed(MODEL, pose), posed(machine.model, np.tile(pose, 2))
        np.testing.assert_allclose(data.qfrc_bias, np.tile(one.qfrc_bias, 2), atol=1e-9)
        full, single = np.zeros((14, 14)), np.zeros((7, 7))
        mujoco.mj_fullM(machine.model, data, full)
        mujoco.mj_fullM(MODEL, one, single)
        np.testing.assert_allclose(full, np.kron(np.eye(2), single), atol=1e-9)


def test_an_arm_that_names_no_pair_or_another_model_says_how():
    with pytest.raises(SettingsError, match=r"stands alone.*pair: MODEL"):
        load_machine(ARM.changed({"pair": None}), pair=True)
    with pytest.raises(
        ModelError,
        match=r"not the model of two of the arm; the joints .* right_azimuth",
    ):
        load_machine(ARM.changed({"pair": ARM.model}), pair=True)
