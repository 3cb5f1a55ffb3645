"""Engine speed and oil temperature as columns of a log: read against their references,
written, guessed, and refused in one line where they cannot be."""

import json

import numpy as np
import pytest
from command_line import run
from log_files import cells, head, lines, save

from hydroid import check, load_settings, read_logs
from hydroid.errors import LogError, SettingsError
from hydroid.log import check_log
from hydroid.log.condition_columns import guess_conditions
from hydroid.log.conditions import relative_to
from hydroid.log.read import open_table
from hydroid.log.write import write_log
from hydroid.progress import NOTE
from hydroid.run.folder import samples
from hydroid.settings.load import validate
from hydroid.settings.log import LogSettings

RANGES = {"1": (-0.5, 1.5), "2": (-np.inf, np.inf)}
ENGINE = {"column": "engine_rpm", "unit": "rpm", "reference": 1800.0}
OIL = {"column": "oil_degC", "unit": "degC", "reference": 45.0}
ROWS = 80
SPEED = np.linspace(900.0, 2100.0, ROWS)
WARMTH = np.linspace(30.0, 60.0, ROWS)


def settings(**log):
    return validate(log, LogSettings, "log", {})


def written(path, **columns):
    """A valid log with further columns of numbers or texts."""
    rows = lines(cells(ROWS))
    for name, values in columns.items():
        rows[0].append(name)
        for row, value in zip(rows[1:], values, strict=True):
            row.append(f"{value}")
    return save(path, rows)


def read(path, **log):
    one, findings = check_log(path, settings(**log), RANGES)
    return one, findings


def test_they_are_read_against_their_references(tmp_path):
    path = written(tmp_path / "a.csv", engine_rpm=SPEED, oil_degC=WARMTH)
    log, _ = read(path, engine_speed=ENGINE, oil_temperature=OIL)
    np.testing.assert_allclose(log.conditions[:, 0], SPEED / 1800, rtol=1e-12)
    np.testing.assert_allclose(log.conditions[:, 1], WARMTH - 45, atol=1e-9)
    part = log.part(10, 30)
    np.testing.assert_array_equal(part.conditions, log.conditions[10:30])


@pytest.mark.parametrize(
    ("log", "columns"),
    [
        (
            {"engine_speed": ENGINE | {"unit": "rev/s", "reference": 30.0}},
            {"engine_rpm": SPEED / 60},
        ),
        (
            {"engine_speed": ENGINE | {"scale": 10.0, "offset": -5.0}},
            {"engine_rpm": (SPEED + 5) / 10},
        ),
        (
            {"oil_temperature": OIL | {"unit": "degF", "reference": 113.0}},
            {"oil_degC": 32 + 1.8 * WARMTH},
        ),
    ],
)
def test_units_scales_and_offsets_make_no_difference(tmp_path, log, columns):
    one, _ = read(written(tmp_path / "a.csv", **columns), **log)
    engine = SPEED / 1800 if "engine_speed" in log else np.ones(ROWS)
    warmer = WARMTH - 45 if "oil_temperature" in log else np.zeros(ROWS)
    np.testing.assert_allclose(one.conditions, np.stack([engine, warmer], 1), atol=1e-9)


def test_a_log_at_the_references_is_so_to_the_bit(tmp_path):
    path = written(
        tmp_path / "a.csv", engine_rpm=[1798.3] * ROWS, oil_degC=[45.1] * ROWS
    )
    at = {"reference": 1798.3}, {"reference": 45.1}
    log, _ = read(path, engine_speed=ENGINE | at[0], oil_temperature=OIL | at[1])
    np.testing.assert_array_equal(log.conditions, np.tile([1.0, 0.0], (ROWS, 1)))


def test_without_the_settings_columns_are_not_read(tmp_path):
    plain, _ = read(written(tmp_path / "a.csv"))
    path = written(tmp_path / "b.csv", engine_rpm=SPEED, oil_degC=WARMTH)
    with_columns, _ = read(path)
    assert plain.conditions is with_columns.conditions is None
    assert samples(plain) == samples(with_columns)
    log, _ = read(path, engine_speed=ENGINE)
    assert samples(log) != samples(plain)


def test_they_are_written_as_they_were_read(tmp_path):
    path = written(tmp_path / "a.csv", engine_rpm=SPEED, oil_degC=WARMTH)
    how = {"engine_speed": ENGINE, "oil_temperature": OIL}
    log, _ = read(path, **how)
    write_log(tmp_path / "b.csv", log, settings(**how), exact=True)
    again, _ = read(tmp_path / "b.csv", **how)
    np.testing.assert_allclose(again.conditions, log.conditions, atol=1e-12)


