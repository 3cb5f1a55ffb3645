"""Every joint does one thing while an arm is simulated."""

import numpy as np
import pytest

from hydroid.simulation.roles import Roles, roles

ACTIVE = np.array([False, True, True, False, False])


def names(found: Roles) -> list[str]:
    """What each joint does, in a word."""
    kinds = {
        "active": found.active,
        "passive": found.passive,
        "following": found.following,
        "locked": ~found.moving,
    }
    masks = np.array([*kinds.values()])
    assert (masks.sum(axis=0) == 1).all()
    return [[*kinds][row] for row in masks.argmax(axis=0)]


@pytest.mark.parametrize(
    ("others", "logged", "what"),
    [
        ("locked", True, "locked"),
        ("passive", True, "passive"),
        ("passive", False, "passive"),
        ("measured", True, "following"),
        ("measured", False, "locked"),
    ],
)
def test_a_joint_that_is_not_active_does_what_the_setting_says(others, logged, what):
    found = roles(ACTIVE, others, logged=logged)
    assert names(found) == [what, "active", "active", what, what]


@pytest.mark.parametrize("others", ["locked", "passive", "measured"])
def test_what_follows_a_log_is_not_simulated(others):
    found = roles(ACTIVE, others)
    assert not (found.simulated & found.following).any()
    assert (found.moving == (found.simulated | found.following)).all()
