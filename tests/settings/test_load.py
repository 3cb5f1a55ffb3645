import os
import time
from pathlib import Path

import pytest

import hydroid
from hydroid.errors import SettingsError
from hydroid.estimate import read_estimate
from hydroid.problem.bindings import Bindings
from hydroid.settings.document import read_yaml
from hydroid.settings.fit import FitSettings, StudySettings
from hydroid.settings.load import load, parse_override
from hydroid.settings.log import ColumnMap, LogSettings

MINIMAL = """\
parameters:
  K: {quantity: gain, bounds: [0.1, 1.0]}
  M1:
    quantity: mass
    link: link1
    bounds: [1, 2]
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "c.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_overrides_replace_one_setting(tmp_path: Path):
    path = written(tmp_path, MINIMAL)
    key, value = parse_override("search.ga.generations=7")
    settings = load(path, FitSettings, {key: value, "parameters.K.bounds": [0.2, 0.3]})
    assert settings.search.ga.generations == 7
    assert settings.parameters["K"].bounds == (0.2, 0.3)
    assert settings.parameters["M1"].link == "link1"


LOG_FAULTS = [
    ("command: {column: u}", "{joint}"),
    ("angle: {column: q}", "{joint}"),
    ("command: {column: [a, b, c]}", "1 or 2 column names"),
    ("command: {column: 3}", "must be a list in brackets"),
    ("command: {scale: 0}", "must not be 0"),
    ("angle: {unit: bar}", "bar is no unit of a log's angles"),
    ("angle: {unit: grad}", "'deg', 'rad'"),
    ("time: {unit: week}", "'h' or 'day'"),
    ("joints: {0: null}", "greater than or equal to 1"),
    ("joints: {2: u2}", "joints.2"),
    ("joints: [1, 2]", "joints"),
    ("period_s: 0", "period_s"),
]
"""settings of `log`, and what is said of them"""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            MINIMAL + "sarch: {}\n",
            ["line 7", "unknown setting 'sarch'; did you mean 'search'?"],
        ),
        (MINIMAL.replace("parameters", "paramters"), ["unknown setting 'paramters'"]),
        (MINIMAL.replace("link1", "2"), ["line 5", "parameters.M1.link"]),
        (MINIMAL.replace("[1, 2]", "[2, 1]"), ["line 3", "lower < upper"]),
        (
            MINIMAL.replace("bounds: [1, 2]", "x: 1"),
            ["unknown setting 'parameters.M1.x'"],
        ),
        (MINIMAL.replace("gain", "gian"), ["line 2", "'gain'"]),
        (
            MINIMAL + "    within: 2\n",
            [
                "line 3",
                "parameters.M1: the nominal value 4.6 kg lies outside the bounds",
            ],
        ),
        ("parameters: [1\n", ["line 2", "not YAML"]),
        ("", ["must be a mapping"]),
        ("- 1\n", ["must be a mapping"]),
        ("outputs: [2]\n", ["'parameters' is missing"]),
        (MINIMAL + "search: {seed: -1}\n", ["line 7", "search.seed"]),
        (MINIMAL.replace("0.1,", ".nan,"), ["line 2", "finite"]),
        (MINIMAL.replace("K:", "K-1:"), ["plain words"]),
        (
            MINIMAL + "search: {seed: true}\n",
            ["search.seed: must be a valid integer (given: true)"],
        ),
        (
            MINIMAL + "search: {seed: '3'}\n",
            ["search.seed: must be a valid integer (given: '3')"],
        ),
        (
            MINIMAL + "log: {delay_s: '0.1'}\n",
            ["log.delay_s: must be a valid number (given: '0.1')"],
        ),
        *(
            (MINIMAL + f"log: {{{text}}}\n", ["line 7", says])
            for text, says in LOG_FAULTS
        ),
        (
            MINIMAL + "joint_refinement: 1\n",
            ["joint_refinement: must be a valid boolean (given: 1)"],
        ),
        (MINIMAL + "outputs: 2\n", ["outputs: must be a list in brackets"]),
        (
            MINIMAL + "outputs: [true]\n",
            ["outputs.0: must be a valid integer (given: true)"],
        ),
        (
            MINIMAL + "objective: {weights: {true: 1}}\n",
            ["must be a valid integer (given: true)"],
        ),
        (
            MINIMAL + "objective: {norm: true}\n",
            ["objective.norm: must be 1, 2 or 'inf' (given: true)"],
        ),
    ],
)
def test_a_fault_names_file_line_and_setting(
    tmp_path: Path, text: str, says: list[str]
):
    path = written(tmp_path, text)
    with pytest.raises(SettingsError) as caught:
        load(path, FitSettings)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    for part in says:
        assert part in message


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("search.ga.population", 1),
        ("parameters.K.bounds", [2, 1]),
        ("search", {"ga": {"population": 1}}),
        ("log.angle.column", "foo"),
    ],
)
def test_a_fault_in_an_override_names_the_override(
    tmp_path: Path, key: str, value: object
):
    with pytest.raises(SettingsError) as caught:
        load(written(tmp_path, MINIMAL), FitSettings, {key: value})
    assert str(caught.value).startswith(f"--set {key}: ")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            MINIMAL + f"outputs: {[2] * 19_000}\n",
            "line 7: outputs: joint 2 occurs twice",
        ),
        (
            MINIMAL + f"outputs: {[*range(1, 19_000)]}\n",
            "outputs: 18999 joints, but the arm has 7",
        ),
        (
            f"a: &a {'x' * 10**5}\nb: [{', '.join(['*a'] * 4000)}]\n",
            "more than 1048576 characters of text",
        ),
    ],
    ids=["the same joint", "too many joints", "aliases of long text"],
)
def test_what_would_take_minutes_is_refused_at_once(
    tmp_path: Path, text: str, says: str
):
    text = text.replace("gain,", "gain, each: true,")
    began = time.monotonic()
    with pytest.raises(SettingsError, match=says):
        load(written(tmp_path, text), FitSettings)
    assert time.monotonic() - began < 10


def test_a_pipe_is_no_settings(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(SettingsError, match="it is no file"):
        load(tmp_path / "pipe", FitSettings)
    with pytest.raises(SettingsError, match="it is no file"):
        hydroid.load_identified(tmp_path / "pipe")


def test_a_study_of_more_cells_than_anyone_fits_is_refused(tmp_path: Path):
    axes = {
        f"parameters.{name}.fixed": (1.0, 2.0) for name in "abcdefghijklmnopqrstuvwxyz"
    }
    study = StudySettings(title="", base="fit-mech", logs=("a.csv",), axes=axes)
    with pytest.raises(SettingsError, match="more than 100000 cells"):
        study.changes()


NAMED = """
arm: ARM
outputs: [swing, boom]
parameters:
  K: {quantity: gain, each: true, nominal: 5, within: 4}
  D: {quantity: damping, each: [boom, 4], bounds: [1, 10]}
  S: {quantity: stiffness, joints: [arm], fixed: 0}
  M: {quantity: mass, each: true, within: 2}
  m: {quantity: mass, each: [boom], fixed: 5}