@pytest.mark.parametrize(
    ("log", "columns", "said"),
    [
        ({"engine_speed": ENGINE}, {}, "lacks 'engine_rpm' (engine speed)"),
        (
            {"engine_speed": ENGINE},
            {"engine_rmp": SPEED},
            "did you mean 'engine_rmp'?",
        ),
        (
            {"engine_speed": ENGINE},
            {"engine_rpm": [0.0] * ROWS},
            "engine speed is 0 rpm, allowed are 180 to 18000 rpm",
        ),
        (
            {"engine_speed": ENGINE},
            {"engine_rpm": np.where(SPEED > 2000, -5.0, SPEED)},
            "engine speed is -5 rpm, allowed are 180 to 18000 rpm",
        ),
        (
            {"engine_speed": ENGINE},
            {"engine_rpm": ["idle"] * ROWS},
            "'idle' is not a number",
        ),
        ({"engine_speed": ENGINE}, {"engine_rpm": [""] * ROWS}, "no value is there"),
        (
            {"oil_temperature": OIL},
            {"oil_degC": WARMTH + 273.0},
            "oil temperature is 303 degC, allowed are -60 to 200 degC",
        ),
        ({"oil_temperature": OIL}, {"oil_degC": ["hot"] * ROWS}, "'hot' is not"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path, log, columns, said):
    path = written(tmp_path / "a.csv", **columns)
    one, findings = read(path, **log)
    assert one is None
    (error,) = [finding for finding in findings if finding.level == "error"]
    assert said in str(error)
    assert "\n" not in str(error)


def test_a_few_missing_values_are_rows_left_out(tmp_path):
    speed = [*map(str, SPEED)]
    speed[40] = ""
    log, findings = read(
        written(tmp_path / "a.csv", engine_rpm=speed), engine_speed=ENGINE
    )
    assert log is not None
    assert "row left out" in {finding.kind for finding in findings}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"log.engine_speed": {"column": "n"}}, "log.engine_speed.reference"),
        ({"log.engine_speed": ENGINE | {"reference": 0.0}}, "greater than 0"),
        ({"log.engine_speed": ENGINE | {"unit": "Hz"}}, "rpm"),
        ({"log.oil_temperature": OIL | {"unit": "K"}}, "degC"),
        (
            {"parameters.e.quantity": "engine_exponent", "parameters.e.bounds": [0, 1]},
            "engine_exponent needs the column log.engine_speed",
        ),
        ({"hydraulics.engine_exponent": 2.5}, "engine_exponent"),
    ],
)
def test_wrong_settings_are_refused(changes, said):
    with pytest.raises(SettingsError, match=said.replace(".", r"\.")):
        load_settings("fit-hyd", changes)


RIG_SPEED = np.linspace(900.0, 2100.0, 400)


def rig_log(path, **columns):
    """The beginning of a shipped log, with further columns."""
    rows = [line.split(",") for line in head(path, 400).read_text().splitlines()]
    for name, values in columns.items():
        rows[0].append(name)
        for row, value in zip(rows[1:], values, strict=True):
            row.append(f"{value}")
    return save(path, rows)


def test_check_says_their_ranges_and_what_cannot_be_told(tmp_path, capsys):
    fit = load_settings(
        "fit-hyd", {"log.engine_speed": ENGINE, "log.oil_temperature": OIL}
    )
    warm = [45.0] * 400
    path = rig_log(tmp_path / "a.csv", engine_rpm=RIG_SPEED, oil_degC=warm)
    checked = check(path, config=fit)
    text = "\n".join(map(str, checked.lines))
    assert "engine speed 900 to 2100 rpm; oil temperature 45 to 45 degC" in text
    assert "The oil temperature is nearly the same in all logs" in text
    assert "The engine speed is nearly" not in text
    (log,) = checked.plain()["logs"]
    assert log["engine_speed"] == {
        "from": pytest.approx(900),
        "to": pytest.approx(2100),
        "unit": "rpm",
    }


def test_a_log_without_the_column_is_refused_beside_one_that_has_it(tmp_path, capsys):
    logs = [
        rig_log(tmp_path / "a.csv", engine_rpm=RIG_SPEED),
        rig_log(tmp_path / "b.csv"),
    ]
    how = {"log.engine_speed": ENGINE}
    given = [f"{key}={json.dumps(value)}" for key, value in how.items()]
    changes = [part for one in given for part in ("--set", one)]
    ended = run(("check", *logs, "--config", "fit-hyd", *changes), capsys, code=2)
    (line,) = [one for one in ended.out.splitlines() if one.startswith("error")]
    assert "b.csv" in line
    assert "lacks 'engine_rpm' (engine speed)" in line
    with pytest.raises(LogError, match="engine_rpm"):
        read_logs(logs, load_settings("fit-hyd", how))


