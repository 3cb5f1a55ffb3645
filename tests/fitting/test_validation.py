"""A prediction in Python: by the names of joints, in degrees, as a table, and in three
lines."""

from dataclasses import replace

import numpy as np
import pytest
from report_fits import make_fit, make_prediction, make_problem

from hydroid.fitting.validation import JointPrediction, Prediction, fitted

PROBLEM = make_problem(("dir/a.csv",), outputs=(2, 3))
(FITTED,) = fitted(make_fit(PROBLEM))


def test_a_joint_is_found_by_name_and_by_number_in_degrees():
    boom = FITTED["shoulder"]
    assert boom.unit == "deg"
    assert boom.error == pytest.approx(np.degrees(FITTED.error(2)))
    assert boom.error == pytest.approx(boom.measured - boom.response)
    assert boom.rms == pytest.approx(np.degrees(FITTED.indices[2].rms))
    assert np.array_equal(FITTED[2].error, boom.error)
    assert boom.half == pytest.approx(np.degrees(FITTED.bands[2].half))
    assert [*FITTED] == ["shoulder", "elbow"]


def test_a_joint_that_slides_is_in_millimetres():
    slid = replace(FITTED, slides=(2,))
    assert slid["shoulder"].unit == "mm"
    assert slid["shoulder"].error == pytest.approx(1e3 * FITTED.error(2))


@pytest.mark.parametrize("joint", ["bucket", 1, 7, "2"])
def test_a_joint_that_is_not_predicted_is_refused_with_those_that_are(joint: str | int):
    with pytest.raises(KeyError, match="there are shoulder and elbow"):
        FITTED[joint]


def test_a_frame_has_the_time_and_all_that_is_known_of_each_joint():
    frame = FITTED.to_frame()
    assert frame.index.name == "time [s]"
    assert len(frame) == len(FITTED.log.time)
    assert [*frame["elbow"].columns] == ["measured", "response", "error", "half"]
    assert frame["elbow", "error"].to_numpy() == pytest.approx(
        np.degrees(FITTED.error(3))
    )
    bare = make_prediction(PROBLEM.logs[0], band=False).to_frame()
    # its joints have no names
    assert [*bare["2"].columns] == ["measured", "response", "error"]


def test_a_prediction_prints_itself_in_three_lines():
    lines = repr(replace(FITTED, fit="hyd", unseen=True)).splitlines()
    assert len(lines) == 3
    assert lines[0] == f"hyd on a.csv: {FITTED.log.duration:.0f} s, unseen"
    assert lines[1].startswith(
        f"rms error: shoulder {FITTED['shoulder'].rms:.3g} deg and elbow "
    )
    assert lines[2] == 'more: prediction["shoulder"].error, prediction.to_frame()'


def test_one_that_diverged_prints_itself_too():
    lost = Prediction("hyd", PROBLEM.logs[0], (2,), np.full((120, 1), np.nan), {}, None)
    assert "rms error: 2 – deg" in repr(lost)


def test_a_joint_prints_itself_in_two_lines():
    time = np.arange(3) * 0.5
    measured = np.array([0.0, 1.0, 2.0])
    one = JointPrediction(
        "boom", "deg", time, measured, measured - np.array([0.0, 3.0, 0.0]), None
    )
    assert repr(one).splitlines() == [
        "boom: rms error 1.73 deg, largest 3 deg at 0.5 s",
        "arrays of 3 samples: time, measured, response, error",
    ]
    lost = JointPrediction("boom", "mm", time, measured, np.full(3, np.nan), measured)
    assert repr(lost).splitlines() == [
        "boom: the simulation diverged",
        "arrays of 3 samples: time, measured, response, error, half (of the 95 % band)",
    ]
