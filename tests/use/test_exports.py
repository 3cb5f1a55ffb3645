"""What is exported is the plant: each file, read by what it is for, moves as
`load_plant` does."""

import csv
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from made_logs import at_rest, step_log
from made_models import VALUES, made_model

import hydroid
from hydroid import load_settings
from hydroid.errors import HydroidError, ModelError
from hydroid.identified_model import IdentifiedModel
from hydroid.log import write_log
from hydroid.plant import Plant, load_plant
from hydroid.use.tables import speed_tables

URDF = Path(__file__).parents[2] / "examples" / "urdf"


@pytest.fixture(scope="module")
def model() -> IdentifiedModel:
    changes = {"simulation.model": "quasi-static", "outputs": [2, 3]}
    return made_model(VALUES, changes)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return [*csv.DictReader(file)]


def test_a_table_holds_the_settled_speeds(model, tmp_path):
    result = hydroid.export(model, to="table", out=tmp_path)
    assert [Path(file).name for file in result.result] == [
        "speeds_shoulder.csv",
        "speeds_elbow.csv",
    ]
    plant, table = Plant(model), rows(tmp_path / "speeds_shoulder.csv")
    pose = plant.angle
    for row in (table[0], table[7], table[-1]):
        for name, cell in row.items():
            if name != "command_pct":
                pose[1] = np.radians(
                    float(name.removeprefix("deg_per_s_at_").removesuffix("_deg"))
                )
                speed = np.degrees(
                    plant.speeds({"shoulder": float(row["command_pct"])}, at=pose)[1]
                )
                assert float(cell) == pytest.approx(speed, rel=2e-3)


def test_a_table_covers_the_whole_range_of_a_telescope(tmp_path):
    crane = tmp_path / "crane"
    hydroid.init(crane, joints=["swing", "boom", "telescope"], lengths=[0, 6, 6])
    plant = load_plant(str(crane / "fit.yaml"))
    low, high = plant.identified.settings.arm.ranges["telescope"]
    assert high - low > np.pi  # metres
    table = speed_tables(plant)["speeds_telescope.csv"]
    last = table.splitlines()[0].rsplit(",", 1)[-1]
    assert last == f"mm_per_s_at_{1e3 * (low + 0.9 * (high - low)):.4g}_mm"


def test_draws_of_a_fit_are_written_with_ranges_and_errors(tmp_path):
    small = {
        "search.algorithm": "ga",
        "search.ga": {"generations": 3, "population": 12},
    }
    settings = load_settings(
        "fit-mech", {"start_pose": "study", "refinement.iterations": 3} | small
    )
    truth = made_model(VALUES, small, stage="mech")
    log = hydroid.simulate(
        step_log(settings.arm.pose("study"), [60.0, -80.0]), fit=truth, noise_deg=0.1
    ).log
    fitted = hydroid.fit(settings, log)
    drawn = fitted.draw(8, seed=1)
    hydroid.export(fitted, to="parameters", draws=8, seed=1, out=tmp_path)
    table = rows(tmp_path / "draws.csv")
    read = np.array([[float(row[name]) for name in drawn.names] for row in table])
    np.testing.assert_array_equal(read, drawn.theta)
    np.testing.assert_array_equal(hydroid.draw(fitted, 8, seed=1).theta, drawn.theta)
    parameters = settings.parameter_set()
    assert (drawn.theta >= parameters.lower).all()
    assert (drawn.theta <= parameters.upper).all()
    ranges = {row["parameter"]: row["unit"] for row in rows(tmp_path / "ranges.csv")}
    # as the fit has them: a joint that slides, or a rotary actuator, has others
    assert ranges == {n: one.unit for n, one in fitted.summary.estimate.items()}
    (row,) = rows(tmp_path / "errors.csv")
    assert (row["joint"], row["unit"]) == ("shoulder", "deg")
    error = drawn.errors["q2"]
    assert float(row["sensor"]) == pytest.approx(error.sensor_deg)
    assert float(row["drift_per_root_s"]) ** 2 == pytest.approx(error.drift_per_s)
    assert float(row["drift_per_root_way"]) ** 2 == pytest.approx(error.drift_per_way)
    assert "too wide" in (tmp_path / "README.txt").read_text()
    assert drawn.apart > 1.0
    for plant in drawn.plants():
        assert np.isfinite(plant.step({"shoulder": 30})).all()
    np.testing.assert_allclose(
        hydroid.Env(fitted, draws=3).reset(options={"draw": 3})[1]["draw"], 3
    )