log: {joints: {bucket: null, boom: {command: {column: lift}}}}
objective: {weights: {boom: 2}}
design: {joints: [boom]}
""".replace(
    "ARM", str(Path(__file__).parents[2] / "examples" / "excavator" / "arm.yaml")
)


def test_joints_and_links_may_be_given_by_name(tmp_path):
    path = written(
        tmp_path, NAMED.replace("  m: {quantity: mass, each: [boom], fixed: 5}\n", "")
    )
    settings = hydroid.load_settings(path, {"log.joints.arm.angle.column": "q"})
    assert settings.outputs == (1, 2)
    assert settings.log.columns("command", 4) is None
    assert settings.log.columns("command", 2).column == ("lift",)
    assert settings.log.columns("angle", 3).column == ("q",)
    assert settings.objective.weights == {2: 2.0}
    assert settings.design.joints == (2,)
    joints = {
        name: p.joints for name, p in settings.parameters.items() if p.link is None
    }
    assert joints == {
        "K_swing": (1,),
        "K_boom": (2,),
        "D_boom": (2,),
        "D_bucket": (4,),
        "S": (3,),
    }
    masses = [p.link for p in settings.parameters.values() if p.quantity == "mass"]
    assert masses == list(settings.arm.link_names)
    assert "M_bucket" in settings.parameters


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[swing, boom]", "[swing, bom]", "line 3: outputs.1: no joint 'bom'; the arm's joints: swing"),
        ("{bucket: null", "{buckt: null", "no joint 'buckt'"),
        ("[boom, 4]", "[boom, tip]", "no joint 'tip'; the arm's joints: swing"),
        ("each: true, within", "each: true, link: boom, within", "give link or each: links .* not both"),
        ("[boom], fixed", "[bom], fixed", "bom"),
    ],
)  # fmt: skip
def test_an_unknown_name_is_refused_with_those_there_are(tmp_path, old, new, message):
    with pytest.raises(SettingsError, match=message):
        Bindings(hydroid.load_settings(written(tmp_path, NAMED.replace(old, new))))


MAPPINGS = """
arm: ARM
outputs: [boom]
tolerance_deg: {boom: 2}
parameters: {D: {quantity: damping, bounds: [1, 10]}}
log: {joints: {boom: {command: {column: lift}, angle: {unit: rad}}, 3: {angle: {unit: rad}}}}
objective: {weights: {boom: 2}, noise_deg: {3: 0.1}}
""".replace(
    "ARM", str(Path(__file__).parents[2] / "examples" / "excavator" / "arm.yaml")
)


def test_an_override_finds_a_joint_by_its_name_and_by_its_number(tmp_path: Path):
    path = written(tmp_path, MAPPINGS)
    changes = {
        "log.joints.2.command.scale": -1,
        "log.joints.3.command.scale": 2,
        "log.joints.arm.angle.scale": 3,
        "tolerance_deg.2": 1,
        "objective.weights.2": 5,
        "objective.noise_deg.arm": 0.2,
    }
    settings = hydroid.load_settings(path, changes)
    assert settings.log.columns("command", 2) == ColumnMap(("lift",), "%", scale=-1)
    assert settings.log.columns("angle", 2) == ColumnMap(("q2_deg",), "rad")
    assert settings.log.columns("command", 3) == ColumnMap(("u3_pct",), "%", scale=2)
    assert settings.log.columns("angle", 3) == ColumnMap(("q3_deg",), "rad", scale=3)
    assert settings.tolerance_deg == {2: 1}
    assert settings.objective.weights == {2: 5}
    assert settings.objective.noise_deg == {3: 0.2}


@pytest.mark.parametrize(
    ("said", "given", "a", "b"),
    [
        ("dead_band: 20", {"dead_band": 5}, 5, 5),
        ("dead_band_a: 10, dead_band_b: 20", {"dead_band": 5}, 5, 5),
        ("dead_band: 20", {"dead_band_a": 5}, 5, 20),
        ("dead_band: 20", {"dead_band_b": 5, "dead_band_a": 3}, 3, 5),
        ("dead_band_a: 10", {"dead_band": 5, "dead_band_b": 7}, 5, 7),
    ],
)
def test_an_override_of_one_side_or_both_replaces_the_other_way_of_saying_it(
    tmp_path: Path, said: str, given: dict[str, float], a: float, b: float
):
    path = written(tmp_path, f"{MAPPINGS}\nhydraulics: {{{said}}}\n")
    changes = {f"hydraulics.{name}": value for name, value in given.items()}
    hydraulics = hydroid.load_settings(path, changes).hydraulics
    assert (hydraulics.dead_band_a, hydraulics.dead_band_b) == (a, b)


@pytest.mark.parametrize("key", ["tolerance_deg", "log.joints"])
def test_a_number_of_thousands_of_digits_is_no_joints(tmp_path: Path, key: str):
    with pytest.raises(SettingsError, match="9'; the arm's joints: swing"):
        hydroid.load_settings(
            written(tmp_path, MAPPINGS), {f"{key}.{'9' * 5000}": None}
        )


@pytest.mark.parametrize("joint", ["0", "-1", "bom"])
def test_a_wrong_joint_of_a_list_is_named_without_its_place(tmp_path: Path, joint: str):
    """`--joints 1,bom` of a command gives its list so."""
    says = f"--set design.joints: no joint '{joint}'; the arm's joints: swing"
    with pytest.raises(SettingsError, match=says):
        hydroid.load_settings(
            written(tmp_path, MAPPINGS), {"design.joints": ["1", joint]}
        )


@pytest.mark.parametrize(
    "key", ["tolerance_deg.2", "objective.weights.2", "log.joints.2.command.scale"]
)
def test_a_wrong_override_of_a_joint_is_named_as_it_was_given(tmp_path: Path, key: str):
    with pytest.raises(SettingsError, match=f"--set {key}: must "):
        hydroid.load_settings(written(tmp_path, MAPPINGS), {key: 0})


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "tolerance_deg: {boom: 2}",
            "tolerance_deg: {2: 1, boom: 2}",
            "line 4: tolerance_deg: joint boom",
        ),
        (
            "weights: {boom: 2}",
            "weights: {boom: 2, 2: 3}",
            "line 7: objective.weights: joint 2",
        ),
        (
            "noise_deg: {3: 0.1}",
            "noise_deg: {3: 0.1, arm: 1}",
            "line 7: objective.noise_deg: joint arm",
        ),
        ("{joints: {boom", "{joints: {2: null, boom", "line 6: log.joints: joint boom"),
        ("[boom]", "[boom, 2]", "line 3: outputs: joint 2"),
        (
            "damping",
            "damping, joints: [boom, 2]",
            "line 5: parameters.D.joints: joint 2",
        ),
        ("damping", "damping, each: [boom, 2]", "line 5: parameters.D.each: joint 2"),
        (
            "objective:",
            "design: {joints: [2, boom]}\nobjective:",
            "line 7: design.joints: joint boom",
        ),
    ],
)
def test_a_joint_that_occurs_twice_is_refused(
    tmp_path: Path, old: str, new: str, says: str
):
    assert old in MAPPINGS
    with pytest.raises(SettingsError, match=f"{says} occurs twice"):
        hydroid.load_settings(written(tmp_path, MAPPINGS.replace(old, new)))


def test_a_joint_inherits_what_it_does_not_say() -> None:
    settings = LogSettings.model_validate(
        {
            "command": {"column": ["up{joint}", "down{joint}"], "scale": 10},
            "angle": {"unit": "rad"},
            "joints": {
                2: {"command": {"offset": 1}},
                3: {"angle": {"column": "elbow"}},
                4: None,
            },
        }
    )
    assert settings.columns("command", 1) == ColumnMap(("up1", "down1"), "%", scale=10)
    assert settings.columns("command", 2) == ColumnMap(
        ("up2", "down2"), "%", scale=10, offset=1
    )
    assert settings.columns("angle", 3) == ColumnMap(("elbow",), "rad")
    assert settings.columns("command", 4) is None
    assert settings.columns("angle", 4) is None


def test_an_estimate_may_be_larger_than_settings(tmp_path: Path):
    """It has a covariance of all parameters, which of a hundred of them is 300 KiB."""
    file = tmp_path / "estimate.yaml"
    file.write_text(
        "parameters:\n"
        + "".join(f"  P_{number}: 0.25{' ' * 300}\n" for number in range(1000))
    )
    with pytest.raises(SettingsError, match="larger than 256 KiB"):
        read_yaml(file)
    _, values, _ = read_estimate(file)
    assert len(values) == 1000
    assert set(values.values()) == {0.25}
