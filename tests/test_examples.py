"""The examples run as they stand, and are what they say; the benchmarks can be imported."""

import glob
import json
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import hydroid
from hydroid.commands.app import app

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture
def gym_env(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("gymnasium")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import gym_env  # pyright: ignore[reportMissingImports]

    return gym_env


def test_the_controller_brings_the_shoulder_to_its_target():
    command, how = [sys.executable, str(EXAMPLES / "pid.py")], {"capture_output": True, "text": True}
    done = subprocess.run(command, check=True, cwd=EXAMPLES.parent, **how)
    found = re.search(r"after 10 s: ([\d.]+) deg of 30", done.stdout)
    assert found
    assert float(found[1]) == pytest.approx(30.0, abs=0.3)


def test_the_environment_passes_gymnasiums_own_check(gym_env):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym_env.ShoulderEnv(), skip_render_check=True)


def test_the_notebook_goes_from_a_log_to_the_arm(monkeypatch: pytest.MonkeyPatch):
    """Its cells, one after the other, as Jupyter runs them; what a cell ends with shows itself."""
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


SHORT = ["--set", "search.multistart={starts: 1, horizons: [], iterations: 1}", "--no-refinement"]
"""for a fit: as the README has it, but for a step only"""


def commands(readme: Path) -> list[list[str]]:
    """The hydroid commands of a README, with its patterns expanded."""
    (block,) = re.findall(r"```sh\n(.*?)```", readme.read_text(encoding="utf-8"), re.DOTALL)
    found: list[list[str]] = []
    for line in block.splitlines():
        if line.startswith("hydroid "):
            words = shlex.split(line)[1:]
            found.append([f for word in words for f in (sorted(glob.glob(word)) if "*" in word else [word])])
    return found


@pytest.mark.parametrize(("name", "place", "count"), [("boom", ".", 3), ("urdf", "examples/urdf", 4)])
def test_the_readmes_commands_run(name: str, place: str, count: int, tmp_path: Path, monkeypatch):
    copy = tmp_path / "examples" / name
    shutil.copytree(EXAMPLES / name, copy, ignore=shutil.ignore_patterns("mine"))
    monkeypatch.chdir(tmp_path / place)
    run = commands(copy / "README.md")
    assert len(run) == count
    for words in run:
        done = CliRunner().invoke(app, [*words, *(SHORT if words[0].startswith("fit-") else [])])
        assert done.exit_code == 0, (words, done.output[-2000:], done.exception)


def test_the_urdf_and_its_meshes_are_what_the_script_makes():
    script = runpy.run_path(str(EXAMPLES / "urdf" / "make_example.py"))
    assert (EXAMPLES / "urdf" / "robot.urdf").read_text(encoding="utf-8") == script["urdf"]()
    for name in script["SIZES"]:
        assert (EXAMPLES / "urdf" / "meshes" / f"{name}.stl").read_bytes() == script["mesh"](name)


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
    assert words in " ".join((EXAMPLES / name / "README.md").read_text(encoding="utf-8").split())


def test_all_logs_of_the_excavator_are_read_without_repair_and_its_boom_rises_as_its_rod_runs_out(caplog):
    files = sorted((EXAMPLES / "excavator").glob("*_*.csv"))
    assert len(files) == 18
    logs = hydroid.read_logs(files, hydroid.load_settings(EXAMPLES / "excavator" / "fit.yaml"))
    assert all(log.driven.all() and log.measured.all() for log in logs)
    assert {log.period for log in logs} == {0.05}
    assert "moves against" not in caplog.text


def test_every_benchmark_can_be_imported():
    """From its own folder, as `make` runs it."""
    folder = EXAMPLES.parent / "benchmarks"
    names = sorted({file.stem for file in folder.glob("*.py")})
    assert names
    program = f"import importlib\nfor name in {names}: importlib.import_module(name)"
    subprocess.run([sys.executable, "-c", program], cwd=folder, check=True)
