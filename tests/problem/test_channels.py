"""Channels: weights of joints, chamber pressures, and logs with a payload."""

from dataclasses import replace

import numpy as np
import pytest
from arms import posed
from made_logs import HYDRAULIC, TRUTH, simulate_log, step_log

from hydroid import fit, load_settings, read_logs
from hydroid.arm.model import add_payload
from hydroid.errors import SettingsError
from hydroid.log import check_log, write_log
from hydroid.problem.problem import Problem

MECHANICAL = {name: value for name, value in TRUTH.items() if name != "K"}
TRUTH_2 = MECHANICAL | HYDRAULIC
FIXED = {f"parameters.{name}.fixed": value for name, value in MECHANICAL.items()}
FIXED |= {f"parameters.{name}.fixed": None for name in ("F1", "x1", "x2")}
PRESSURE = {"log.pressure": {"column": ["pA{joint}", "pB{joint}"], "unit": "MPa"}}


@pytest.fixture(scope="module")
def hydraulic():
    changes = (
        FIXED | PRESSURE | {"objective.pressure_weight": 0.1, "objective.segments": 3}
    )
    settings = load_settings("article-hyd", changes)
    log = step_log(settings.arm.pose("rig"), [50.0, -60.0, 40.0])
    return settings, simulate_log(settings, log, TRUTH_2)


def test_the_truth_leaves_no_error_in_any_channel(hydraulic):
    settings, log = hydraulic
    problem = Problem(settings, [log])
    assert [c.quantity for c in problem.channels] == [
        "angle",
        "pressure_a",
        "pressure_b",
    ]
    truth = problem.parameters.vector(TRUTH_2, "truth")
    rows = problem.output_errors(truth[None])
    assert rows.shape == (1, 3 * len(log.time))
    assert np.abs(rows).max() < 1e-12
    assert problem.evaluate(truth[None]).shape == (1, 3 + 2 + 1)


def test_a_pressure_error_counts_its_weight(hydraulic):
    settings, log = hydraulic
    off = replace(log, pressure=log.pressure + 3e5)
    problem = Problem(settings, [off])
    rows = problem.output_errors(problem.parameters.vector(TRUTH_2, "truth")[None])[0]
    for channel in problem.channels[1:]:
        assert np.rad2deg(rows[channel.rows]) == pytest.approx(0.1 * 3.0)
    assert problem.rms(rows[None])[0] < 1e-12  # the error of angles alone


def test_pressures_do_not_change_the_angles(hydraulic):
    settings, log = hydraulic
    without = settings.changed({"objective.pressure_weight": 0})
    sets = Problem(settings, [log]).parameters.from_unit(
        np.random.default_rng(0).random((5, 10))
    )
    with_, bare = (Problem(s, [log]).responses(sets)[0] for s in (settings, without))
    assert np.array_equal(with_.angle, bare.angle, equal_nan=True)
    assert not bare.pressure.size


def test_pressures_survive_a_file(hydraulic, tmp_path, arm):
    settings, log = hydraulic
    columns = {"log.joints": {j: {"pressure": None} for j in (1, 3, 4, 5, 6, 7)}}
    settings = load_settings("article-hyd", FIXED | PRESSURE | columns)
    write_log(tmp_path / "log.csv", log, settings.log)
    assert "pA2,pB2" in (tmp_path / "log.csv").read_text().splitlines()[0]
    again, _ = check_log(tmp_path / "log.csv", settings.log, arm.ranges)
    assert again.pressure[:, 1] == pytest.approx(log.pressure[:, 1], rel=1e-8)
    assert np.isnan(again.pressure[:, 0]).all()


def mechanical(**changes):
    settings = load_settings("article-mech", {"objective.segments": 2} | changes)
    log = step_log(settings.arm.pose("study"), [60.0, -80.0, 30.0])
    return settings, log, TRUTH


def test_weights_scale_the_errors_of_their_joint():
    settings, log, truth = mechanical(outputs=[2, 3])
    weighted, *_ = mechanical(outputs=[2, 3], **{"objective.weights": {3: 0.25}})
    one, other = Problem(settings, [log]), Problem(weighted, [log])
    theta = one.parameters.vector(truth, "truth")[None]
    plain, scaled = one.output_errors(theta)[0], other.output_errors(theta)[0]
    shoulder, elbow = (c.rows for c in one.channels)
    assert np.array_equal(scaled[shoulder], plain[shoulder])
    assert scaled[elbow] == pytest.approx(0.25 * plain[elbow])
    assert other.rms(scaled[None]) == pytest.approx(one.rms(plain[None]))


def test_a_payload_pulls_on_the_shoulder_with_its_weight_times_its_lever(arm, spec):
    """Stretched forward the payload's place is 0.5 + 0.4 + 0.15 + 0.12 + 0.23 m before
    the shoulder."""
    models = (spec.compile(), add_payload(spec, arm, 5.0).compile())
    empty, loaded = (posed(model, 0.0).qfrc_bias[1] for model in models)
    assert loaded - empty == pytest.approx(5.0 * 9.81 * 1.40, rel=1e-12)


def test_a_payload_slows_the_arm_of_its_log_alone():
    settings, log, truth = mechanical(payloads={"steps": 5.0})
    other = replace(log, source="elsewhere/other.csv")
    loaded, empty = (
        simulate_log(settings, x, truth).angle[50, 1] for x in (log, other)
    )
    assert abs(loaded - log.angle[0, 1]) < abs(empty - log.angle[0, 1])
    # without a site it hangs at the end of the last link, and pulls as well
    bare = simulate_log(settings.changed({"arm.payload": None}), log, truth)
    assert bare.angle[50, 1] != empty
    assert bare.angle[50, 1] == pytest.approx(loaded, rel=0.1)


def test_a_payload_of_no_log_is_refused(tmp_path):
    settings, log, truth = mechanical(payloads={"heavy.csv": 5.0})
    write_log(tmp_path / "light.csv", simulate_log(settings, log, truth), settings.log)
    with pytest.raises(SettingsError, match="none of the logs"):
        fit(settings, read_logs([tmp_path / "light.csv"], settings), tmp_path / "out")
    assert not (tmp_path / "out").exists()
