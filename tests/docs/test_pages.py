"""The pages of the documentation: they build, their links lead somewhere, and what they show runs."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from hydroid.commands.app import COMMANDS as NAMES
from hydroid.commands.app import click_command

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
RUN = ("quick_start", "first_log", "recording", "algorithms", "python", "two_arms", "own_arm")
"""pages whose `sh` and `python` blocks are run, in this order; other blocks are only shown"""
COMMANDS = {name: click_command(name) for name in NAMES}


class Block(NamedTuple):
    """A fenced block: its language, its text, and where it begins."""

    language: str
    text: str
    where: str


def blocks(page: Path) -> list[Block]:
    text = page.read_text()
    found = re.finditer(r"^```(\w+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [Block(m[1], m[2], f"{page.name}:{text.count(chr(10), 0, m.start()) + 1}") for m in found]


def test_the_site_builds_without_a_warning(tmp_path: Path):
    build = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "--keep-going",
        "-q",
        "-b",
        "html",
        ROOT / "docs",
        tmp_path / "site",
    ]
    done = subprocess.run(build, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert done.returncode == 0, done.stderr
    assert {p.stem for p in PAGES} <= {p.stem for p in (tmp_path / "site").glob("*.html")}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_to_files(page: Path):
    for target in re.findall(r"\]\(([^)]+)\)", page.read_text()):
        name = target.partition("#")[0]
        if not name.startswith("http") and name:
            assert (page.parent / name).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_have_the_flags_that_are_shown(page: Path):
    for block in blocks(page):
        if block.language in ("sh", "console"):
            for name, rest in re.findall(
                r"^(?:\$ )?hydroid ([a-z-]+)([^#\n]*)", block.text.replace("\\\n", ""), re.M
            ):
                known = {option for parameter in COMMANDS[name].params for option in parameter.opts}
                assert set(re.findall(r" (--[a-z-]+)", rest)) <= known, f"{block.where}: {name}{rest}"


@pytest.mark.slow
def test_what_the_pages_show_runs(tmp_path: Path):
    """A page's commands, then its Python as one program; all pages share a folder, as for a reader."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    urdf = ROOT / "examples" / "urdf"  # the files that own_arm.md takes for the reader's own
    (tmp_path / "robot.urdf").write_bytes((urdf / "robot.urdf").read_bytes())
    (tmp_path / "meshes").symlink_to(urdf / "meshes")
    for n, name in enumerate("abc", start=1):
        (tmp_path / f"{name}.csv").symlink_to(urdf / f"log_{n}.csv")
    bin_folder = Path(sys.executable).parent
    environment = os.environ | {
        "PYTHONPATH": str(ROOT),
        "PATH": f"{bin_folder}{os.pathsep}{os.environ['PATH']}",
    }
    hydroid = f'hydroid() {{ "{sys.executable}" -m hydroid "$@"; }}\n'
    for name in RUN:
        page = blocks(ROOT / "docs" / f"{name}.md")
        shell = [(b.where, ["bash", "-ec", hydroid + b.text]) for b in page if b.language == "sh"]
        code = "".join(b.text for b in page if b.language == "python")
        for where, command in (*shell, (name, [sys.executable, "-c", code])):
            done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
            assert done.returncode == 0, f"{where}\n{done.stderr[-2000:]}"
