"""The environments keep gymnasium's contract, repeat themselves, and are the plant
underneath."""

import warnings

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from made_logs import TRUTH
from made_models import VALUES, made_model

import hydroid
from hydroid.errors import RunError, SettingsError
from hydroid.identified_model import IdentifiedModel
from hydroid.plant import Plant
from hydroid.use.environment import Env, VectorEnv


@pytest.fixture(scope="module")
def model() -> IdentifiedModel:
    values = VALUES | {"open_A": 0.4, "open_B": 0.4, "delay": 0.03, "S": TRUTH["S"]}
    changes = {"simulation.model": "quasi-static", "outputs": [2, 3]}
    return made_model(values, changes)


def test_gymnasium_finds_nothing_wrong(model):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(Env(model), skip_render_check=True)


def test_an_action_is_a_command_of_the_plant(model):
    env = Env(model, errors=False, decision_s=0.04)
    pose = model.settings.arm.pose("study")
    _, info = env.reset(seed=1, options={"pose": pose, "target": pose[[1, 2]]})
    assert info == {"draw": 0}
    plant = Plant(model, joints=[2, 3])
    plant.reset(pose)
    for _ in range(10):
        _, reward, terminated, truncated, _ = env.step(
            np.array([0.5, -0.7], np.float32)
        )
        assert (reward < 0.0, terminated, truncated) == (True, False, False)
        for _ in range(4):
            plant.step({"shoulder": 50, "elbow": -70})
    # actions have half the digits
    np.testing.assert_allclose(env.plant.data.qpos, plant.angle[[1, 2]], atol=1e-7)


def test_episodes_end_in_time_and_repeat_themselves(model):
    env = Env(model, seconds=0.5)

    def episode(seed):
        seen, over = [env.reset(seed=seed)[0]], False
        while not over:
            observation, _, _, over, _ = env.step(np.array([0.3, 0.9], np.float32))
            seen.append(observation)
        return np.array(seen)

    first, again, other = episode(5), episode(5), episode(6)
    assert len(first) == 11
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_vector_of_machines_is_one_call(model):
    several = VectorEnv(model, 5, seed=None, seconds=0.5, errors=False)
    first, _ = several.reset(seed=3)
    assert first.shape == (5, 6)
    assert several.observation_space.contains(first)
    action = np.tile(np.array([0.4, -0.4], np.float32), (5, 1))
    ends = []
    for _ in range(12):
        observation, reward, terminated, truncated, _ = several.step(action)
        assert several.observation_space.contains(observation)
        assert reward.shape == (5,)
        assert not terminated.any()
        ends.append(truncated.copy())
    # after half a second all are over, and begin anew with the next step
    assert ends[9].all()
    assert not ends[10].any()
    assert not np.array_equal(first, several.reset()[0])
    np.testing.assert_array_equal(several.reset(seed=3)[0], first)


def test_a_reset_of_some_machines_leaves_the_others_over(model):
    several = VectorEnv(model, 3, seed=None, seconds=0.5, errors=False)
    several.reset(seed=3)
    action = np.tile(np.array([0.4, -0.4], np.float32), (3, 1))
    truncated = np.zeros(3, dtype=bool)
    for _ in range(10):
        _, _, _, truncated, _ = several.step(action)
    assert truncated.all()
    several.reset(options={"reset_mask": np.array([True, False, False])})
    _, reward, _, truncated, _ = several.step(action)
    # the others begin with this step, which moves none of them
    assert (reward == 0.0).tolist() == [False, True, True]
    assert not truncated.any()


def test_a_machine_that_diverges_ends_its_episode(model):
    """No observation is NaN, and the next episode is as any other."""
    env = Env(model)
    env.reset(seed=0)
    action = np.zeros(2, np.float32)
    env.plant.data.qpos[:] = np.nan
    observation, reward, terminated, truncated, _ = env.step(action)
    assert (terminated, truncated) == (True, False)
    assert env.observation_space.contains(observation)
    assert reward < -1.0
    env.reset()
    observation, reward, terminated, *_ = env.step(action)
    assert not terminated
    assert env.observation_space.contains(observation)
    assert -1.0 < reward <= 0.0


@pytest.mark.parametrize("action", [[[np.nan, 0.0]], [[0.5]], [0.5, 0.5]])
def test_an_action_that_is_none_is_refused(model, action):
    one = VectorEnv(model, 1, seed=None)
    one.reset(seed=0)
    with pytest.raises(ValueError, match="2 finite numbers per machine"):
        one.step(np.array(action, np.float32))


def test_draws_need_a_fit(model):
    with pytest.raises(RunError, match="no covariance"):
        Env(model, draws=2)
    with pytest.raises(SettingsError, match="name more with draws="):
        Env(model).reset(options={"draw": 1})
    assert hydroid.Env is Env
