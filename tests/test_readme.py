"""The README and its pages name only what exists: make targets, commands, flags, files."""

import re
from pathlib import Path

import yaml

from hydroid.commands.app import COMMANDS as NAMES
from hydroid.commands.app import click_command
from hydroid.settings.log import LogSettings

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
PAGES = "".join(p.read_text() for p in sorted((ROOT / "docs").glob("*.md")))
COMMANDS = {name: click_command(name) for name in NAMES}


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text()
    targets = set(re.findall(r"(?:`|^)make ([a-z-]+)", README + PAGES, re.MULTILINE))
    assert {"demo", "docs", "excavator", "bench"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_table_of_commands_has_all_of_them():
    table = (ROOT / "docs" / "commands.md").read_text()
    named = re.findall(r"^\| [a-z]* ?\| `hydroid ([a-z]+-?[a-z]+) ", table, re.MULTILINE)
    assert sorted(named) == sorted(COMMANDS)


def test_flags_belong_to_their_command():
    for line in (README + PAGES).splitlines():
        for name, rest in re.findall(r"`hydroid ([a-z][a-z-]+)([^`#|]*)", line):
            known = {option for parameter in COMMANDS[name].params for option in parameter.opts}
            for flag in re.findall(r" (--?[a-z-]+)", rest):
                assert flag in known, (name, flag)


def test_files_exist():
    for name in re.findall(
        r"`((?:configs|examples|docs|benchmarks|tests|hydroid)/[\w./-]+)`", README + PAGES
    ):
        assert (ROOT / name.rstrip("/")).exists() or (ROOT / "hydroid" / name).exists(), name
    for name in re.findall(r"\]\(([^)h][^)]*)\)", README):
        assert (ROOT / name).exists(), name


def test_the_example_of_another_layout_is_valid():
    text = (ROOT / "configs" / "fit-mech.yaml").read_text()
    example = re.findall(r"^#   (.*)$", text, re.MULTILINE)
    settings = LogSettings.model_validate(yaml.safe_load("\n".join(example))["log"])
    assert set(settings.joints) == {1, 2, 4, 5, 6, 7}
    assert settings.time.unit == "ms"
