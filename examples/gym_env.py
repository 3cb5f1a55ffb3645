"""A gymnasium environment that brings a joint to a random angle: `python examples/gym_env.py [RUN]`."""

import sys
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import SyncVectorEnv
from numpy.typing import NDArray

from hydroid.plant import load_plant

Observation = NDArray[np.float32]


class JointEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """The first joint that takes commands, of any run; it turns, or slides: then rad stands for m.

    Action: command / 100 %. Observation: angle [rad], error [rad], speed [rad/s]. Reward: -|error|.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  # gymnasium's own name and type

    def __init__(self, source: str = "article-hyd", seconds: float = 5.0) -> None:
        self.plant, self.seconds = load_plant(source), seconds
        self.decides = round(0.05 / self.plant.period) or 1  # steps of a decision: 20 decisions per second
        self.joint = self.plant.joints[0] - 1
        arm = self.plant.identified.settings.arm
        self.unit, self.factor = ("mm", 1e3) if arm.joints[self.joint].slides else ("deg", np.degrees(1.0))
        stops = np.array([arm.lower[self.joint], arm.upper[self.joint]])
        self.low, self.high = np.clip(stops, -np.pi, np.pi)  # it may turn without end
        self.pose = self.plant.angle
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-10.0, 10.0, (3,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode: a random start and a random target within the joint's range."""
        super().reset(seed=seed)
        pose, (start, end) = self.pose.copy(), self.np_random.uniform(0.1, 0.9, 2)
        pose[self.joint], self.target = self.low + np.array([start, end]) * (self.high - self.low)
        self.angle, self.speed = self.plant.reset(pose)[self.joint], 0.0
        return self.observe(), {}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the command for one decision."""
        angle = self.angle
        for _ in range(self.decides):
            angle = self.plant.step({self.plant.names[self.joint]: 100.0 * action[0]})[self.joint]
        self.speed = (angle - self.angle) / (self.decides * self.plant.period)
        self.angle, observation = angle, self.observe()
        return observation, -abs(float(observation[1])), False, self.plant.time >= self.seconds, {}

    def observe(self) -> Observation:
        """Return angle, error and speed, shape (3,)."""
        return np.array([self.angle, self.target - self.angle, self.speed], np.float32)


def sense(env: JointEnv) -> float:
    """Return 1 if a positive command raises the angle, or else -1."""
    pose = env.pose.copy()
    pose[env.joint] = before = 0.5 * (env.low + env.high)
    env.plant.reset(pose)
    while env.plant.time < 1.0:
        pose = env.plant.step({env.plant.names[env.joint]: 100.0})
    return 1.0 if pose[env.joint] > before else -1.0


if __name__ == "__main__":
    source = sys.argv[1] if len(sys.argv) > 1 else "article-hyd"
    gain = 10.0 * sense(env := JointEnv(source)) / (env.high - env.low)
    envs = SyncVectorEnv([lambda: JointEnv(source)] * 4)
    seen, _ = envs.reset(seed=1)
    for _ in range(round(5.0 / (env.decides * env.plant.period)) - 1):
        seen, *_ = envs.step(np.clip(gain * seen[:, 1:2], -1.0, 1.0))  # a proportional policy
    errors = (env.factor * np.abs(seen[:, 1], dtype=float)).round(2).tolist()
    print(f"error of {env.plant.names[env.joint]} after 5 s [{env.unit}]: {errors}")
