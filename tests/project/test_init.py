"""A project out of an arm's CAD and a log: it runs, says what it assumed, and
overwrites nothing."""

import json
import re
import runpy
import shutil
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import robots
from arms import MODELS
from log_files import halve
from robots import LIMIT, link, write_robot
from typer.testing import CliRunner

import hydroid
from hydroid.commands.app import app
from hydroid.errors import LogError, ModelError, SettingsError
from hydroid.log import open_table
from hydroid.project.project import Project
from hydroid.project.section import simulation_period
from hydroid.settings.arm import load_arm
from hydroid.settings.cylinder import LinearActuator
from hydroid.settings.fit import FitSettings
from hydroid.settings.log import LogSettings

URDF = Path(__file__).parents[2] / "examples" / "urdf"
EXAMPLE = runpy.run_path(str(URDF / "make_example.py"))
"""how it simulates a machine like a project's, its boom's valve wired the other way
round"""
pytestmark = pytest.mark.usefixtures("no_picture")


def init(
    folder: Path, arm: Path | None = None, logs: list[Path] | None = None, **more: Any
) -> Project:
    return hydroid.init(folder, arm=arm, log=logs, **more).result


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a URDF, three logs of a machine like it, and a project `mine` of
    all."""
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
    """Valves sized by the arm's weight and the log's speeds are within a factor of 2.5
    of the truth's."""
    first = hydroid.load_settings(place / "machine" / "fit.yaml").parameters
    second = hydroid.load_settings(place / "mine" / "fit.yaml")
    assert set(first) == set(second.parameters)
    openings = [joint.actuator.max_opening for joint in second.arm.joints]
    true = [
        joint.actuator.max_opening
        for joint in load_arm(place / "machine" / "arm.yaml").joints
    ]
    assert np.all(np.abs(np.log(np.array(openings) / true)) < np.log(2.5))


def test_a_joint_that_seldom_moves_is_sized_by_how_fast_it_moves(
    place: Path, tmp_path: Path
):
    """Of its log, nearly all is rest; draws and openings are those of the log without."""

    def rests(rows: list[list[str]]) -> None:
        last = rows[-1]
        for k in range(1, 30 * len(rows)):
            still = [
                cell if "angle" in name else "0"
                for name, cell in zip(rows[0], last, strict=True)
            ]
            rows.append([f"{float(last[0]) + 20 * k:g}", *still[1:]])

    log = renamed(place, tmp_path / "log.csv", rests)
    arm = place / "mine" / "arm.yaml"
    init(tmp_path / "rests", arm, [log])
    init(tmp_path / "moves", arm, [place / "move_0.csv"])
    rested, moved = (
        hydroid.load_settings(tmp_path / name / "fit.yaml").parameters
        for name in ("rests", "moves")
    )
    for joint in ("swing", "boom", "stick"):
        draws = (one[f"draw_A_{joint}"].nominal for one in (rested, moved))
        assert next(draws) == pytest.approx(next(draws), rel=0.3)
        dampings = (one[f"D_{joint}"].sd for one in (rested, moved))
        assert next(dampings) == pytest.approx(next(dampings), rel=0.3)


def test_a_log_whose_commands_count_the_other_way_is_named(place: Path, tmp_path: Path):
    def turned(rows: list[list[str]]) -> None:
        column = rows[0].index("stick valve [V]")
        for row in rows[1:]:
            row[column] = f"{-float(row[column]):g}"

    other = renamed(place, tmp_path / "turned.csv", turned)
    arm = place / "mine" / "arm.yaml"
    logs = [place / "move_1.csv", other, place / "move_2.csv"]
    made = init(tmp_path / "mine", arm, logs)
    (said,) = [line for line in made.columns if "turns by its command" in line]
    assert said.startswith("stick_joint turns by its command the other way in ")
    assert "turned.csv" in said
    assert "move_1.csv" in said
    alike = init(tmp_path / "alike", arm, [place / "move_0.csv", place / "move_1.csv"])
    assert not any("turns by its command" in line for line in alike.columns)


