"""A project out of an arm's CAD and a log: it runs, says what it assumed, and overwrites nothing."""

import json
import re
import runpy
import shutil
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import robots
from robots import LIMIT, link, write_robot
from typer.testing import CliRunner

import hydroid
from hydroid.commands.app import app
from hydroid.errors import LogError, ModelError, SettingsError
from hydroid.project.project import Project
from hydroid.settings.arm import load_arm
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.fit import FitSettings

URDF = Path(__file__).parents[2] / "examples" / "urdf"
EXAMPLE = runpy.run_path(str(URDF / "make_example.py"))
"""how it simulates a machine like a project's, its boom's valve wired the other way round"""


def init(folder: Path, arm: Path | None = None, logs: list[Path] | None = None, **more: Any) -> Project:
    return hydroid.init(folder, arm=arm, log=logs, **more).result


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a URDF, three logs of a machine like it, and a project `mine` of all."""
    folder = tmp_path_factory.mktemp("lab")
    robot = write_robot(folder)
    init(folder / "machine", robot)
    for seed in range(3):
        EXAMPLE["write_log"](folder / "machine", folder / f"move_{seed}.csv", seed)
    init(folder / "mine", robot, sorted(folder.glob("move_*.csv")))
    return folder


def test_columns_units_and_scales_are_those_of_the_log(place: Path):
    settings = hydroid.load_settings(place / "mine" / "fit.yaml")
    assert settings.outputs == (1, 2, 3)
    assert settings.log.columns("command", 2).column == ("boom valve [V]",)
    assert settings.log.columns("command", 2).scale == -10
    assert settings.log.columns("angle", 3).unit == "rad"
    assert settings.log.time.unit == "ms"
    page = (place / "mine" / "fit.yaml").read_text()
    assert "# - boom valve [V]: command in ±10 V of boom_joint, by its name" in page


def test_a_fit_starts_near_the_log(place: Path):
    """Valves sized by the arm's weight and the log's speeds are within a factor of 2.5 of the truth's."""
    first = hydroid.load_settings(place / "machine" / "fit.yaml").parameters
    second = hydroid.load_settings(place / "mine" / "fit.yaml")
    assert set(first) == set(second.parameters)
    openings = [joint.actuator.max_opening for joint in second.arm.joints]
    true = [joint.actuator.max_opening for joint in load_arm(place / "machine" / "arm.yaml").joints]
    assert np.all(np.abs(np.log(np.array(openings) / true)) < np.log(2.5))


