"""Every unit of the table is accepted by settings, and what `check` proposes reads the
log rightly."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from log_files import NAMES, cells, lines, place, read, save

from hydroid.log import Log, LogFinding, check_log, guess_columns, open_table
from hydroid.log.mapping import Ranges
from hydroid.settings.log import ANGLES, LENGTHS, PRESSURES, LogSettings
from hydroid.units import UNITS, units_of

RANGES = {"1": (-0.5, 1.5), "2": (-1.0, 1.0)}
T = 0.01 * np.arange(400)
ANGLE = 0.5 + 0.9 * np.sin(2 * T)
"""of joint 1 [rad], most of its range"""
TRAVEL = 0.6 + 0.5 * np.sin(2 * T)
"""of a joint that slides [m]"""


def write(path: Path, name: str, angle: np.ndarray) -> Path:
    """Write a log of joint 1, whose angle has a column of a name."""
    values = np.stack([T, 60 * np.sign(np.cos(2 * T)), angle], axis=1)
    header = ["time_s", "u1_pct", name]
    return save(path, [header, *([f"{x:.12g}" for x in row] for row in values)])


def settings(name: str, unit: str) -> LogSettings:
    joint = {"command": {"column": "u1_pct"}, "angle": {"column": name, "unit": unit}}
    mapping = {"command": None, "angle": None, "joints": {1: joint}}
    return LogSettings.model_validate(mapping)


def check(path: Path, given: LogSettings) -> tuple[Log | None, list[LogFinding]]:
    ranges: Ranges = {"boom": RANGES["1"]}
    return check_log(path, given, ranges)


def proposed(findings: list[LogFinding]) -> set[str]:
    """Return the units that findings tell to set."""
    units = set[str]()
    for finding in findings:
        _, is_there, unit = str(finding).partition(".angle.unit: ")
        if is_there:
            units.add(unit.split()[0])
    return units


def test_settings_take_every_unit_of_the_table():
    for kind, units in (("angle", (*ANGLES, *LENGTHS)), ("pressure", PRESSURES)):
        for unit in units:
            given = LogSettings.model_validate({kind: {"unit": unit}})
            columns = given.columns(kind, 1)
            assert columns is not None
            assert columns.unit == unit
    for unit in units_of("time"):
        assert LogSettings.model_validate({"time": {"unit": unit}}).time.unit == unit


@pytest.mark.parametrize("wrong", ["deg", "rad"])
@pytest.mark.parametrize("unit", ANGLES)
def test_check_proposes_the_unit_that_a_file_states(
    unit: str, wrong: str, tmp_path: Path
):
    name = f"boom [{unit}]"
    path = write(tmp_path / "log.csv", name, ANGLE / UNITS[unit].factor)
    _, findings = check(path, settings(name, wrong))
    expected = set() if unit == wrong else {unit}
    assert proposed(findings) == expected
    log, findings = check(path, settings(name, unit))
    assert log is not None
    assert not proposed(findings)
    np.testing.assert_allclose(log.angle[:, 0], ANGLE, atol=1e-9)


@pytest.mark.parametrize("wrong", ANGLES)
@pytest.mark.parametrize("unit", ANGLES)
def test_check_proposes_the_unit_of_angles_far_outside(
    unit: str, wrong: str, tmp_path: Path
):
    """No unit is stated, and all angles are above 0 of a joint of a small range."""
    angle = 1.0 + 0.45 * np.sin(2 * T)
    path = write(tmp_path / "log.csv", "boom", angle / UNITS[unit].factor)
    low, high = 0.5, 1.5
    given = settings("boom", wrong)
    _, findings = check_log(path, given, {"boom": (low, high)})
    assert proposed(findings) == (set() if unit == wrong else {unit})


@pytest.mark.parametrize("unit", LENGTHS)
def test_init_takes_a_position_in_every_unit(unit: str, tmp_path: Path):
    name = f"q1 [{unit}]"
    path = write(tmp_path / "log.csv", name, TRAVEL / UNITS[unit].factor)
    guess = guess_columns([open_table(path)], ["tele"], slides=[1])
    log, _ = read(path, LogSettings.model_validate(guess.log), {"tele": (0.0, 1.2)})
    np.testing.assert_allclose(log.angle[:, 0], TRAVEL, atol=1e-9)


@pytest.mark.parametrize("unit", ANGLES)
def test_an_angle_that_counts_the_other_way_keeps_its_unit(unit: str, tmp_path: Path):
    """The joint's range is from −0.5 to 1.5 rad, and the sensor's from −1.4 to 0.4."""
    path = write(tmp_path / "log.csv", "boom", -ANGLE / UNITS[unit].factor)
    _, (finding, *_) = check(path, settings("boom", unit))
    assert "set log.joints.boom.angle.scale: -1" in str(finding)


def test_pressures_in_another_unit_than_the_file_states(tmp_path: Path):
    values = np.hstack([cells(), np.full((80, 2), 120.0)])
    names = [*NAMES, "pA [kPa]", "pB [kPa]"]
    rows = [names, *lines(values)[1:]]
    path = save(tmp_path / "log.csv", rows)
    pressure = {"pressure": {"column": names[-2:]}}
    given = LogSettings.model_validate({"joints": {1: pressure}})
    ranges = {"1": RANGES["1"], "2": (-np.inf, np.inf)}
    _, findings = read(path, given, ranges)
    (first, *_) = [one for one in findings if one.kind == "unit"]
    assert place(first) == "column pA [kPa]"
    assert "set log.joints.1.pressure.unit: kPa" in str(first)


GON = """
import sys
from math import pi
from pathlib import Path

from hydroid.units import UNITS, Unit

UNITS["gon"] = Unit("gon", "angle", pi / 200)

import numpy as np
from hydroid.log import check_log, guess_columns, open_table
from hydroid.settings.log import LogSettings

path = Path(sys.argv[1])
ranges = {"boom": (-0.5, 1.5)}
columns = {"column": "boom [gon]", "unit": "rad"}
for unit in ("rad", "deg"):
    columns["unit"] = unit
    joint = {"command": {"column": "u1_pct"}, "angle": columns}
    given = {"command": None, "angle": None, "joints": {1: joint}}
    _, findings = check_log(path, LogSettings.model_validate(given), ranges)
    assert any("unit: gon" in str(one) for one in findings), findings
columns["unit"] = "gon"
log, findings = check_log(path, LogSettings.model_validate(given), ranges)
assert "unit" not in str(findings), findings
assert guess_columns([open_table(path)], ["boom"]).log["joints"][1]["angle"] == columns
np.testing.assert_allclose(log.angle[:, 0], np.loadtxt(sys.argv[2]), atol=1e-9)
"""


def test_a_unit_that_is_added_to_the_table_is_known_everywhere(tmp_path: Path):
    path = write(tmp_path / "log.csv", "boom [gon]", ANGLE * 200 / np.pi)
    np.savetxt(tmp_path / "angle.txt", ANGLE)
    arguments = [sys.executable, "-c", GON, str(path), str(tmp_path / "angle.txt")]
    result = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