@pytest.mark.parametrize("lever", [0.0, 0.03])
def test_a_joint_that_stands_in_the_first_log_is_read_by_the_others(
    lever: float, place: Path, tmp_path: Path
):
    """What its command is in, and which way it turns, only another log tells; its lever
    may be noisy at rest [V]."""

    def boom_stands(rows: list[list[str]]) -> None:
        command, angle = (
            rows[0].index(f"boom {what}") for what in ("valve [V]", "angle [rad]")
        )
        noise = lever * np.random.default_rng(0).normal(size=len(rows))
        for row, volts in zip(rows[1:], noise, strict=False):
            row[command], row[angle] = f"{volts:.4f}", rows[1][angle]

    first = renamed(place, tmp_path / "log.csv", boom_stands)
    made = init(
        tmp_path / "mine",
        place / "mine" / "arm.yaml",
        [first, place / "move_1.csv", place / "move_2.csv"],
    )
    boom = hydroid.load_settings(tmp_path / "mine" / "fit.yaml").log.columns(
        "command", 2
    )
    assert boom.scale == -10
    assert any("boom_joint moves against its command" in line for line in made.columns)


def test_each_side_of_a_valve_starts_where_the_logs_show_it(place: Path):
    """The machine's valves have dead bands of 20 and 30 %; the boom's is wired the
    other way round."""
    settings = hydroid.load_settings(place / "mine" / "fit.yaml")
    for joint in ("swing", "boom", "stick"):
        a, b = (settings.parameters[f"dead_{side}_{joint}"].nominal for side in "AB")
        assert (a, b) == pytest.approx((20, 30), abs=5), joint
        assert settings.priors[f"dead_{joint}"].tails == "heavy"
        assert settings.priors[f"curve_A_{joint}"].smooth is not None
        assert settings.terms_of(settings.outputs[0]) == ("curve_swing", "oil")


@pytest.mark.usefixtures("short_searches")
def test_a_valve_that_is_open_or_shut_gets_no_curve(place: Path, tmp_path: Path):
    table = np.genfromtxt(
        place / "move_0.csv", delimiter=",", names=True, deletechars=""
    )
    names = (place / "move_0.csv").read_text().splitlines()[0]
    rows = np.array([list(row) for row in table])
    for column, name in enumerate(names.split(",")):
        if "valve" in name or "command" in name:
            rows[:, column] = (
                np.sign(rows[:, column]) * (np.abs(rows[:, column]) > 0) * 10
            )
    np.savetxt(tmp_path / "switched.csv", rows, "%.8g", ",", header=names, comments="")
    init(tmp_path / "mine", write_robot(tmp_path), [tmp_path / "switched.csv"])
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    named = set(settings.parameters)
    assert {"open_A_boom", "open_B_boom", "dead_A_boom"} <= named
    assert not {
        name for name in named if name.startswith(("curve_A_boom", "exponent_A_boom"))
    }
    assert "exponent_boom" not in settings.priors


