"""A fit is moved to a changed machine by what changed, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from two_joints import PARAMETERS, PERIOD, TRUTH, drive, two_joints

import hydroid
from hydroid.advice.adaptation import adapted, load_findings, steps
from hydroid.errors import SettingsError
from hydroid.fitting.baselines import NAMES
from hydroid.fitting.verdict import behind
from hydroid.identified_model import identified
from hydroid.joint_verdict import JointVerdict, Verdict
from hydroid.progress import no_progress

SLOWER = TRUTH | {"flow": 90.0}


def test_what_changed_is_freed_and_found(tmp_path):
    # one of the fit's own logs
    settings = two_joints(tmp_path, payloads={"loaded.csv": 5.0})
    model, log = identified(settings, TRUTH, "a fit"), drive(settings, 3, SLOWER)
    path = steps(model, [log], (), no_progress)
    assert [step["parameter"] for step in path] == ["", "flow"]
    assert max(path[1]["left_out_deg"].values()) < 0.3 * max(
        path[0]["left_out_deg"].values()
    )
    result = hydroid.adapt(log, fit=model, free="flow", out=tmp_path / "run")
    assert result.summary.values["flow"] == pytest.approx(90.0, rel=0.02)
    assert result.summary.values | {"flow": TRUTH["flow"]} == TRUTH
    hydroid.load_plant(tmp_path / "run").reset()


def test_an_unchanged_machine_needs_no_adaptation(tmp_path):
    settings = two_joints(tmp_path)
    model = identified(settings, TRUTH, "a fit")
    assert [
        step["parameter"]
        for step in steps(model, [drive(settings, 4)], (), no_progress)
    ] == [""]
    with pytest.raises(SettingsError, match="no parameter lowers the error"):
        hydroid.adapt(drive(settings, 4), fit=model, out=None)


def test_an_effect_of_a_new_day_is_freed_for_one_joint(tmp_path):
    """The other joint errs by more, and by what nothing here can explain."""
    day = {"quantity": "dead_band", "joints": [1], "sd": 3, "per": "group"}
    grouped = {"log": {"period_s": PERIOD, "groups": {"monday": "mon_*"}}}
    settings = two_joints(tmp_path, parameters=PARAMETERS | {"day": day}, **grouped)
    model = identified(settings, TRUTH | {"day_monday": 0.5, "day_other": 0.0}, "a fit")
    log = drive(settings, 3, TRUTH | {"day_monday": 0.0, "day_other": -2.0})
    log.angle[:, 1] += np.radians(2.0) * np.sin(log.time)
    first, then, *_ = steps(model, [log], (), no_progress)
    assert then["parameter"] == "day_other"
    assert then["left_out_deg"]["lift"] < 0.7 * first["left_out_deg"]["lift"]
    assert then["left_out_deg"]["tilt"] == pytest.approx(
        first["left_out_deg"]["tilt"], rel=0.05
    )


def test_a_load_is_said_to_be_a_payload_and_one_that_is_stated_moves_no_mass(tmp_path):
    settings = two_joints(tmp_path, payloads={"loaded.csv": 5.0})
    model, log = identified(settings, TRUTH, "a fit"), drive(settings, 3)
    (said,) = load_findings(adapted(model, ["flow", "M_boom"], [log]))
    assert "M_boom may stand for a load" in str(said)
    assert "--set 'payloads={LOG: KG}'" in str(said)
    assert load_findings(adapted(model, ["flow"], [log])) == ()
    loaded = adapted(model, ["M_boom"], [replace(log, source="day 2/loaded.csv")])
    assert loaded.payloads == {"loaded.csv": 5.0}
    assert load_findings(loaded) == ()
    assert adapted(model, ["M_boom"], [log]).payloads == {}


def test_an_adaptation_names_no_seed_which_it_does_not_have(tmp_path):
    settings = two_joints(tmp_path)
    joint = JointVerdict(
        joint=1, name="lift", verdict=Verdict.MISFIT, fitted_deg=2, tolerance_deg=1
    )
    bad = [joint.changed({"baselines_deg": {NAMES[-1]: 1.0}})]
    alone = adapted(identified(settings, TRUTH, "a fit"), ["flow"])
    assert (settings.seeded, alone.seeded) == (True, False)
    for own in (settings, alone):
        (said,) = behind(own, bad)
        assert ("seed" in str(said)) == own.seeded


def test_settings_of_a_model_that_is_read_are_not_replaced_in_silence(tmp_path):
    settings = two_joints(tmp_path)
    model, log = identified(settings, TRUTH, "a fit"), drive(settings)
    with pytest.raises(
        SettingsError, match="payloads: cannot be replaced in a model that is read"
    ):
        hydroid.adapt(log, fit=model, set={"payloads": {"drive_0.csv": 5.0}})
    with pytest.raises(
        SettingsError, match="duration_s: cannot be replaced in a model that is read"
    ):
        hydroid.design(log, fit=model, duration=5.0)


def test_what_cannot_be_freed_is_refused(tmp_path):
    model = identified(two_joints(tmp_path), TRUTH, "a fit")
    with pytest.raises(SettingsError, match="no parameter 'slip'"):
        adapted(model, ["slip"])
