"""`init` recognises an engine's speed and an oil's temperature, and says what can be told
of them."""

import numpy as np
import pytest

import hydroid

pytestmark = pytest.mark.usefixtures("no_picture", "short_searches")
TIME = np.arange(0.0, 20.0, 0.02)
SPEED = np.round(np.interp(TIME, [0, 5, 12, 20], [900, 2100, 1200, 1800]), 1)


def written(path, **columns):
    """A log of a boom that follows its command, with further columns."""
    command = np.where(TIME < 1, 0.0, 60 * np.sign(np.sin(0.8 * TIME)))
    speed = np.where(np.roll(command, 5) == 0, 0.0, 8.0 * np.roll(command, 5) / 60)
    table = {
        "time_s": TIME,
        "boom_cmd_pct": command,
        "boom_deg": np.round(10 + np.cumsum(speed) * 0.02, 3),
    } | columns
    rows = np.column_stack([np.asarray(one, dtype=str) for one in table.values()])
    path.write_text("\n".join([",".join(table), *map(",".join, rows.tolist())]))
    return path


def project(tmp_path, *logs):
    made = hydroid.init(
        tmp_path / "mine", joints=["boom"], lengths=[2.0], log=[*logs]
    ).result
    return made, hydroid.load_settings(tmp_path / "mine" / "fit.yaml")


def test_columns_that_vary_are_parameters_of_the_fit(tmp_path):
    logs = [
        written(
            tmp_path / f"{k}.csv", engine_rpm=SPEED + 200 * k, oil_temp_F=110 + TIME
        )
        for k in range(2)
    ]
    made, settings = project(tmp_path, *logs)
    engine, oil = settings.log.engine_speed, settings.log.oil_temperature
    assert (engine.column, engine.unit) == ("engine_rpm", "rpm")
    both = np.concatenate([SPEED, SPEED + 200])
    assert engine.reference == pytest.approx(np.median(both), rel=1e-3)
    assert (oil.column, oil.unit) == ("oil_temp_F", "degF")
    quantities = {one.quantity for one in settings.parameters.values()}
    assert {"engine_exponent", "temperature_effect"} <= quantities
    assert any("engine_rpm: the engine's speed, 900 to" in why for why in made.columns)
    assert not {"engine_rpm", "oil_temp_F"} & {*made.unused}


def test_of_what_does_not_vary_there_is_no_parameter_and_that_is_said(tmp_path):
    log = written(tmp_path / "a.csv", engine_rpm=np.full(len(TIME), 1800))
    _, settings = project(tmp_path, log)
    assert settings.log.engine_speed.reference == 1800
    quantities = {one.quantity for one in settings.parameters.values()}
    assert "engine_exponent" not in quantities
    text = (tmp_path / "mine" / "fit.yaml").read_text()
    assert "The logs hold one engine speed: its effect cannot be told." in text


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({}, "not used, for"),
        ({"engine_rpm": np.where(TIME < 1, 0.0, SPEED)}, "it is off at times"),
    ],
)
def test_a_column_that_another_log_cannot_give_is_left_out(tmp_path, other, said):
    logs = [
        written(tmp_path / "a.csv", engine_rpm=SPEED),
        written(tmp_path / "b.csv", **other),
    ]
    made, settings = project(tmp_path, *logs)
    assert settings.log.engine_speed is None
    (why,) = [line for line in made.columns if line.startswith("engine_rpm")]
    assert said in why
    # and no log is lost by it
    assert "b.csv" in " ".join(made.commands)


def test_settings_that_a_person_completed_keep_their_reference(tmp_path):
    log = written(tmp_path / "a.csv", engine_rpm=SPEED)
    project(tmp_path, log)
    config = tmp_path / "mine" / "fit.yaml"
    text = config.read_text()
    given = hydroid.load_settings(config).log.engine_speed.reference
    config.write_text(text.replace(f"reference: {given}", "reference: 2000"))
    hydroid.init(config=config, log=log)
    again = hydroid.load_settings(config)
    assert again.log.engine_speed.reference == 2000
    assert "engine" in again.parameters
