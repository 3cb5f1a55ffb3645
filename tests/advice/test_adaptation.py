"""A fit is moved to a changed machine by what changed, and nothing else."""

import pytest
from two_joints import TRUTH, drive, two_joints

import hydroid
from hydroid.advice.adaptation import adapted, steps
from hydroid.errors import SettingsError
from hydroid.identified_model import identified

SLOWER = TRUTH | {"flow": 90.0}


def test_what_changed_is_freed_and_found(tmp_path):
    settings = two_joints(tmp_path)
    model, log = identified(settings, TRUTH, "a fit"), drive(settings, 3, SLOWER)
    path = steps(model, [log])
    assert [step["parameter"] for step in path] == ["", "flow"]
    assert max(path[1]["left_out_deg"].values()) < 0.3 * max(path[0]["left_out_deg"].values())
    result = hydroid.adapt(log, fit=model, free="flow", out=tmp_path / "run")
    assert result.summary.values["flow"] == pytest.approx(90.0, rel=0.02)
    assert {n: v for n, v in result.summary.values.items() if n != "flow"} == {
        n: v for n, v in TRUTH.items() if n != "flow"
    }
    hydroid.load_plant(tmp_path / "run").reset()


def test_an_unchanged_machine_needs_no_adaptation(tmp_path):
    settings = two_joints(tmp_path)
    model = identified(settings, TRUTH, "a fit")
    assert [step["parameter"] for step in steps(model, [drive(settings, 4)])] == [""]
    with pytest.raises(SettingsError, match="no parameter lowers the error"):
        hydroid.adapt(drive(settings, 4), fit=model, out=None)


def test_what_cannot_be_freed_is_refused(tmp_path):
    model = identified(two_joints(tmp_path), TRUTH, "a fit")
    with pytest.raises(SettingsError, match="no parameter 'slip'"):
        adapted(model, ["slip"])
