"""A gymnasium environment that brings the shoulder to a random angle: `python examples/gym_env.py [RUN]`."""

import sys
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import SyncVectorEnv
from numpy.typing import NDArray

from hydroid.plant import load_plant

SHOULDER = 1
Observation = NDArray[np.float32]


class ShoulderEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Action: command / 100 %. Observation: angle [rad], error [rad], speed [rad/s]. Reward: -|error|."""

    metadata = {"render_modes": []}  # noqa: RUF012  # gymnasium's own name and type

    def __init__(self, source: str = "article-hyd", seconds: float = 5.0) -> None:
        self.plant = load_plant(source, period=0.05)  # 20 decisions per second
        arm = self.plant.identified.settings.arm
        self.start, self.seconds = arm.pose("study"), seconds
        self.low, self.high = arm.lower[SHOULDER], arm.upper[SHOULDER]
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-10.0, 10.0, (3,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode: a random start and a random target within the joint's range."""
        super().reset(seed=seed)
        pose = self.start.copy()
        pose[SHOULDER], self.target = self.np_random.uniform(0.8 * self.low, 0.8 * self.high, 2)
        self.plant.reset(pose)
        return self.observe(), {}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the command for one period."""
        command = np.zeros(len(self.start))
        command[SHOULDER] = 100.0 * action[0]
        self.plant.step(command)
        observation = self.observe()
        return observation, -abs(float(observation[1])), False, self.plant.time >= self.seconds, {}

    def observe(self) -> Observation:
        """Return angle, error and speed, shape (3,)."""
        angle, speed = self.plant.angle[SHOULDER], self.plant.data.qvel[0]
        return np.array([angle, self.target - angle, speed], np.float32)


if __name__ == "__main__":
    source = sys.argv[1] if len(sys.argv) > 1 else "article-hyd"
    envs = SyncVectorEnv([lambda: ShoulderEnv(source)] * 4)
    seen, _ = envs.reset(seed=1)
    for _ in range(99):
        seen, *_ = envs.step(np.clip(5.0 * seen[:, 1:2], -1.0, 1.0))  # a proportional policy
    print("error after 5 s [deg]:", np.degrees(np.abs(seen[:, 1], dtype=float)).round(2).tolist())
