"""Data goes one way: no package imports one that stands after it."""

import ast
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "hydroid"
imports = runpy.run_path(str(ROOT.parent / "benchmarks" / "structure.py"))["imports"]

# a package may import packages of a lower layer, and itself
LAYERS = [
    {"arrays", "errors"},
    {
        "files",
        "findings",
        "mjcf",
        "parameters",
        "progress",
        "quantity_table",
        "robot_xml",
    }
    | {"joint_verdict", "rungs", "settings", "units", "words"},
    {"estimate"},
    {"identified_model"},
    {"log", "arm", "hydraulics"},
    {"simulation", "search", "parallel", "cad"},
    {"problem"},
    {"plant", "prediction"},
    {"posterior"},
    {"fitting"},
    {"advice"},
    {"run"},
    {"use"},
    {"studies"},
    {"reporting"},
    {"project"},
    {"viewer"},
    {"commands"},
    {"__init__", "__main__"},
]
LEVEL = {
    package: level for level, packages in enumerate(LAYERS) for package in packages
}
FILES = sorted(ROOT.rglob("*.py"))


def package(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported_packages(path: Path) -> set[str]:
    tree = ast.parse(path.read_text())
    assert not any(getattr(node, "level", 0) for node in ast.walk(tree)), (
        f"{path}: relative import"
    )
    return {
        name.split(".")[1] for name in imports(tree) if name.startswith("hydroid.")
    } & LEVEL.keys()


def test_every_file_belongs_to_a_package():
    assert {package(path) for path in FILES} <= LEVEL.keys()


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_upward_import(path: Path):
    here = package(path)
    upward = {other for other in imported_packages(path) if LEVEL[other] > LEVEL[here]}
    beside = {
        other
        for other in imported_packages(path)
        if LEVEL[other] == LEVEL[here] and other != here
    }
    assert not upward, f"{here} imports {upward}"
    # within a layer packages do not know each other, but for the small ones at the
    # bottom
    assert not beside or LEVEL[here] <= 1, f"{here} imports its neighbour {beside}"


@pytest.mark.parametrize("name", ["search", "parallel"])
def test_search_and_workers_know_no_robot(name: str):
    for path in (ROOT / name).glob("*.py"):
        assert imported_packages(path) <= {"arrays", "errors", "settings", name}, path
        assert "mujoco" not in imports(ast.parse(path.read_text())), path
