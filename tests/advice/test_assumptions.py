"""A wrong sign of an angle, and exchanged columns, are named; right ones are not."""

from dataclasses import replace

import numpy as np
import pytest
from arms import BOOM
from two_joints import TRUTH, drive, two_joints

from hydroid.advice.assumptions import assumption_findings, doubts, exchanged
from hydroid.fitting.refinement import refine
from hydroid.problem.problem import Problem
from hydroid.settings.search import RefinementSettings


@pytest.mark.parametrize("wrong", [None, "lift", "tilt"])
def test_a_wrong_sign_is_named_and_no_right_one(tmp_path, wrong):
    logs = [drive(two_joints(tmp_path), seed) for seed in range(2)]
    turned = BOOM.replace(f'name="{wrong}" axis="0 -1 0"', f'name="{wrong}" axis="0 1 0"')
    problem = Problem(two_joints(tmp_path, turned), logs)
    start = problem.parameters.started(TRUTH)
    theta = problem.parameters.from_unit(refine(problem, start, RefinementSettings(iterations=20)).point)
    found = doubts(problem, theta)
    assert [problem.settings.arm.joint_names[doubt.joint - 1] for doubt in found[:1]] == [wrong][
        : wrong is not None
    ]
    for doubt in found[:1]:
        assert doubt.rms_deg[1] < 0.5 * doubt.rms_deg[0]
    names = [(finding.kind, *finding.subjects) for finding in assumption_findings(problem, found[:1])]
    assert names == ([("sign doubted", wrong)] if wrong else [])


def test_exchanged_commands_are_named(tmp_path):
    log = drive(two_joints(tmp_path))
    assert exchanged([log]) == ()
    assert exchanged([replace(log, command=log.command[:, ::-1])]) == ((1, 2),)
    assert exchanged([replace(log, command=np.zeros_like(log.command))]) == ()
