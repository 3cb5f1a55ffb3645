"""The examples in the docstrings of the public names run, on a small fit."""

import inspect
import re
import textwrap
from pathlib import Path

import pytest
from conftest import SMALL
from made_logs import TRUTH

import hydroid
from hydroid.commands import stages
from hydroid.reporting import page_file

NAMES = [
    name
    for name in hydroid.__all__
    if re.search(
        r"^ {4}\S*.*hydroid\.",
        inspect.getdoc(getattr(hydroid, name)) or "",
        re.MULTILINE,
    )
]
ELSEWHERE = {
    "view",
    "report",
    "convert",
    "init",
    "study",
    "follow",
    "export",
    "draw",
    "Env",
}
"""a window or a film needs OpenGL, report pages, which are not written here, files of
one's own, and what uses a machine a finished fit of stage 2; they have tests of their
own"""
WRITES = {"fit": "a", "fit_mech": "mech", "fit_hyd": "hyd"}
"""the run folder that an example makes"""
QUICK = SMALL | {
    "refinement": None,
    "joint_refinement": False,
    "design": {"effort": 3, "poses": "any"},
}


def example(name: str) -> str:
    lines = (inspect.getdoc(getattr(hydroid, name)) or "").splitlines()
    end = next(
        (i for i, line in enumerate(lines) if line.strip() in ("Args:", "Raises:")),
        len(lines),
    )
    return textwrap.dedent(
        "\n".join(line for line in lines[1:end] if line.startswith(" " * 4))
    )


@pytest.fixture(scope="module")
def folder(array, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("examples")
    for name in ("a.csv", "b.csv", "commands.csv"):
        (folder / name).symlink_to(array[0] / "a.csv")
    (folder / "runs").mkdir()
    (folder / "runs" / "array").symlink_to(array[0])
    for name in ("a", "mech"):
        (folder / "runs" / name).symlink_to(array[0] / "seed-1")
    fixed = {
        f"parameters.{name}.fixed": value
        for name, value in TRUTH.items()
        if name != "K"
    }
    hydraulic = hydroid.load_identified(None, "fit-hyd", fixed, nominal=True)
    hydroid.Plant(hydraulic).save(folder / "runs" / "hyd")
    return folder


def test_every_function_has_an_example():
    functions = {
        n for n in hydroid.__all__ if callable(getattr(hydroid, n)) and n[0].islower()
    }
    own = {
        "identified",
        "start_values",
        "load_identified",
        "write_log",
        "open_workers",
        "load_plant",
    }
    assert functions - own <= set(NAMES)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ELSEWHERE])
def test_an_example_runs(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    code = example(name)
    assert f"hydroid.{name}(" in code
    (tmp_path / "runs").mkdir()
    for file in (*folder.glob("*.csv"), *folder.glob("runs/*")):
        (tmp_path / file.relative_to(folder)).symlink_to(file)
    monkeypatch.chdir(tmp_path)
    if name in WRITES:
        (tmp_path / "runs" / WRITES[name]).unlink()
    original = hydroid.load_settings

    def quick(config: str, overrides: dict[str, object] | None = None):
        return original(config, QUICK | (overrides or {}))

    monkeypatch.setattr(stages, "load_settings", quick)
    monkeypatch.setattr("hydroid.load_settings", quick)
    monkeypatch.setattr(page_file, "write_page", lambda *_: [])
    exec(compile(code, name, "exec"), {"hydroid": hydroid})
