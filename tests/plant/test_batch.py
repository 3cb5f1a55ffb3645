"""Plants in one call, and states saved and restored: the same bits as plants by
themselves."""

import pickle

import numpy as np
import pytest
from made_logs import HYDRAULIC, TRUTH
from made_models import made_model

from hydroid.errors import SettingsError
from hydroid.plant import Plant, PlantBatch
from hydroid.rungs import RUNGS

VALUES = (
    TRUTH | HYDRAULIC | {"open_A": 0.4, "open_B": 0.4, "delay": 0.03, "friction": 100.0}
)
KINDS = ["mech", *(rung.name for rung in RUNGS.values() if rung.stage == "hyd")]
JOINTS = [2, 5]
BENT = np.array([0.0, 0.0, 1.2, 1.0, 0.0, 0.0, 0.0])
"""another pose of joints that are locked between those of JOINTS [rad]"""


def plant(kind: str, **values: float) -> Plant:
    if kind == "mech":
        return Plant(made_model(VALUES | values, stage="mech"), joints=JOINTS)
    hydraulics = {"pump_flow": 6.0, "opening_lag": 0.05}
    changes = {"simulation.model": kind}
    model = made_model(VALUES | values, changes, hydraulics=hydraulics)
    return Plant(model, joints=JOINTS)


def commands(steps: int, n: int = 1, seed: int = 0) -> np.ndarray:
    given = np.zeros((steps, n, 7))
    given[:, :, [1, 4]] = np.random.default_rng(seed).uniform(
        -130.0, 130.0, (steps, n, 2)
    )
    return given


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_a_batch_steps_to_the_bits_of_its_plants(kind, threads):
    several = [{}, {"D": 300.0}, {"M4": 3.0}, {"delay": 0.0}, {"friction": 10.0}]
    alone = [plant(kind, **values) for values in several]
    batch = PlantBatch([plant(kind, **values) for values in several], threads=threads)
    assert len(batch) == 5
    np.testing.assert_array_equal(
        batch.reset("rig"), [one.reset("rig") for one in alone]
    )
    found = batch.angle
    for given in commands(40, 5):
        found = batch.step(given)
        np.testing.assert_array_equal(
            found, [one.step(row) for one, row in zip(alone, given, strict=True)]
        )
    assert len({row.tobytes() for row in found}) == 5  # each its own parameters
    np.testing.assert_allclose(batch.time, alone[0].time)
    pose = np.tile(alone[0].angle, (2, 1))
    pose[:, 1] += [0.0, 0.1]
    batch.reset(pose, rows=[3, 1])  # these alone begin again
    alone[3].reset(pose[0])
    alone[1].reset(pose[1])
    for given in commands(20, 5, seed=1):
        found = batch.step(given)
        np.testing.assert_array_equal(
            found, [one.step(row) for one, row in zip(alone, given, strict=True)]
        )


@pytest.mark.parametrize("kind", KINDS)
def test_locked_joints_may_stand_elsewhere_at_each_reset(kind):
    alone = plant(kind)
    batch = PlantBatch([plant(kind), plant(kind)], threads=1)
    home = alone.angle
    bent = home + BENT
    given = np.array([0.0, 60.0, 0.0, 0.0, 40.0, 0.0, 0.0])
    for poses in ([bent, bent], [home, bent]):
        batch.reset(np.array(poses))
        alone.reset(bent)
        for _ in range(20):
            np.testing.assert_array_equal(batch.step(given)[1], alone.step(given))


@pytest.mark.parametrize("kind", KINDS)
def test_without_shapes_a_plant_steps_to_the_same_bits(kind):
    shaped = plant(kind)
    bare = Plant(shaped.identified, joints=JOINTS, shapes=False)
    assert shaped.model.ngeom > bare.model.ngeom == bare.model.nsite == 0
    np.testing.assert_array_equal(bare.reset("rig"), shaped.reset("rig"))
    for given in commands(20)[:, 0]:
        np.testing.assert_array_equal(bare.step(given), shaped.step(given))


@pytest.mark.parametrize("kind", KINDS)
def test_a_restored_plant_steps_to_the_same_bits(kind):
    first, other = plant(kind), plant(kind)
    first.reset("rig")
    for given in commands(15)[:, 0]:
        first.step(given)
    state = pickle.loads(pickle.dumps(first.state()))
    seen = first.angle
    after = [first.step(given) for given in commands(15, seed=1)[:, 0]]
    for again in (first, other):
        np.testing.assert_array_equal(again.restore(state), seen)
        assert again.time == pytest.approx(15 * again.period)
        np.testing.assert_array_equal(
            [again.step(given) for given in commands(15, seed=1)[:, 0]], after
        )


@pytest.mark.parametrize("kind", KINDS)
def test_a_restored_row_of_a_batch_steps_to_the_same_bits(kind):
    batch = PlantBatch([plant(kind), plant(kind, D=100.0)], threads=1)
    for given in commands(10, 2):
        batch.step(given)
    states = [batch.state(row) for row in range(2)]
    first = [batch.step(given) for given in commands(10, 2, seed=2)]
    bent = batch.plants[1].angle + BENT
    batch.reset(bent, rows=[1])
    for row, state in enumerate(states):
        batch.restore(row, state)
    again = [batch.step(given) for given in commands(10, 2, seed=2)]
    np.testing.assert_array_equal(again, first)
    assert batch.time[0] == pytest.approx(20 * batch.plants[0].period)


def test_one_that_diverges_leaves_the_others_alone():
    batch, alone = (
        PlantBatch([plant("dynamic"), plant("dynamic")], threads=1),
        plant("dynamic"),
    )
    batch.plants[0].data.qvel[:] = np.nan
    found, expected = batch.angle, alone.angle
    for given in commands(5)[:, 0]:
        found = batch.step(given)
        expected = alone.step(given)
    assert np.isnan(found[0]).all()
    np.testing.assert_array_equal(found[1], expected)
    batch.reset(rows=[0])
    assert np.isfinite(batch.step(np.zeros(7))).all()


@pytest.mark.parametrize(
    ("refused", "says"),
    [
        (lambda: PlantBatch([]), "same joints"),
        (lambda: PlantBatch([plant("mech"), plant("dynamic")]), "same joints"),
        (
            lambda: PlantBatch([plant("mech")]).step([1.0, 0, 0, 0, 0, 0, 0]),
            "take none",
        ),
        (lambda: PlantBatch([plant("mech")]).step(np.full(7, np.nan)), "finite"),
        (lambda: PlantBatch([plant("mech")]).step([1.0, 0.0]), "broadcast"),
    ],
)
def test_what_is_no_batch_is_refused(refused, says):
    with pytest.raises((SettingsError, ValueError), match=says):
        refused()
