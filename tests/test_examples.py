"""The examples run as they stand, and are what they say; the benchmarks can be
imported."""

import glob
import json
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from log_files import halve
from typer.testing import CliRunner

import hydroid
from hydroid.commands.app import app
from hydroid.viewer import PLATFORMS, renders

EXAMPLES = Path(__file__).parents[1] / "examples"


SHORT = [
    "--set",
    "search.multistart={starts: 1, horizons: [], iterations: 1}",
    "--no-refinement",
]
"""for a fit: as the README has it, but for a step only"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Runs on an arm other than the shipped one, with other poses, joints and
    ranges."""
    folder, boom = tmp_path_factory.mktemp("runs"), EXAMPLES / "boom"
    log, config = str(boom / "fit_up_60.csv"), str(boom / "fit.yaml")
    command = [
        "fit-hyd",
        log,
        "--config",
        config,
        *SHORT,
        "--out",
        str(folder / "boom"),
    ]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    return {"shipped": Path("article-hyd"), "boom": folder / "boom"}


def example(name: str, *words: object) -> str:
    """What an example of this name prints."""
    command = [sys.executable, str(EXAMPLES / name), *map(str, words)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize(
    ("name", "joint", "target"),
    [("shipped", "shoulder", 60.0), ("boom", "boom", 41.25)],
)
def test_the_controller_brings_a_joint_of_any_run_to_its_target(
    name, joint, target, runs
):
    printed = example("pid.py", runs[name])
    found = re.match(
        rf"{joint} after 10 s: ([\d.]+) deg of {target:.2f}\ngain .* rms error ([\d.]+) deg",
        printed,
    )
    assert found, printed
    assert float(found[1]) == pytest.approx(target, abs=0.5)
    assert float(found[2]) < 1.0  # along the whole path
    assert ("on 5 draws" in printed) == (name == "boom")


@pytest.mark.parametrize(("name", "joint"), [("shipped", "shoulder"), ("boom", "boom")])
def test_the_policy_of_the_environment_works_on_any_run(name, joint, runs):
    pytest.importorskip("gymnasium")
    printed = example("gym_env.py", runs[name])
    found = re.fullmatch(
        rf"error of {joint} after 5 s \[half ranges\]: \[(.*)\]\n", printed
    )
    assert found, printed
    errors = [float(one) for one in found[1].split(",")]
    # the fit's own estimate; draws of a short fit may be too weak
    assert errors[0] < 0.1
    assert np.median(errors) < 0.1


def test_a_path_of_the_tip_starts_where_the_fitted_log_begins(runs, tmp_path: Path):
    """Not in the arm's home pose, in which no machine may ever have stood; unless the
    user says so."""
    path = tmp_path / "still.csv"
    path.write_text("time_s,dx_m,dy_m,dz_m\n0,0,0,0\n1,0,0,0\n")
    (log,) = hydroid.read_logs(
        [EXAMPLES / "boom" / "fit_up_60.csv"],
        hydroid.load_settings(EXAMPLES / "boom" / "fit.yaml"),
    )
    for changes, expected in (({}, log.start[0]), ({"start_pose": "home"}, 0.0)):
        found = hydroid.follow(path, fit=runs["boom"], set=changes).result
        np.testing.assert_allclose(found.log.angle[:, 0], expected, atol=1e-4)


class Topics:
    """A stub of rclpy's node: it keeps what is made and published."""

    def __init__(self) -> None:
        self.published, self.calls, self.warnings = [], {}, []

    def create_publisher(self, _, topic, __):
        return SimpleNamespace(
            publish=lambda state: self.published.append((topic, state))
        )

    def create_subscription(self, _, topic, call, __):
        self.calls[topic] = call

    def create_timer(self, period, call):
        self.calls["timer"], self.period = call, period

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: "now"))


