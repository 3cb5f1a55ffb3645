"""The examples run as they stand, and the benchmarks can be imported."""

import json
import re
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def output(name: str, *arguments: str) -> str:
    command = [sys.executable, str(EXAMPLES / name), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=EXAMPLES.parent).stdout


@pytest.fixture
def gym_env(monkeypatch: pytest.MonkeyPatch):
    """The module of the environment."""
    pytest.importorskip("gymnasium")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import gym_env  # pyright: ignore[reportMissingImports]

    return gym_env


def test_the_controller_brings_the_shoulder_to_its_target():
    found = re.search(r"after 10 s: ([\d.]+) deg of 30", output("pid.py"))
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


def test_every_benchmark_can_be_imported():
    """From its own folder, as `make` runs it."""
    folder = EXAMPLES.parent / "benchmarks"
    names = sorted({file.stem for file in folder.glob("*.py")})
    assert names
    program = f"import importlib\nfor name in {names}: importlib.import_module(name)"
    subprocess.run([sys.executable, "-c", program], cwd=folder, check=True)
