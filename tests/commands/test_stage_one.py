"""What stage 2 takes from stage 1, and what it says about it."""

import logging
from pathlib import Path

import pytest

import hydroid
from hydroid.commands.stages import with_mechanics
from hydroid.estimate import FitSummary, ParameterEstimate, write_estimate
from hydroid.identified_model import write_settings

VALUES = {"D": 80.0, "S": 0.0, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}


def test_a_mass_that_stage_1_moved_without_knowing_it_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    """The arm's file has 5.1 and 22.5 kg: M2 was moved, M3 stayed, and the logs know M4."""
    flags = {
        "M2": (8.0, "weakly identifiable"),
        "M3": (22.6, "not identifiable"),
        "M4": (3.0, "identifiable"),
    }
    flags |= dict.fromkeys(("M1", "M5", "M6"), (4.4, "fixed"))
    known = {n: ParameterEstimate(value=v, unit="kg", flag=flag) for n, (v, flag) in flags.items()}
    known["D"] = ParameterEstimate(value=300.0, unit="N·m·s/rad", flag="not identifiable")
    write_estimate(tmp_path, FitSummary(stage="mech", estimate=known))
    with caplog.at_level(logging.WARNING, "hydroid"):
        changes = with_mechanics(tmp_path, "fit-hyd", {})
    assert changes["parameters.M2.fixed"] == 8.0
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith(
        "M2 is held at 8 kg: stage 1 moved it from 5.1 kg, but its logs do not"
    )


def test_stage_two_takes_masses(tmp_path: Path):
    mech = tmp_path / "mech"
    write_settings(mech, hydroid.load_settings("fit-mech", {"start_pose": "study"}))
    estimate = {name: ParameterEstimate(value=v, unit="?") for name, v in VALUES.items()}
    write_estimate(mech, FitSummary(stage="mech", estimate=estimate, final="best"))
    changes = with_mechanics(mech, "fit-hyd", {"log.delay_s": 0.2})
    settings = hydroid.load_settings("fit-hyd", changes)
    assert settings.log.delay_s == 0.2
    # the masses hold; the damping and the spring of stage 2 have a start and a value of their own
    masses = {name: value for name, value in VALUES.items() if name.startswith("M")}
    assert {name: settings.parameters[name].fixed for name in masses} == masses
    assert settings.parameters["D"].fixed is None
    assert settings.parameters["S"].fixed == 0.0
