"""Arms and logs as the world has them go through `hydroid init` without a question."""

from pathlib import Path

import numpy as np
import pytest
from worlds import SIZES, WORLDS, write_log

import hydroid


@pytest.mark.parametrize("name", WORLDS)
def test_an_arm_of_the_world_is_taken_as_it_is(name: str, tmp_path: Path) -> None:
    world = WORLDS[name]
    log = write_log(world, tmp_path / "log.csv")
    made = hydroid.init(tmp_path / "mine", arm=world.write(world, tmp_path), log=log).result
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    assert settings.arm.joint_names == tuple(world.joints)
    assert {one.name for one in settings.arm.joints if one.slides} == {"telescope"} & {*world.joints}
    for number, joint in enumerate(world.joints, 1):
        kinds = "command", "angle"
        found = tuple(settings.log.columns(kind, number).column[0] for kind in kinds)
        assert found == world.columns[joint]
    for start in world.said:
        assert [note for note in made.notes if note.startswith(start)], (start, made.notes)
    assert len(made.notes) <= 5
    true = {link: 1200 * size**3 / 25 for link, size in SIZES.items()}
    for link, mass in settings.arm.mass_of.items():
        if link in true:
            assert np.abs(np.log(mass / true[link])) < np.log(6 if "lost" in name else 1.2)
    (read,) = hydroid.read_logs(log, settings)
    assert read.driven.all()