def test_a_urdf_comes_back_with_the_masses_and_no_other_change(tmp_path):
    hydroid.init(tmp_path / "mine", arm=URDF / "robot.urdf", log=[URDF / "log_1.csv"])
    plant = load_plant(
        tmp_path / "mine" / "fit.yaml", overrides={"parameters.M_boom.fixed": 150.0}
    )
    names = plant.identified.settings.arm.link_names
    assert plant.masses[names.index("boom")] == 150.0
    hydroid.export(
        plant.identified, to="urdf", robot=URDF / "robot.urdf", out=tmp_path / "out"
    )
    written, own = (
        (tmp_path / "out" / "robot.urdf").read_text(),
        (URDF / "robot.urdf").read_text(),
    )
    changed = [
        pair
        for pair in zip(own.split("\n"), written.split("\n"), strict=True)
        if pair[0] != pair[1]
    ]
    assert all("mass" in before or "i" in before for before, _ in changed)
    spec = mujoco.MjSpec.from_string(own.replace("package://demo_arm", str(URDF)))
    again = mujoco.MjSpec.from_string(written.replace("package://demo_arm", str(URDF)))
    for name, mass in zip(names, plant.masses, strict=True):
        before, after = spec.body(name), again.body(name)
        assert after.mass == pytest.approx(mass)
        np.testing.assert_allclose(
            np.array(after.fullinertia)[:3] / after.mass,
            np.array(before.fullinertia)[:3] / before.mass,
        )
    (tmp_path / "out" / "meshes").symlink_to(URDF / "meshes")
    hydroid.init(
        tmp_path / "again",
        arm=tmp_path / "out" / "robot.urdf",
        log=[URDF / "log_1.csv"],
    )
    back = load_plant(tmp_path / "again" / "fit.yaml")
    np.testing.assert_allclose(back.masses, plant.masses)


LINK = """<link name="{}"><inertial><inertia ixx="{m}" ixy="0" ixz="0" iyy="{m}"
  iyz="0" izz="{m}"/><mass value="{m}"/></inertial>
  <visual><geometry><box size="{} 0.3 0.3"/></geometry></visual></link>"""