def test_commands_alone_need_no_such_column(tmp_path, caplog):
    """They are played as at the references, and that is said."""
    path = rig_log(tmp_path / "a.csv")
    fit = load_settings("fit-hyd", {"log.engine_speed": ENGINE})
    with caplog.at_level(NOTE, "hydroid"):
        (log,) = read_logs(path, fit, angles=False)
    assert log.conditions is None
    assert "taken to be at the reference, 1800 rpm" in caplog.text


def test_conditions_of_a_plant_are_in_the_units_of_the_settings():
    log = settings(
        engine_speed=ENGINE,
        oil_temperature=OIL | {"unit": "degF", "reference": 113.0},
    )
    given = {"engine_speed": 900.0, "oil_temperature": 131.0}
    assert relative_to(log, given) == pytest.approx((0.5, 10.0))
    assert relative_to(log, {}) == (1.0, 0.0)
    for wrong in ({"engine_speed": 0.0}, {"oil_temperature": 1e3}, {"n": 1.0}):
        with pytest.raises(SettingsError):
            relative_to(log, wrong)
    with pytest.raises(SettingsError, match="no effect of it is known"):
        relative_to(settings(), given)


# what the numbers say, with what the name says
NAMED = {
    "engine_rpm": ("engine_speed", "rpm"),
    "Engine Speed [rpm]": ("engine_speed", "rpm"),
    "EngineSpeed": ("engine_speed", "rpm"),
    "engine speed (1/min)": ("engine_speed", "rpm"),
    "rpm": ("engine_speed", "rpm"),
    "motordrehzahl": ("engine_speed", "rpm"),
    "engine_1_rpm": ("engine_speed", "rpm"),
    "slew_motor_rpm": None,
    "motor_1_rpm": None,
    "fan_rpm": None,
    "engine_speed_setpoint": None,
    "engine_load_pct": None,
    "oil_temp_degC": ("oil_temperature", "degC"),
    "OilTemp": ("oil_temperature", "degC"),
    "oil_temp_F": ("oil_temperature", "degF"),
    "hydraulic oil temperature (°C)": ("oil_temperature", "degC"),
    "T_oil [°F]": ("oil_temperature", "degF"),
    "coolant_temp_degC": None,
    "engine_oil_temp": None,
    "oil_pressure_bar": None,
    "temp °C": None,
}


@pytest.mark.parametrize("name", NAMED)
def test_a_column_is_recognised_by_its_name_and_its_unit(tmp_path, name):
    values = SPEED if any(word in name.lower() for word in ("rpm", "speed")) else WARMTH
    if name == "motordrehzahl" or "1/min" in name:
        values = SPEED
    table = open_table(written(tmp_path / "a.csv", **{name: values}))
    guesses = [*guess_conditions([table], ("slew", "boom"), table.names[:5])]
    found = [(guess.name, guess.settings["unit"]) for guess in guesses]
    assert found == ([NAMED[name]] if NAMED[name] else [])
    for guess in guesses:
        assert guess.settings["column"] == name
        assert guess.settings["reference"] == pytest.approx(np.median(values), rel=1e-3)


UNUSED = {
    "off at times": np.where(SPEED < 1000, 0.0, SPEED),
    "off": 0.0 * SPEED,
    "a sensor that fails": np.where(np.arange(ROWS) % 40 < 12, np.nan, SPEED),
    "words": ["idle"] * ROWS,
}


@pytest.mark.parametrize("why", UNUSED)
def test_a_column_that_no_fit_can_read_is_not_used_and_that_is_said(tmp_path, why):
    speed = UNUSED[why]
    table = open_table(written(tmp_path / "a.csv", engine_rpm=speed))
    (guess,) = guess_conditions([table], (), table.names[:5])
    assert guess.settings is None
    assert "not used" in guess.reason


def test_a_slower_channel_is_recognised_and_read(tmp_path):
    """A bus gives the engine's speed in every fifth row."""
    cells = [f"{one:.1f}" if k % 5 == 0 else "" for k, one in enumerate(SPEED)]
    path = written(tmp_path / "a.csv", engine_rpm=cells)
    (guess,) = guess_conditions([open_table(path)], (), ["time_s"])
    log, _ = read(path, engine_speed=guess.settings)
    assert log is not None
    expected = SPEED[: len(log.time)] / guess.settings["reference"]
    np.testing.assert_allclose(log.conditions[:, 0], expected, rtol=1e-3)