@pytest.mark.slow
def test_from_cad_and_log_to_a_validated_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Every command of the next steps, as they stand; the last log was not fitted."""
    shutil.copytree(URDF, tmp_path / "urdf")
    monkeypatch.chdir(tmp_path / "urdf")
    command = ["init", "new", "--arm", "robot.urdf", "--json"]
    for name in sorted(Path().glob("log_*.csv")):
        command += ["--log", str(name)]
    done = CliRunner().invoke(app, command)
    steps = json.loads(done.stdout)["commands"]
    assert [step.split()[1] for step in steps] == ["check", "fit-hyd", "validate", "suggest"]
    for step in steps[:3]:
        done = CliRunner().invoke(app, [*step.split()[1:], "--json"])
        assert done.exit_code == 0, done.output
    results = json.loads(done.stdout)["results"]
    errors = [result["mae_deg"] for result in results]
    assert len(errors) == 3
    assert max(errors) < 0.5


def test_nothing_is_overwritten(place: Path):
    before = {path: path.read_bytes() for path in (place / "mine").glob("*.*")}
    with pytest.raises(SettingsError, match=r"mine: holds arm\.yaml already; name another folder, or"):
        init(place / "mine")
    assert before == {path: path.read_bytes() for path in (place / "mine").glob("*.*")}
    expected = {"digger", "machine", "mine", *(f"move_{k}.csv" for k in range(3))}
    assert {path.name for path in place.iterdir()} == expected


def test_a_project_is_replaced_if_that_is_asked_for(tmp_path: Path):
    robot = write_robot(tmp_path)
    init(tmp_path / "mine", robot)
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    again = init(tmp_path / "mine", robot, force=True, total_mass=2180.0)
    assert load_arm(tmp_path / "mine" / "arm.yaml").masses.sum() == pytest.approx(2180)
    assert {path.name for path in (tmp_path / "mine").iterdir()} == {*again.files, "notes.txt"}


def test_a_telescopes_column_is_its_own(tmp_path: Path):
    """Columns in m go to the joint that slides; a bucket that nothing names is asked for."""
    telescope = {"kind": "prismatic", "at": "2 0 0", "axis": "1 0 0", "limit": LIMIT.format(0, 1.5)}
    robot = write_robot(tmp_path, stick_joint=robots.joint("telescope", "boom", "stick", **telescope))
    time = np.arange(0, 20, 0.02)
    drive = 60 * np.sign(np.sin(time)) * (time > 1)
    way = np.cumsum(0.02 * np.roll(drive, 5)) / 100
    columns = {"t": time, "slew_V": drive / 10, "boom_V": drive / 10, "tele_V": drive / 10, "u9": drive}
    columns |= {"slew_deg": 30 * way, "boom_deg": 20 * way, "tele_length_m": 0.3 + 0.4 * way}
    rows = np.stack([*columns.values()], 1)
    np.savetxt(tmp_path / "a.csv", rows, "%.6g", ",", header=",".join(columns), comments="")
    made = init(tmp_path / "mine", robot, [tmp_path / "a.csv"])
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    assert settings.log.columns("angle", 3).column == ("tele_length_m",)
    assert settings.log.columns("angle", 3).unit == "m"
    assert settings.log.columns("command", 3).column == ("tele_V",)
    assert "tele_length_m: position in m of telescope, by its name" in made.columns
    assert any(line.startswith("left out, though like a joint's command: u9") for line in made.columns)
    (log,) = hydroid.read_logs(tmp_path / "a.csv", settings)
    assert np.ptp(log.angle[:, 2]) == pytest.approx(0.4 * np.ptp(way), rel=1e-3)
    actuator = settings.arm.joints[2].actuator
    assert actuator.length(1.0) - actuator.length(0.25) == pytest.approx(0.75)
    assert not any("OTHER" in step for step in made.commands if " check " in step)


def test_an_error_leaves_nothing_behind(tmp_path: Path):
    robot, log = write_robot(tmp_path), tmp_path / "log.csv"
    log.write_text("name,colour\nboom,red\nstick,blue\n")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(LogError, match="no column that looks like a time"):
        init(tmp_path / "new" / "mine", robot, [log])
    robot.write_text(robot.read_text().replace("</robot>", ""))
    with pytest.raises(ModelError, match="cannot be read as XML"):
        init(tmp_path / "new" / "mine", robot)
    assert sorted(tmp_path.rglob("*")) == before


def test_without_cad_there_is_a_template_that_runs(tmp_path: Path):
    init(tmp_path / "mine")
    arm = load_arm(tmp_path / "mine" / "arm.yaml")
    assert all(isinstance(joint.actuator, LinearActuator) for joint in arm.joints)
    assert arm.joints[0].actuator.sense == 1
    assert arm.joints[1].actuator.sense == -1  # its cylinder pushes the stick down
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    hydroid.load_plant(tmp_path / "mine" / "fit.yaml").step(np.array([50.0, -50.0]))
    assert {"area_A_boom", "area_B_boom", "open_A_boom"} <= set(settings.parameters)


def project(place: Path, folder: Path, text: str) -> tuple[Project, FitSettings]:
    (folder / "log.csv").write_text(text)
    made = init(folder / "mine", place / "digger/urdf/digger.urdf", [folder / "log.csv"])
    return made, hydroid.load_settings(folder / "mine" / "fit.yaml")


ROWS = count(-99)
"""0 at the hundredth"""


@pytest.mark.parametrize(
    ("column", "change", "note", "scale"),
    [
        (
            3,
            lambda u: -u,
            r"stick_joint moves against its command \(on \d+% of its way\): the command's sign",
            -10,
        ),
        (5, lambda q: q + 2, r"boom_joint: angles .*allows -28\.6479 to 68\.7549: give them an offset", 10),
        (5, lambda q: q if next(ROWS) else np.nan, r".*line 101, column boom angle.*is not a number", 10),
    ],
)
def test_what_the_numbers_of_a_log_tell_is_said(place, tmp_path, column, change, note, scale):
    header, *rows = [line.split(",") for line in (place / "move_0.csv").read_text().splitlines()]
    for row in rows:
        row[column] = f"{change(float(row[column])):.6g}"
    made, settings = project(place, tmp_path, "\n".join(",".join(row) for row in (header, *rows)))
    assert len([line for line in made.columns if re.match(note, line)]) == 1
    assert [settings.log.columns("command", j).scale for j in (1, 2, 3)] == [10, -10, scale]


def test_a_joint_that_moves_without_a_command_follows_the_log(place: Path, tmp_path: Path):
    text = (place / "move_0.csv").read_text().replace("stick valve [V]", "torque")
    made, settings = project(place, tmp_path, text)
    assert made.unused == ("torque",)
    assert settings.outputs == (1, 2)
    assert settings.simulation.other_joints == "measured"


def test_the_command_prints_what_it_assumed_and_what_is_next(place: Path, tmp_path: Path):
    robot = write_robot(tmp_path, boom=link("boom", ixx=0, iyy=0, izz=0))
    done = CliRunner().invoke(app, ["init", str(tmp_path / "mine"), "--arm", str(robot)])
    assert done.exit_code == 0
    assert "  link boom: an inertia that no rigid body has: that of its hull is taken\n" in done.output
    assert f"  hydroid fit-hyd LOG.csv --config {tmp_path}/mine/fit.yaml" in done.output
    page = (tmp_path / "mine" / "next-steps.md").read_text()
    assert "- link boom: an inertia" in page
    assert load_arm(tmp_path / "mine" / "arm.yaml").name == "digger"


def test_a_log_may_count_joints_in_its_own_order(place: Path, tmp_path: Path):
    """The log's joint 1 is the arm's boom; an arm's file that one has is used as it is."""
    lines = (place / "move_0.csv").read_text().splitlines()
    order = ["boom", "stick", "swing"]
    columns = lines[0].split(",")
    wanted = [f"{name} {what}" for what in ("valve [V]", "angle [rad]") for name in order]
    at = [0, *(columns.index(name) for name in wanted)]
    rows = [",".join(line.split(",")[k] for k in at) for line in lines[1:]]
    (tmp_path / "log.csv").write_text("\n".join(["t_ms,u1_V,u2_V,u3_V,q1_rad,q2_rad,q3_rad", *rows]))
    arm = place / "mine" / "arm.yaml"
    made = init(tmp_path / "second", arm, [tmp_path / "log.csv"], joints=[f"{name}_joint" for name in order])
    assert made.files == ("arm.png", "fit.yaml", "next-steps.md")
    settings = hydroid.load_settings(tmp_path / "second" / "fit.yaml")
    assert settings.arm == load_arm(arm)
    assert [settings.log.columns("command", j).column for j in (1, 2, 3)] == [("u3_V",), ("u1_V",), ("u2_V",)]
    with pytest.raises(SettingsError, match=r"--joints: no joint 'bom'; the arm's joints: swing_joint, boom"):
        init(tmp_path / "fourth", arm, [tmp_path / "log.csv"], joints=["bom"])