def test_the_ros_node_is_the_plant_between_two_topics(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import ros2_node  # pyright: ignore[reportMissingImports]

    topics, plants = Topics(), [hydroid.load_plant("article-hyd") for _ in range(2)]
    ros2_node.ArmNode(
        topics, lambda: SimpleNamespace(header=SimpleNamespace()), plants[0]
    )
    assert topics.period == plants[0].period
    for value in (50.0, -30.0):
        topics.calls["command"](
            SimpleNamespace(name=["shoulder", "bucket"], effort=[value, 1.0])
        )
        for _ in range(5):
            topics.calls["timer"]()
            expected = plants[1].step({"shoulder": value})
            topic, state = topics.published[-1]
            assert (topic, state.header.stamp) == ("joint_states", "now")
            assert state.name == [*plants[1].names]
            np.testing.assert_array_equal(state.position, expected)
    assert len(topics.warnings) == 2
    assert "bucket takes no command" in topics.warnings[0]


def test_a_run_is_drawn_without_a_display_or_a_setting(runs, tmp_path: Path):
    """In a process that has imported nothing yet, as a user's."""
    if not any(map(renders, PLATFORMS)):
        pytest.skip("this machine has no OpenGL without a display")
    unset = ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY", "PYOPENGL_PLATFORM")
    environment = {
        name: value for name, value in os.environ.items() if name not in unset
    }
    environment["PYTHONPATH"] = str(EXAMPLES.parent)
    picture = tmp_path / "arm.png"
    command = [
        sys.executable,
        "-m",
        "hydroid",
        "view",
        str(runs["boom"]),
        "-o",
        str(picture),
    ]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_notebook_goes_from_a_log_to_the_arm(monkeypatch: pytest.MonkeyPatch):
    """Its cells, one after the other, as Jupyter runs them; what a cell ends with shows
    itself."""
    import matplotlib as mpl

    mpl.use("agg")
    monkeypatch.chdir(EXAMPLES)
    before, names = sorted(EXAMPLES.iterdir()), dict[str, Any]()
    for cell in json.loads((EXAMPLES / "notebook.ipynb").read_text())["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert sorted(EXAMPLES.iterdir()) == before  # nothing is written
    assert names["fit"].summary.rms_deg < 0.5
    assert "shoulder" in names["fit"]._repr_html_()
    assert np.degrees(names["shoulder"]) == pytest.approx(20, abs=1)


def commands(readme: Path) -> list[list[str]]:
    """The hydroid commands of a README, with its patterns expanded."""
    (block,) = re.findall(
        r"```sh\n(.*?)```", readme.read_text(encoding="utf-8"), re.DOTALL
    )
    found: list[list[str]] = []
    for line in block.splitlines():
        if line.startswith("hydroid "):
            words = shlex.split(line)[1:]
            found.append(
                [
                    f
                    for word in words
                    for f in (sorted(glob.glob(word)) if "*" in word else [word])
                ]
            )
    return found


@pytest.mark.parametrize(
    ("name", "place", "count"), [("boom", ".", 3), ("urdf", "examples/urdf", 4)]
)
def test_the_readmes_commands_run(
    name: str, place: str, count: int, tmp_path: Path, monkeypatch
):
    copy = tmp_path / "examples" / name
    shutil.copytree(EXAMPLES / name, copy, ignore=shutil.ignore_patterns("mine"))
    for log in copy.glob("*.csv"):
        halve(log)
    monkeypatch.chdir(tmp_path / place)
    run = commands(copy / "README.md")
    assert len(run) == count
    for words in run:
        done = CliRunner().invoke(
            app, [*words, *(SHORT if words[0].startswith("fit-") else [])]
        )
        assert done.exit_code == 0, (words, done.output[-2000:], done.exception)


def test_the_urdf_and_its_meshes_are_what_the_script_makes():
    script = runpy.run_path(str(EXAMPLES / "urdf" / "make_example.py"))
    assert (EXAMPLES / "urdf" / "robot.urdf").read_text(encoding="utf-8") == script[
        "urdf"
    ]()
    for name in script["SIZES"]:
        assert (EXAMPLES / "urdf" / "meshes" / f"{name}.stl").read_bytes() == script[
            "mesh"
        ](name)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("boom", "**Virtual.**"),
        ("urdf", "**No machine.**"),
        ("excavator", "EfficientTrack"),
        ("excavator", "geometry is ours"),
    ],
)
def test_what_is_made_up_is_called_so(name: str, words: str):
    assert words in " ".join(
        (EXAMPLES / name / "README.md").read_text(encoding="utf-8").split()
    )


def test_all_logs_of_the_excavator_are_read_without_repair_and_its_boom_rises_as_its_rod_runs_out(
    caplog,
):
    files = sorted((EXAMPLES / "excavator").glob("*_*.csv"))
    assert len(files) == 18
    logs = hydroid.read_logs(
        files, hydroid.load_settings(EXAMPLES / "excavator" / "fit.yaml")
    )
    assert all(log.driven.all() and log.has_angle.all() for log in logs)
    assert {log.period for log in logs} == {0.05}
    assert "moves against" not in caplog.text


def test_every_benchmark_can_be_imported():
    """From its own folder, as `make` runs it."""
    folder = EXAMPLES.parent / "benchmarks"
    names = sorted({file.stem for file in folder.glob("*.py")})
    assert names
    program = f"import importlib\nfor name in {names}: importlib.import_module(name)"
    subprocess.run([sys.executable, "-c", program], cwd=folder, check=True)
