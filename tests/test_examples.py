"""The examples run as they stand."""

import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def output(name: str, *arguments: str) -> str:
    command = [sys.executable, str(EXAMPLES / name), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=EXAMPLES.parent).stdout


@pytest.fixture
def gym_env(monkeypatch: pytest.MonkeyPatch):
    """The module of the environment."""
    pytest.importorskip("gymnasium")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import gym_env  # pyright: ignore[reportMissingImports]

    return gym_env


def test_the_controller_brings_the_shoulder_to_its_target():
    found = re.search(r"after 10 s: ([\d.]+) deg of 30", output("pid.py"))
    assert found
    assert float(found[1]) == pytest.approx(30.0, abs=0.3)


def test_the_environment_passes_gymnasiums_own_check(gym_env):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym_env.ShoulderEnv(), skip_render_check=True)


def test_environments_in_a_vector_do_what_they_do_alone(gym_env):
    from gymnasium.vector import SyncVectorEnv

    envs = SyncVectorEnv([gym_env.ShoulderEnv] * 3)
    together, _ = envs.reset(seed=5)
    alone = [gym_env.ShoulderEnv() for _ in range(3)]
    seen = [env.reset(seed=5 + k)[0] for k, env in enumerate(alone)]
    rng = np.random.default_rng(0)
    for _ in range(20):
        np.testing.assert_array_equal(together, seen)
        action = rng.uniform(-1, 1, (3, 1)).astype(np.float32)
        together, reward, *_ = envs.step(action)
        steps = [env.step(a) for env, a in zip(alone, action, strict=True)]
        seen = [step[0] for step in steps]
        np.testing.assert_allclose(reward, [step[1] for step in steps])
    assert np.ptp(np.array(seen)[:, 0]) > 0


def test_an_episode_ends_after_its_time(gym_env):
    env = gym_env.ShoulderEnv(seconds=0.5)
    env.reset(seed=1)
    ends = [env.step(np.zeros(1, np.float32))[3] for _ in range(10)]
    assert ends == [False] * 9 + [True]