JOINT = """<joint name="{0}_joint" type="{kind}"><parent link="{1}"/><child link="{0}"/>
  <origin xyz="{2} 0 0"/><axis xyz="0 -1 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""


def machine(*before: str) -> str:
    """A boom with a tank welded to it and a rod that turns on it and carries nothing, and
    a stick."""
    parts = [
        '<link name="base"/>',
        *before,
        LINK.format("boom", 3, m=300.0),
        LINK.format("tank", 0.5, m=60.0),
        LINK.format("boom_rod", 0.5, m=40.0),
        LINK.format("stick", 2, m=150.0),
        JOINT.format("boom", "base", 0, kind="revolute"),
        JOINT.format("tank", "boom", 1, kind="fixed"),
        JOINT.format("boom_rod", "boom", 1, kind="revolute"),
        JOINT.format("stick", "boom", 3, kind="revolute"),
    ]
    return f"<robot name='two'>{''.join(parts)}</robot>"


@pytest.mark.parametrize(
    "before",
    ["", f"<!-- {LINK.format('boom', 3, m=7.0)} -->", "<link name='idle'/>"],
    ids=["plain", "a link that was commented out", "an empty link before it"],
)
def test_all_links_of_a_urdf_that_are_one_link_of_the_arm_share_its_mass(
    tmp_path: Path, before: str
):
    """The boom's mass is that of the boom, the tank and the rod: written to the boom
    alone, the machine would be 100 kg too heavy."""
    fixed = JOINT.format("idle", "base", 0, kind="fixed") if "idle" in before else ""
    (tmp_path / "robot.urdf").write_text(machine(before, fixed))
    hydroid.init(tmp_path / "mine", arm=tmp_path / "robot.urdf")
    changes = {"parameters.M_boom.fixed": 500.0, "parameters.M_stick.fixed": 100.0}
    plant = load_plant(tmp_path / "mine" / "fit.yaml", overrides=changes)
    hydroid.export(
        plant.identified, to="urdf", robot=tmp_path / "robot.urdf", out=tmp_path / "out"
    )
    text = (tmp_path / "out" / "robot.urdf").read_text()
    links = {
        link.get("name"): link.find("inertial/mass")
        for link in ElementTree.fromstring(text).iter("link")
    }
    masses = {
        name: float(mass.get("value"))
        for name, mass in links.items()
        if mass is not None
    }
    assert masses == pytest.approx(
        {"boom": 375.0, "tank": 75.0, "boom_rod": 50.0, "stick": 100.0}
    )
    assert text.count('ixx="7.0"') == before.count('ixx="7.0"')


def test_a_link_without_a_mass_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    stick = LINK.format("stick", 2, m=150.0)
    text = machine().replace(stick, '<link name="stick"/>')
    (tmp_path / "robot.urdf").write_text(text)
    hydroid.init(tmp_path / "mine", arm=tmp_path / "robot.urdf")
    plant = load_plant(tmp_path / "mine" / "fit.yaml")
    hydroid.export(plant.identified, to="urdf", robot=tmp_path / "robot.urdf")
    assert "robot.urdf: states no mass of stick: the fit's is not" in caplog.text


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            ('value="150.0"', 'value="${m}"'),
            r"link 'stick', mass: value=\"\$\{m\}\" must",
        ),
        (('iyy="150.0"', 'iyy="x309"'), r"link 'stick', inertia: iyy=\"x309\" must be"),
        (('izz="150.0"', 'izz="nan"'), r"link 'stick', inertia: izz=\"nan\" must be"),
    ],
)
def test_a_urdf_whose_masses_are_no_numbers_is_refused(tmp_path: Path, change, says):
    path = tmp_path / "robot.urdf"
    path.write_text(machine())
    hydroid.init(tmp_path / "mine", arm=path)
    plant = load_plant(tmp_path / "mine" / "fit.yaml")
    assert change[0] in machine()
    path.write_text(machine().replace(*change))
    with pytest.raises(ModelError, match=says):
        hydroid.export(plant.identified, to="urdf", robot=path, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_plain_mujoco_moves_the_mjcf_as_the_plant_moves(model, tmp_path):
    """One joint at a time, as its tables are, up to how its valve opens."""
    result = hydroid.export(model, to="mjcf", out=tmp_path)
    assert all(Path(file).exists() for file in result.result)
    time = np.arange(0, 1.5, 0.01)
    command = np.where((time > 0.2) & (time < 1.0), 60.0, 0.0)
    given = tmp_path / "commands.csv"
    lines = "".join(f"{t:.4f},{c:.4f}\n" for t, c in zip(time, command, strict=True))
    given.write_text("time_s,shoulder\n" + lines)
    drive = [sys.executable, str(tmp_path / "model" / "drive.py"), str(given)]
    done = subprocess.run(
        drive, capture_output=True, text=True, check=True, cwd=tmp_path
    )
    found = [float(row["shoulder"]) for row in csv.DictReader(done.stdout.splitlines())]
    plant = Plant(model)
    # a log of the same commands, which begins where the plant does, gives the same
    driven = np.zeros((len(time), len(plant.names)))
    driven[:, 1] = command
    log = at_rest(plant.angle, driven, source="log")
    write_log(tmp_path / "log.csv", log, model.settings.log)
    drive[-1] = str(tmp_path / "log.csv")
    again = subprocess.run(drive, capture_output=True, text=True, check=True)
    assert again.stdout == done.stdout
    (tmp_path / "log.csv").write_text("time_s,q2_deg\n0,0\n")
    refused = subprocess.run(drive, capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert "no column u2_pct, u3_pct: the file needs" in refused.stderr
    expected = [plant.angle[1], *(plant.step({"shoulder": one})[1] for one in command)]
    travel = np.ptp(expected)
    assert travel > 0.05
    assert np.abs(np.array(found) - expected[: len(found)]).max() < 0.05 * travel


def test_an_fmu_steps_as_the_plant_does(model, tmp_path):
    pytest.importorskip("pythonfmu")
    fmpy = pytest.importorskip("fmpy")
    (file,) = hydroid.export(model, to="fmu", out=tmp_path).result
    time = np.arange(0, 1.0, 0.01)
    inputs = np.zeros(
        len(time), dtype=[("time", float), ("u_shoulder", float), ("u_elbow", float)]
    )
    inputs["time"], inputs["u_shoulder"] = time, 50.0 * np.sin(3.0 * time)
    inputs["u_elbow"] = -40.0
    outputs = ["q_shoulder", "q_elbow"]
    found = fmpy.simulate_fmu(
        file,
        input=inputs,
        output=outputs,
        stop_time=0.9,
        step_size=0.01,
        output_interval=0.01,
    )
    plant = Plant(model)
    expected = [plant.angle[[1, 2]]]
    for row in inputs[: len(found) - 1]:
        expected.append(
            plant.step({"shoulder": row["u_shoulder"], "elbow": row["u_elbow"]})[[1, 2]]
        )
    read = np.array([[row[name] for name in outputs] for row in found])
    np.testing.assert_allclose(np.degrees(read), np.degrees(expected), atol=1e-6)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"to": "simulink"}, "choose parameters, table"),
        ({"to": "urdf"}, "--robot robot.urdf"),
        ({"to": "urdf", "robot": "no.urdf"}, r"no\.urdf"),
        ({"to": "urdf", "robot": "other.urdf"}, "none of the links"),
        ({"to": "linear"}, "no joint has a command: around 0 is the dead band"),
        ({"to": "linear", "at": "boom=3"}, "no joint 'boom'"),
        ({"to": "linear", "at": "shoulder=x"}, "is no command"),
        ({"to": "linear", "at": "shoulder=nan"}, "is nan %; allowed are -100 to 100"),
        ({"to": "linear", "at": "shoulder=-400"}, "is -400 %; allowed are -100 to"),
        (
            {"to": "linear", "at": "shoulder=40,elbow=3,shoulder=-40"},
            "shoulder has two commands",
        ),
        (
            {"to": "linear", "at": "roll=30"},
            "roll takes no commands; those of shoulder and elbow count",
        ),
        ({"to": "table", "pose": "nowhere"}, "no pose"),
        ({"to": "parameters"}, "no covariance"),
    ],
)
def test_what_cannot_be_exported_is_one_line(
    model, options, says, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("other.urdf").write_text("<robot name='x'><link name='y'/></robot>")
    with pytest.raises(HydroidError, match=says):
        hydroid.export(model, out=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("out", "says"),
    [
        (".", "would overwrite your robot's file"),
        ("new.urdf", "is a file's name, and files go to a folder; name the folder"),
    ],
)
def test_an_export_is_no_users_file(model, out, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("robot.urdf").write_text("mine")
    with pytest.raises(HydroidError, match=says):
        hydroid.export(model, to="urdf", robot="robot.urdf", out=out)
    assert Path("robot.urdf").read_text() == "mine"
    assert [*map(str, Path().iterdir())] == ["robot.urdf"]
