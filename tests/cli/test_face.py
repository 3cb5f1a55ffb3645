"""The command line and the public names say the same, answer at once, and speak JSON."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from typer.main import get_command
from typer.testing import CliRunner

import hydroid
from hydroid.api.mechanics import with_mechanics
from hydroid.cli.app import GROUPS, app, main
from hydroid.estimate import FitSummary, ParameterEstimate, write_estimate
from hydroid.identified_model import write_settings

ROOT = Path(__file__).parents[2]
LOG = ROOT / "examples" / "logs" / "rig_shoulder_1.csv"
HEAVY = ("mujoco", "numba", "scipy", "matplotlib", "trimesh", "rich", "jinja2", "PIL", "distributed")
COMMANDS = get_command(app).commands  # pyright: ignore[reportAttributeAccessIssue]
VALUES = {"D": 80.0, "S": 0.0, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}


def imported(*arguments: str) -> list[str]:
    """Heavy modules that a command imports."""
    code = (
        "import sys; from hydroid.cli.app import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        f"print('IMPORTED', *[m for m in {HEAVY} if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=60
    )
    return done.stdout.splitlines()[-1].split()[1:]


def test_every_command_is_a_public_function_of_the_same_name():
    for name in COMMANDS:
        assert callable(getattr(hydroid, name.replace("-", "_"))), name


def test_every_public_name_exists_and_an_unknown_one_does_not():
    for name in hydroid.__all__:
        assert getattr(hydroid, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        hydroid.nonsense  # noqa: B018  # pyright: ignore


def test_help_lists_every_command_in_its_group_with_an_example():
    text = CliRunner().invoke(app, ["--help"]).output
    for heading in GROUPS.values():
        assert f"\n{heading}:\n" in text
    for name, command in COMMANDS.items():
        assert f"\n  {name} " in text
        assert command.rich_help_panel in GROUPS
        assert f"Example: hydroid {name} " in " ".join(
            CliRunner().invoke(app, [name, "--help"]).output.split()
        )


def test_every_option_of_an_example_exists():
    for name, command in COMMANDS.items():
        known = {option for parameter in command.params for option in parameter.opts}
        words = command.epilog.split()
        assert {word for word in words if word.startswith("--")} <= known, name


def test_import_is_light():
    code = "import sys, hydroid; print(sorted(m for m in sys.modules if m in ('numpy', 'pydantic', 'yaml')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["check", str(LOG)],
        ["check", "nowhere.csv"],
        ["fit-mech", "nowhere.csv"],
        ["fit-mech", str(LOG), "--set", "search.seed=x"],
        ["fit-hyd", str(LOG), "--mech", "nowhere"],
        ["validate", str(LOG), "--fit", "nowhere"],
        ["simulate", "nowhere.csv", "--fit", "nowhere"],
        ["surface", str(LOG), "--fit", "nowhere", "--over", "K,D"],
        ["design", "--fit", "nowhere"],
        ["view", "--set", "x=1"],
        ["init", "new", "--arm", "nowhere"],
        ["study", "nowhere.yaml"],
    ],
)
def test_inputs_are_looked_at_before_anything_heavy_is_imported(arguments: list[str]):
    # settings read the arm's MJCF, which is MuJoCo's
    assert set(imported(*arguments)) <= {"mujoco"}


@pytest.mark.parametrize(
    ("arguments", "kind", "where"),
    [
        (["check", "nowhere.csv", "--config", "nonsense"], "settings", "nonsense"),
        (["fit-mech", "nowhere.csv"], "log", "nowhere.csv"),
        (["fit-mech", str(LOG), "--algorithm", "pso"], "settings", "--algorithm"),
        (["fit-mech", str(LOG), "--sed", "1"], "usage", ""),
        (["validate", str(LOG), "--fit", "nowhere"], "settings", "nowhere"),
        (["surface", str(LOG), "--fit", "nowhere", "--over", "K"], "usage", ""),
    ],
)
def test_errors_are_json_too(arguments: list[str], kind: str, where: str, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["hydroid", *arguments, "--json"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    content = json.loads(capsys.readouterr().out)
    assert content["schema"] == 1
    assert set(content["error"]) == {"kind", "what", "where", "hint"}
    assert content["error"]["kind"] == kind
    assert where in content["error"]["where"] if kind != "usage" else content["error"]["what"]


def test_check_prints_json(tmp_path: Path):
    (tmp_path / "broken.csv").write_text("time_s,u1_pct\n0,1\n0.01,x\n")
    done = CliRunner().invoke(app, ["check", str(LOG), str(tmp_path / "broken.csv"), "--json"])
    assert done.exit_code == 2
    good, bad = json.loads(done.stdout)["logs"]
    assert (good["usable"], good["driven_joints"]) == (True, [2])
    assert not bad["usable"]
    assert {finding["level"] for finding in bad["findings"]} >= {"error"}


def stage_one(folder: Path, **overrides: object) -> Path:
    """A run folder of stage 1 without its search."""
    settings = hydroid.load_settings("fit-mech", overrides)
    write_settings(folder, settings)
    estimate = {name: ParameterEstimate(value=v, unit="?") for name, v in VALUES.items()}
    write_estimate(folder, FitSummary(stage="mech", estimate=estimate, final="best"))
    return folder


def test_stage_two_reads_logs_as_stage_one_did(tmp_path: Path):
    mech = stage_one(tmp_path / "mech", **{"log.time.column": "t", "log.delay_s": 0.1})
    changes = with_mechanics(mech, "fit-hyd", {"log.delay_s": 0.2}, ["a.csv"])
    settings = hydroid.load_settings("fit-hyd", changes)
    assert settings.log.time.column == "t"
    assert settings.log.delay_s == 0.2  # what is asked for has the last word
    assert settings.arm.model == (tmp_path / "mech" / "model" / "arm.xml").resolve()
    # the masses hold; the damping and the spring of stage 2 have a start and a value of their own
    masses = {name: value for name, value in VALUES.items() if name.startswith("M")}
    assert {name: settings.parameters[name].fixed for name in masses} == masses
    assert settings.parameters["D"].fixed is None
    assert settings.parameters["S"].fixed == 0.0


def test_a_config_that_names_its_own_layout_and_arm_keeps_them(tmp_path: Path):
    mech = stage_one(tmp_path / "mech", **{"log.time.column": "t", "log.delay_s": 0.1})
    own = yaml.safe_load((ROOT / "configs" / "fit-hyd.yaml").read_text())
    own |= {"arm": "hydrolek", "log": {"time": {"column": "clock"}}}
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(own))
    changes = with_mechanics(mech, tmp_path / "own.yaml", {}, ["a.csv"])
    settings = hydroid.load_settings(tmp_path / "own.yaml", changes)
    assert settings.log.time.column == "clock"
    assert settings.log.delay_s == 0.1
    assert settings.arm.model == (ROOT / "models" / "hydrolek.xml").resolve()


def test_the_masses_of_an_own_arm_come_from_stage_one(tmp_path: Path):
    text = (ROOT / "models" / "hydrolek.xml").read_text().replace('body name="link3"', 'body name="forearm"')
    (tmp_path / "arm.xml").write_text(text.replace('meshdir="../meshes"', f'meshdir="{ROOT / "meshes"}"'))
    arm = yaml.safe_load((ROOT / "configs" / "hydrolek.yaml").read_text()) | {
        "model": "arm.xml",
        "pair": None,
    }
    (tmp_path / "arm.yaml").write_text(yaml.safe_dump(arm))
    settings = yaml.safe_load((ROOT / "configs" / "fit-mech.yaml").read_text())
    settings["arm"] = str(tmp_path / "arm.yaml")
    settings["parameters"]["M_forearm"] = settings["parameters"].pop("M3") | {"link": "forearm"}
    (tmp_path / "mech.yaml").write_text(yaml.safe_dump(settings))
    first = hydroid.load_settings(tmp_path / "mech.yaml")
    write_settings(tmp_path / "mech", first)
    values = {name.replace("M3", "M_forearm"): value for name, value in VALUES.items()} | {"K": 1.0}
    estimate = {name: ParameterEstimate(value=v, unit="?") for name, v in values.items()}
    write_estimate(tmp_path / "mech", FitSummary(stage="mech", estimate=estimate, final="best"))
    second = hydroid.load_settings("fit-hyd", with_mechanics(tmp_path / "mech", "fit-hyd", {}, ["a.csv"]))
    assert "M3" not in second.parameters
    assert second.parameters["M_forearm"].link == "forearm"
    assert second.parameters["M_forearm"].fixed == VALUES["M3"]
