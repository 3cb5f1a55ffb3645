"""Arms and logs as the world has them go through `hydroid init` without a question."""

from pathlib import Path

import numpy as np
import pytest
from log_formats import BagWriter
from worlds import SIZES, WORLDS, write_log

import hydroid

pytestmark = pytest.mark.usefixtures("short_searches")


@pytest.mark.parametrize("name", WORLDS)
def test_an_arm_of_the_world_is_taken_as_it_is(name: str, tmp_path: Path) -> None:
    world = WORLDS[name]
    log = write_log(world, tmp_path / "log.csv")
    made = hydroid.init(
        tmp_path / "mine", arm=world.write(world, tmp_path), log=log
    ).result
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    assert settings.arm.joint_names == tuple(world.joints)
    assert {one.name for one in settings.arm.joints if one.slides} == {"telescope"} & {
        *world.joints
    }
    for number, joint in enumerate(world.joints, 1):
        kinds = "command", "angle"
        found = tuple(settings.log.columns(kind, number).column[0] for kind in kinds)
        assert found == world.columns[joint]
    for start in world.said:
        assert [note for note in made.notes if note.startswith(start)], (
            start,
            made.notes,
        )
    assert len(made.notes) <= 5
    # boxes stand around a link that is hollow; a lost mesh leaves only the distances of
    # the joints
    boxes = world.density != 1200 and "<box" in world.shape
    true = {
        link: (500 if boxes else 1200) * size**3 / 25 for link, size in SIZES.items()
    }
    for link, mass in settings.arm.mass_of.items():
        if link in true:
            assert np.abs(np.log(mass / true[link])) < np.log(
                6 if "lost" in name else 1.2
            )
    (read,) = hydroid.read_logs(log, settings)
    assert read.driven.all()


def test_the_folder_of_a_ros_2_bag_whose_joints_change_places(tmp_path: Path) -> None:
    """Names in each message, not places, tell the joints; commands come as joint states
    too."""
    world = WORLDS["a crane with a telescope"]
    rng, joints = np.random.default_rng(0), list(world.columns)
    data = np.loadtxt(write_log(world, tmp_path / "a.csv"), delimiter=",", skiprows=1)
    with BagWriter(tmp_path / "bag", "ros2") as bag:
        for row in data:
            order = rng.permutation(len(joints))
            for topic, values in ("commands", 10 * row[1:6]), ("states", row[6:]):
                message = bag.joints(
                    1e9 + row[0], [joints[k] for k in order], values[order].copy()
                )
                bag.write(f"/joint_{topic}", 1e9 + row[0], message)
    robot = world.write(world, tmp_path)
    hydroid.init(tmp_path / "mine", arm=robot, log=tmp_path / "bag")
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    (log,) = hydroid.read_logs(tmp_path / "bag", settings)
    assert log.driven.all()
    assert np.ptp(log.angle[:, 3]) == pytest.approx(np.ptp(data[:, 9]), rel=1e-3)
    assert settings.log.columns("command", 4).column == (
        "/joint_commands.position[telescope]",
    )
