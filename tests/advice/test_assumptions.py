"""A wrong sign of an angle, and exchanged columns, are named; right ones are not."""

from dataclasses import replace

import numpy as np
import pytest
from arms import BOOM
from two_joints import drive, two_joints

from hydroid.advice.assumptions import assumption_findings, doubts, exchanged


@pytest.mark.parametrize("wrong", [None, "lift", "tilt"])
def test_a_wrong_sign_is_named_and_no_right_one(tmp_path, wrong):
    logs = [drive(two_joints(tmp_path), seed) for seed in range(6)]
    turned = BOOM.replace(
        f'name="{wrong}" axis="0 -1 0"', f'name="{wrong}" axis="0 1 0"'
    )
    settings = two_joints(tmp_path, turned)
    found = assumption_findings(settings, logs, doubts(settings, logs))
    names = [(finding.kind, *finding.subjects) for finding in found]
    assert names[:1] == ([("sign doubted", wrong)] if wrong else [])


def test_a_wrong_sign_is_named_wherever_a_joint_without_stops_stands(tmp_path):
    """Its angles may lie turns away from 0."""
    logs = [drive(two_joints(tmp_path), seed) for seed in range(6)]
    endless = BOOM.replace(' range="-60 60"', "")
    turned = endless.replace('name="tilt" axis="0 -1 0"', 'name="tilt" axis="0 1 0"')
    settings = two_joints(tmp_path, turned)
    assert settings.arm.joint(2).continuous
    away = np.array([0.0, 4 * np.pi])
    far = [replace(log, angle=log.angle + away) for log in logs]
    for several in (logs, far):
        (found, *_) = assumption_findings(settings, several, doubts(settings, several))
        assert (found.kind, *found.subjects) == ("sign doubted", "tilt")


def test_exchanged_commands_are_named(tmp_path):
    settings = two_joints(tmp_path)
    log = drive(settings)
    for command, pairs in (
        (log.command, ()),
        (log.command[:, ::-1], ((1, 2),)),
        (0 * log.command, ()),
    ):
        assert exchanged(settings, [replace(log, command=command)]) == pairs


def test_logs_that_cannot_tell_name_nothing(tmp_path):
    """Too short, without motion, or with a joint that is not measured."""
    settings = two_joints(tmp_path)
    log = drive(settings)
    unmeasured = log.angle * np.where([True, False], 1.0, np.nan)
    still = replace(log, angle=np.tile(log.angle[:1], (len(log.angle), 1)))
    noise = replace(log, command=log.command * [1.0, 0.02])
    for one in (log.first(1.0), still, replace(log, angle=unmeasured)):
        assert doubts(settings, [one]) == {}
        assert exchanged(settings, [one]) == ()
    # of a joint whose lever shows noise alone
    assert 2 not in doubts(settings, [noise])