@pytest.mark.slow
def test_from_cad_and_log_to_a_validated_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Every command of the next steps, as they stand; the last log was not fitted."""
    shutil.copytree(URDF, tmp_path / "urdf")
    for log in (tmp_path / "urdf").glob("log_*.csv"):
        halve(log)
    monkeypatch.chdir(tmp_path / "urdf")
    command = ["init", "new", "--arm", "robot.urdf", "--json"]
    for name in sorted(Path().glob("log_*.csv")):
        command += ["--log", str(name)]
    done = CliRunner().invoke(app, command)
    steps = json.loads(done.stdout)["commands"]
    assert [step.split()[1] for step in steps] == [
        "check",
        "fit-hyd",
        "validate",
        "suggest",
    ]
    for step in steps[:3]:
        done = CliRunner().invoke(app, [*step.split()[1:], "--json"])
        assert done.exit_code == 0, done.output
    results = json.loads(done.stdout)["results"]
    errors = [result["mae_deg"] for result in results]
    assert len(errors) == 3
    assert max(errors) < 0.5


def test_nothing_is_overwritten(place: Path):
    before = {path: path.read_bytes() for path in (place / "mine").glob("*.*")}
    with pytest.raises(
        SettingsError, match=r"mine: holds arm\.yaml already; name another folder, or"
    ):
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
    assert {path.name for path in (tmp_path / "mine").iterdir()} == {
        *again.files,
        "notes.txt",
    }


@pytest.mark.parametrize(
    ("between", "period"),
    [(0.001, 0.02), (0.01, 0.02), (0.02, 0.02), (0.05, 0.05), (0.1, 0.05), (0.2, 0.05)],
)
def test_a_fit_simulates_every_sample_of_a_log_that_is_not_quick(
    tmp_path: Path, between: float, period: float
) -> None:
    log = tmp_path / "a.csv"
    rows = between * np.arange(50)
    np.savetxt(
        log, np.stack([rows, rows], 1), "%.6g", ",", header="time_s,q1_deg", comments=""
    )
    settings = LogSettings.model_validate({"time": {"column": "time_s", "unit": "s"}})
    assert simulation_period(open_table(log), settings) == pytest.approx(period)


@pytest.mark.usefixtures("short_searches")
def test_a_telescopes_column_is_its_own(tmp_path: Path):
    """Columns in m go to the joint that slides; a bucket that nothing names is asked
    for."""
    telescope = {
        "kind": "prismatic",
        "at": "2 0 0",
        "axis": "1 0 0",
        "limit": LIMIT.format(0, 1.5),
    }
    robot = write_robot(
        tmp_path, stick_joint=robots.joint("telescope", "boom", "stick", **telescope)
    )
    time = np.arange(0, 20, 0.02)
    drive = 60 * np.sign(np.sin(time)) * (time > 1)
    way = np.cumsum(0.02 * np.roll(drive, 5)) / 100
    columns = {
        "t": time,
        "slew_V": drive / 10,
        "boom_V": drive / 10,
        "tele_V": drive / 10,
        "u9": drive,
    }
    columns |= {
        "slew_deg": 30 * way,
        "boom_deg": 20 * way,
        "tele_length_m": 0.3 + 0.4 * way,
    }
    rows = np.stack([*columns.values()], 1)
    np.savetxt(
        tmp_path / "a.csv", rows, "%.6g", ",", header=",".join(columns), comments=""
    )
    made = init(tmp_path / "mine", robot, [tmp_path / "a.csv"])
    settings = hydroid.load_settings(tmp_path / "mine" / "fit.yaml")
    assert settings.log.columns("angle", 3).column == ("tele_length_m",)
    assert settings.log.columns("angle", 3).unit == "m"
    assert settings.log.columns("command", 3).column == ("tele_V",)
    assert "tele_length_m: position in m of telescope, by its name" in made.columns
    assert any(
        line.startswith("left out, though like a joint's command: u9")
        for line in made.columns
    )
    (log,) = hydroid.read_logs(tmp_path / "a.csv", settings)
    wanted = 0.3 + 0.4 * np.interp(log.time, time, way)
    np.testing.assert_allclose(log.angle[:, 2], wanted, atol=1e-4)
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


COLUMNS = dict(zip("abcdefg", ("time", *["command"] * 3, *["angle"] * 3), strict=True))


def renamed(
    place: Path, log: Path, change: Callable[[list[list[str]]], object]
) -> Path:
    """Write a log of the machine with cells changed."""
    rows = [line.split(",") for line in (place / "move_0.csv").read_text().splitlines()]
    change(rows)
    log.write_text("\n".join(",".join(row) for row in rows))
    return log


def named_by_letters(rows: list[list[str]]) -> None:
    rows[0] = [*COLUMNS]


def without_commands(rows: list[list[str]]) -> None:
    rows[0] = [name.replace("valve [V]", "what") for name in rows[0]]


def fill_in(path: Path, joints: Sequence[str]) -> None:
    """Complete the skeleton as a person does who knows that b to d are valves [V], e to
    g angles [rad]."""
    before, mark, rest = path.read_text().partition("# log:")
    section, end, after = rest.partition("\n\n")
    section = "\n".join(
        line.removeprefix("# ") for line in (mark + section).splitlines()
    )
    section = section.replace("TIME, unit: s", "a, unit: ms")
    for joint, command, angle in zip(joints, "bcd", "efg", strict=True):
        entry = f"{{command: {{column: {command}, scale: 10}}, angle: {{column: {angle}, unit: rad}}}}"
        section = re.sub(rf"{joint}: .*", f"{joint}: {entry}", section)
    path.write_text(before + section + end + after)


@pytest.mark.usefixtures("short_searches")
def test_a_log_of_unknown_columns_gets_a_skeleton_and_goes_on_from_there(
    place: Path, tmp_path: Path
):
    """The settings are then those of a log whose columns `init` knows, from start to
    start."""
    log = renamed(place, tmp_path / "log.csv", named_by_letters)
    mine, robot = tmp_path / "mine", place / "digger/urdf/digger.urdf"
    done = CliRunner().invoke(
        app, ["init", str(mine), "--arm", str(robot), "--log", str(log)]
    )
    assert done.exit_code == 2
    assert (
        "The log cannot be fitted yet: no column looks like a time. Complete the log section"
        in done.output
    )
    (again,) = re.findall(r"^  hydroid (init --config .*)$", done.output, re.MULTILINE)
    text = (mine / "fit.yaml").read_text()
    for name, kind in COLUMNS.items():
        assert re.search(rf"^#   {name}: .* to .*; .*{kind} in", text, re.MULTILINE)
    with pytest.raises(
        SettingsError,
        match=r"fit\.yaml: has no log section; name the log's columns there",
    ):
        hydroid.init(config=mine / "fit.yaml", log=log)
    fill_in(mine / "fit.yaml", load_arm(mine / "arm.yaml").joint_names)
    filled, arm = (mine / "fit.yaml").read_text(), (mine / "arm.yaml").read_bytes()
    done = CliRunner().invoke(app, again.split())
    assert done.exit_code == 0, done.output
    assert (mine / "fit.old.yaml").read_text() == filled
    assert (mine / "arm.yaml").read_bytes() == arm
    init(tmp_path / "known", robot, [place / "move_0.csv"])
    found, known = (
        hydroid.load_settings(tmp_path / name / "fit.yaml")
        for name in ("mine", "known")
    )
    assert found.outputs == known.outputs
    for joint in found.outputs:
        assert (
            found.log.columns("command", joint).scale
            == known.log.columns("command", joint).scale
        )
    starts = [
        {
            one.name: (one.lower, one.upper)
            for one in settings.parameter_set().parameters
        }
        for settings in (found, known)
    ]
    assert {*starts[0]} == {*starts[1]}
    for name, values in starts[0].items():
        assert values == pytest.approx(starts[1][name], rel=0.02), name


def test_a_log_without_commands_is_no_log_to_fit(place: Path, tmp_path: Path):
    log = renamed(place, tmp_path / "log.csv", without_commands)
    done = hydroid.init(
        tmp_path / "mine", arm=place / "digger/urdf/digger.urdf", log=log
    )
    assert done.exit_status == 2
    assert done.result.missing == "no column looks like a command"
    assert [step.split()[1] for step in done.result.commands] == ["init"]
    text = (tmp_path / "mine/fit.yaml").read_text()
    assert (
        "#     boom_joint: {command: {column: COMMAND, scale: 1}, angle: {column: 'boom angle [rad]'"
        in text
    )


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (slice(1, 4), "no joint is driven and moves: no command is ever given"),
        (
            slice(4, 7),
            "no joint is driven and moves: swing_joint, boom_joint and stick_joint driven, but nothing",
        ),
    ],
)
def test_a_log_in_which_nothing_is_driven_and_moves_is_refused(
    place, tmp_path, columns, message
):
    def still(rows: list[list[str]]) -> None:
        for row in rows[2:]:
            row[columns] = rows[1][columns] if columns.start == 4 else ["0"] * 3
        rows[1][columns] = rows[2][columns]

    log = renamed(place, tmp_path / "log.csv", still)
    with pytest.raises(LogError, match=message):
        init(tmp_path / "mine", place / "digger/urdf/digger.urdf", [log])
    assert not (tmp_path / "mine").exists()


def test_commands_that_are_the_noise_of_a_lever_are_refused(place, tmp_path):
    def small(rows: list[list[str]]) -> None:
        largest = max(abs(float(cell)) for row in rows[1:] for cell in row[1:4])
        for row in rows[1:]:
            row[1:4] = [f"{1.5 * float(cell) / largest:.4f}" for cell in row[1:4]]
        rows[0][1:4] = ["swing_pct", "boom_pct", "stick_pct"]

    log = renamed(place, tmp_path / "log.csv", small)
    says = (
        r"log.csv: no joint is driven and moves: the largest command is 1\.5 %, .*scale"
    )
    with pytest.raises(LogError, match=says):
        init(tmp_path / "mine", place / "digger/urdf/digger.urdf", [log])
    assert not (tmp_path / "mine").exists()


@pytest.mark.usefixtures("short_searches")
def test_a_joint_that_no_fitted_log_drives_is_not_compared(place: Path, tmp_path: Path):
    def only_the_boom(rows: list[list[str]]) -> None:
        for row in rows[1:]:
            row[1] = row[3] = "0"

    def not_the_swing(rows: list[list[str]]) -> None:
        for row in rows[1:]:
            row[1] = "0"

    boom = renamed(place, tmp_path / "boom.csv", only_the_boom)
    both = renamed(place, tmp_path / "both.csv", not_the_swing)
    arm = place / "mine" / "arm.yaml"
    made = init(tmp_path / "one", arm, [boom])
    assert hydroid.load_settings(tmp_path / "one/fit.yaml").outputs == (2,)
    assert (
        "swing_joint and stick_joint: no command in the logs that are fitted, so not compared"
        in made.columns
    )
    init(tmp_path / "two", arm, [boom, both, place / "move_1.csv"])
    assert hydroid.load_settings(tmp_path / "two/fit.yaml").outputs == (2, 3)


def test_a_joint_without_an_angle_is_named_with_what_becomes_of_it(
    place: Path, tmp_path: Path
):
    def no_stick(rows: list[list[str]]) -> None:
        for row in rows:
            del row[-1]

    log = renamed(place, tmp_path / "log.csv", no_stick)
    made = init(tmp_path / "mine", place / "mine" / "arm.yaml", [log])
    assert (
        made.missing,
        hydroid.load_settings(tmp_path / "mine/fit.yaml").outputs,
    ) == (
        "",
        (1, 2),
    )
    (said,) = [line for line in made.columns if "no angle found" in line]
    assert "stick_joint: simulated by the command, and compared with nothing" in said


def test_a_log_without_rows_is_told_that_it_has_none(place: Path, tmp_path: Path):
    def without_rows(rows: list[list[str]]) -> None:
        del rows[1:]

    log = renamed(place, tmp_path / "log.csv", without_rows)
    with pytest.raises(LogError, match="no rows of numbers follow"):
        hydroid.init(tmp_path / "mine", arm=place / "mine" / "arm.yaml", log=log)
    assert not (tmp_path / "mine").exists()


def test_a_log_that_must_be_mended_first_is_no_success(place: Path, tmp_path: Path):
    def backwards(rows: list[list[str]]) -> None:
        rows[1:] = rows[:0:-1]

    log = renamed(place, tmp_path / "log.csv", backwards)
    arguments = [
        "init",
        f"{tmp_path / 'mine'}",
        "--arm",
        f"{place / 'mine' / 'arm.yaml'}",
    ]
    done = CliRunner().invoke(app, [*arguments, "--log", f"{log}"])
    assert done.exit_code == 2
    assert "the log cannot be used as it is" in done.output
    assert "time does not increase" in done.output
    assert "Next: mend the log" in done.output
    assert "repeat init with --force" in done.output


def test_an_error_names_no_file_that_is_gone(tmp_path: Path):
    robot = MODELS / "bad_arms/inf_origin.urdf"
    done = CliRunner().invoke(
        app, ["init", str(tmp_path / "mine"), "--arm", str(robot)]
    )
    assert isinstance(done.exception, ModelError)
    assert ".hydroid-init-" not in str(done.exception)
    assert list(tmp_path.iterdir()) == []


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
    made = init(
        folder / "mine", place / "digger/urdf/digger.urdf", [folder / "log.csv"]
    )
    return made, hydroid.load_settings(folder / "mine" / "fit.yaml")


ROWS = count(-99)
"""0 at the hundredth"""


@pytest.mark.usefixtures("short_searches")
@pytest.mark.parametrize(
    ("column", "change", "note", "scale"),
    [
        (
            3,
            lambda u: -u,
            r"stick_joint moves against its command \(on \d+% of its way\): the command's sign",
            -10,
        ),
        (
            5,
            lambda q: q + 2,
            r"boom_joint: angles .*allows -28\.6479 to 68\.7549: correct their scale",
            10,
        ),
        (
            5,
            lambda q: q if next(ROWS) else np.nan,
            r".*line 101, column boom angle.*is not a number",
            10,
        ),
    ],
)
def test_what_the_numbers_of_a_log_tell_is_said(
    place, tmp_path, column, change, note, scale
):
    header, *rows = [
        line.split(",") for line in (place / "move_0.csv").read_text().splitlines()
    ]
    for row in rows:
        row[column] = f"{change(float(row[column])):.6g}"
    made, settings = project(
        place, tmp_path, "\n".join(",".join(row) for row in (header, *rows))
    )
    assert len([line for line in made.columns if re.match(note, line)]) == 1
    assert [settings.log.columns("command", j).scale for j in (1, 2, 3)] == [
        10,
        -10,
        scale,
    ]


@pytest.mark.usefixtures("short_searches")
def test_a_joint_that_moves_without_a_command_follows_the_log(
    place: Path, tmp_path: Path
):
    text = (place / "move_0.csv").read_text().replace("stick valve [V]", "torque")
    made, settings = project(place, tmp_path, text)
    assert made.unused == ("torque",)
    assert settings.outputs == (1, 2)
    assert settings.simulation.other_joints == "measured"


def test_the_command_prints_what_it_assumed_and_what_is_next(
    place: Path, tmp_path: Path
):
    robot = write_robot(tmp_path, boom=link("boom", ixx=0, iyy=0, izz=0))
    done = CliRunner().invoke(
        app, ["init", str(tmp_path / "mine"), "--arm", str(robot)]
    )
    assert done.exit_code == 0
    assert (
        "  link boom: an inertia that no rigid body has: that of its hull is taken\n"
        in done.output
    )
    assert f"  hydroid fit-hyd LOG.csv --config {tmp_path}/mine/fit.yaml" in done.output
    page = (tmp_path / "mine" / "next-steps.md").read_text()
    assert "- link boom: an inertia" in page
    assert load_arm(tmp_path / "mine" / "arm.yaml").name == "digger"


@pytest.mark.usefixtures("short_searches")
def test_a_log_may_count_joints_in_its_own_order(place: Path, tmp_path: Path):
    """The log's joint 1 is the arm's boom; an arm's file that one has is used as it
    is."""
    lines = (place / "move_0.csv").read_text().splitlines()
    order = ["boom", "stick", "swing"]
    columns = lines[0].split(",")
    wanted = [
        f"{name} {what}" for what in ("valve [V]", "angle [rad]") for name in order
    ]
    at = [0, *(columns.index(name) for name in wanted)]
    rows = [",".join(line.split(",")[k] for k in at) for line in lines[1:]]
    (tmp_path / "log.csv").write_text(
        "\n".join(["t_ms,u1_V,u2_V,u3_V,q1_rad,q2_rad,q3_rad", *rows])
    )
    arm = place / "mine" / "arm.yaml"
    made = init(
        tmp_path / "second",
        arm,
        [tmp_path / "log.csv"],
        joints=[f"{name}_joint" for name in order],
    )
    assert made.files == ("arm.png", "fit.yaml", "next-steps.md")
    settings = hydroid.load_settings(tmp_path / "second" / "fit.yaml")
    assert settings.arm == load_arm(arm)
    assert [settings.log.columns("command", j).column for j in (1, 2, 3)] == [
        ("u3_V",),
        ("u1_V",),
        ("u2_V",),
    ]
    init(tmp_path / "third", arm, [tmp_path / "log.csv"], joints=["2", "3", "1"])
    by_number = hydroid.load_settings(tmp_path / "third" / "fit.yaml")
    assert by_number.log == settings.log


@pytest.mark.parametrize(
    ("joints", "fault"),
    [
        ("bom", "no joint 'bom'; the arm's joints: swing_joint, boom"),
        ("0", "no joint '0'; the arm's joints: swing_joint, boom"),
        ("4", "no joint '4'"),
        ("9" * 5000, "no joint '9"),
        ("boom_joint,boom_joint", "joint 'boom_joint' occurs twice"),
        ("boom_joint,2", "joint '2' occurs twice"),
    ],
)
def test_what_is_no_joint_of_the_arm_is_refused(
    place: Path, tmp_path: Path, joints: str, fault: str
):
    arm = place / "mine" / "arm.yaml"
    with pytest.raises(SettingsError, match=f"--joints: {fault}"):
        init(tmp_path / "mine", arm, [place / "move_0.csv"], joints=joints.split(","))
    assert not (tmp_path / "mine").exists()
