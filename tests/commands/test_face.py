"""The command line and the public names are the same functions, answer at once, and
explain themselves."""

import inspect
import subprocess
import sys
from pathlib import Path

import pytest
from log_files import RIG
from typer.testing import CliRunner

import hydroid
from hydroid.commands.app import COMMANDS, GROUPS, app, click_command

LOG = RIG / "rig_shoulder_1.csv"
HEAVY = (
    "numba",
    "scipy",
    "matplotlib",
    "trimesh",
    "rich",
    "jinja2",
    "PIL",
    "distributed",
)
PRINTED = {"json", "quiet", "verbose"}
"""options of the command line alone"""


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_is_a_function_whose_parameters_are_its_options(name: str):
    function = getattr(hydroid, name.replace("-", "_"))
    own = inspect.signature(function).parameters
    command = click_command(name)
    assert [p.name for p in command.params if p.name not in PRINTED] == [*own]
    for parameter in command.params:
        if parameter.name in own:
            default = own[parameter.name].default
            assert parameter.required == (default is inspect.Parameter.empty)
            assert parameter.required or parameter.default in (
                default,
                None if default == () else default,
            )
            assert f"    {parameter.name}: " in function.__doc__
            positional = (
                own[parameter.name].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD
            )
            assert (parameter.param_type_name == "argument") == positional


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_an_example_whose_options_exist(name: str):
    text = " ".join(CliRunner().invoke(app, [name, "--help"]).output.split())
    _, example = text.split(f"Example: hydroid {name} ")
    known = {
        option for parameter in click_command(name).params for option in parameter.opts
    }
    assert {word for word in example.split() if word.startswith("-")} <= known
    assert "hydroid." not in text  # no Python


def test_help_lists_every_command_in_its_group():
    text = CliRunner().invoke(app, ["--help"]).output
    for heading, commands in GROUPS.items():
        assert f"\n{heading}:\n" in text
        assert all(f"\n  {name} " in text for name in commands)
    assert len(COMMANDS) <= 16


def test_every_public_name_exists_and_an_unknown_one_does_not():
    for name in hydroid.__all__:
        assert getattr(hydroid, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        hydroid.nonsense  # noqa: B018  # pyright: ignore


def test_inputs_are_looked_at_before_anything_heavy_is_imported():
    """In one process, in this order: a module that is imported once stays."""
    calls = [
        ["--help"],
        ["check", LOG],
        ["check", "nowhere.csv"],
        ["fit-mech", "nowhere.csv"],
        ["fit-mech", LOG, "--set", "search.seed=x"],
        ["fit-hyd", LOG, "--mech", "nowhere"],
        ["validate", LOG, "--fit", "nowhere"],
        ["simulate", "nowhere.csv", "--fit", "nowhere"],
        ["analyse", LOG, "--fit", "nowhere"],
        ["design", "--fit", "nowhere"],
        ["view", "--set", "x=1"],
        ["study", "nowhere.yaml"],
    ]
    code = f"""
import sys, hydroid
light = [m for m in sys.modules if m in ("numpy", "pydantic", "yaml", "typer")]
assert not light, light
from hydroid.commands.app import main
light = [m for m in sys.modules if m in ("numpy", "pydantic", "yaml")]
assert not light, light
for arguments in {[[str(word) for word in call] for call in calls]}:
    sys.argv = ["hydroid", *arguments]
    try: main()
    except SystemExit: pass
    heavy = [m for m in {HEAVY} if m in sys.modules]
    assert not heavy, (arguments, heavy)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX only")
def test_a_closed_pipe_is_no_traceback(tmp_path: Path):
    command = f"{sys.executable} -m hydroid check {LOG} {LOG} | head -c 1"
    done = subprocess.run(
        command, shell=True, cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert "Traceback" not in done.stderr
