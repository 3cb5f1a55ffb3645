"""A population: no neighbour, no thread and no candidate that fails changes a bit of
another."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from conftest import replaced, scattered, simulation

each_kind = pytest.mark.parametrize("kind", ["mech", "hyd"])


@pytest.fixture
def make(spec, arm, study_log):
    return partial(simulation, spec, arm, study_log)


@each_kind
@pytest.mark.parametrize("other", ["locked", "passive", "measured"])
def test_threads_and_neighbours_change_no_bit(arm, make, kind, other):
    everyone = scattered(arm, 7)
    together = make(kind=kind, other_joints=other, threads=1).simulate(everyone).angle
    assert np.ptp(together, axis=1).min() > np.deg2rad(0.2)
    for threads in (2, 5):
        again = (
            make(kind=kind, other_joints=other, threads=threads)
            .simulate(everyone)
            .angle
        )
        np.testing.assert_array_equal(again, together)
    alone = make(kind=kind, other_joints=other)
    # large after small and small after large: the buffers of one call leave nothing to
    # the next
    for rows in (slice(3, 5), slice(0, 7), slice(6, 7)):
        np.testing.assert_array_equal(
            alone.simulate(everyone[rows]).angle, together[rows]
        )


@pytest.mark.parametrize(
    ("kind", "other", "spoiled"),
    [
        # explicit at 0.01 s: blows up
        ("mech", "passive", {"damping": 0.0, "stiffness": 1e9}),
        ("hyd", "passive", {"stiffness": 1e9}),
        ("hyd", "locked", {"force_2": 100.0}),  # the force would grow with the stroke
    ],
)
def test_a_set_that_cannot_be_simulated_is_marked_and_harms_nobody(
    arm, make, kind, other, spoiled, capfd, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    everyone = scattered(arm, 4)
    run = make(kind=kind, other_joints=other).simulate
    healthy = run(everyone).angle
    columns = {name: everyone.joints[name].copy() for name in spoiled}
    for name, column in columns.items():
        column[2] = spoiled[name]
    capfd.readouterr()
    response = run(replaced(everyone, **columns))
    np.testing.assert_array_equal(
        np.isfinite(response.angle).all(axis=(1, 2)), [True, True, False, True]
    )
    assert np.isnan(response.angle[2]).all()
    np.testing.assert_array_equal(response.angle[[0, 1, 3]], healthy[[0, 1, 3]])
    assert np.isnan(run(replaced(everyone, **spoiled)).angle).all()
    # and nothing is left of it
    np.testing.assert_array_equal(run(everyone).angle, healthy)
    assert capfd.readouterr() == ("", "")
    assert not Path("MUJOCO_LOG.TXT").exists()
