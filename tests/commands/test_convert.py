"""`convert`: what is written reads back to the same bits, with settings or by
guesses."""

import json
from pathlib import Path

import numpy as np
import pytest
from log_files import NAMES, RIG, cells
from log_formats import write_parquet
from typer.testing import CliRunner

import hydroid
from hydroid.commands.app import app
from hydroid.settings.log import LogSettings

SHOULDER, EXCAVATOR = RIG / "rig_shoulder_1.csv", RIG.parent / "excavator"


@pytest.mark.parametrize("name", ["fit_01", "check_04"])
def test_a_jittering_log_with_signs_reads_back_to_the_same_bits(
    name: str, tmp_path: Path
) -> None:
    settings = hydroid.load_settings(EXCAVATOR / "fit.yaml")
    done = hydroid.convert(
        EXCAVATOR / f"{name}.csv", out=tmp_path / "plain.csv", config=settings
    )
    (log,) = hydroid.read_logs(EXCAVATOR / f"{name}.csv", settings)
    plain = settings.model_copy(
        update={"log": LogSettings(period_s=settings.log.period_s)}
    )
    (back,) = hydroid.read_logs(tmp_path / "plain.csv", plain)
    np.testing.assert_array_equal(back.time, log.time)
    np.testing.assert_array_equal(back.command, log.command)
    # degrees that were interpolated in rad: no cell may exist that is read as these
    # very bits
    np.testing.assert_allclose(back.angle, log.angle, rtol=4e-16, atol=0)
    np.testing.assert_array_equal(done.result.log.command, log.command)
    assert done.result.guess is None


def test_a_guessed_log_reads_back_to_the_same_bits(tmp_path: Path) -> None:
    done = hydroid.convert(SHOULDER, out=tmp_path / "plain.csv")
    settings = hydroid.load_settings("fit-mech")
    (log,), (back,) = (
        hydroid.read_logs(path, settings) for path in (SHOULDER, tmp_path / "plain.csv")
    )
    np.testing.assert_array_equal(back.command, log.command)
    np.testing.assert_array_equal(back.angle, log.angle)
    assert done.result.guess is not None
    assert len(done.result.guess.reasons) == 15


def test_the_command_prints_each_guess_and_json(tmp_path: Path) -> None:
    write_parquet(tmp_path / "a.parquet", dict(zip(NAMES, cells(300).T, strict=True)))
    arguments = ["convert", str(tmp_path / "a.parquet"), "-o", str(tmp_path / "a.csv")]
    said = CliRunner().invoke(app, arguments).output
    assert "u2_pct: command in % of joint 2, by its name" in said
    assert "300 samples, 2.99 s, every 0.01 s" in said
    plain = json.loads(CliRunner().invoke(app, [*arguments, "--json"]).output)
    assert plain["log"]["joints"]["1"]["angle"] == {"column": "q1_deg", "unit": "deg"}
