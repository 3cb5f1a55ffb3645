"""Environments of gymnasium from any fit: bring joints to angles, on machines that the
logs do not rule out.

An action is the command of each joint that takes one, as a part of full command. An
observation has for each of these joints, in halves of its range, its angle from the
middle, how far its target is, and its speed per second, as a sensor with the noise of
the logs reads them. The reward is minus the mean distance to the targets, in halves of
the range. An episode begins at rest in a random pose and is cut off after its time.

A machine is the fit's own estimate, or a draw (`use.draws`); its angles drift from the
model's as the fit's error model says.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hydroid.arrays import Array
from hydroid.errors import SettingsError
from hydroid.identified_model import IdentifiedModel, load_identified
from hydroid.plant import Plant, PlantBatch
from hydroid.plant.batch import RowState
from hydroid.use.draws import DriftingAngles, draw, error_numbers

try:
    import gymnasium
    from gymnasium.vector import AutoresetMode, VectorEnv as GymnasiumVectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    raise ImportError(
        "environments need gymnasium: pip install 'hydroid[gym]'"
    ) from None

Floats = NDArray[np.float32]
Options = Mapping[str, Any]

POSES = 256
"""random poses in which episodes begin, of all machines together: to be put into one
that is ready takes a hundredth of a reset"""
LEAST_POSES = 4
"""of these, each machine has as many at least"""
LARGEST = 10.0
"""of an observation, whose machine may diverge"""
MARGIN = 0.1
"""part of a range that starts and targets keep from its ends"""
DECISION = 0.05
"""time that an action is held, about [s]"""


class _Machines:
    """n machines of one model in the same task.

    Args:
        model: of the fit.
        thetas: the machines' parameters, (n, P).
        errors: whether angles drift and sensors have noise.
        decision: time that an action is held, about [s].
        threads: None: one per core.
    """

    def __init__(
        self,
        model: IdentifiedModel,
        thetas: Array,
        *,
        errors: bool,
        decision: float,
        threads: int | None,
    ) -> None:
        settings = model.settings
        arm = model.settings.arm
        self.joints = Plant(model).joints
        sample = settings.log.period_s
        self.period = max(round(decision / sample), 1) * sample
        # one machine alone may be drawn
        drawn = len(thetas) == 1
        plants = list[Plant]()
        for theta in thetas:
            machine = replace(model, theta=theta, summary=None)
            plant = Plant(machine, joints=self.joints, period=self.period, shapes=drawn)
            plants.append(plant)
        self.batch = PlantBatch(plants, threads=threads)
        self._columns = np.array(self.joints) - 1
        low, high = arm.limits[self._columns].T
        self._middle = 0.5 * (low + high)
        self._half = 0.5 * (high - low)
        self._pose = arm.pose(settings.start_pose)
        numbers = error_numbers(model)[self._columns]
        if not errors:
            numbers = np.zeros_like(numbers)
        n = len(thetas)
        self._drift = DriftingAngles(numbers, n, self.period)
        self._ready: dict[tuple[int, int], RowState] = {}
        shape = (n, max(POSES // n, LEAST_POSES), len(self.joints))
        # always the same poses: an episode depends on its own seed alone
        reach = np.random.default_rng(0).uniform(-1.0, 1.0, shape)
        inner = (1.0 - 2.0 * MARGIN) * self._half
        self._starts = self._middle + inner * reach
        self.target = np.tile(self._middle, (n, 1))
        self._angle = self.target.copy()
        self._true = self.target.copy()
        self._speed = np.zeros_like(self._angle)

    def begin(self, rows: Sequence[int], rng: Generator, options: Options) -> None:
        """Put m machines into random poses, or that of the options, with targets."""
        if not rows:
            return
        pose = options.get("pose")
        numbers = rng.integers(self._starts.shape[1], size=len(rows)).tolist()
        for row, number in zip(rows, numbers, strict=True):
            if pose is None:
                self._take_start(row, number)
            else:
                self.batch.reset(pose, rows=[row])
        reach = rng.uniform(-1.0, 1.0, (len(rows), len(self.joints)))
        target = self._middle + (1.0 - 2.0 * MARGIN) * self._half * reach
        wished = options.get("target")
        if wished is not None:
            if np.shape(wished) != self._middle.shape:
                raise ValueError(f"a target needs {len(self.joints)} angles [rad]")
            target[:] = wished
        angle = self.batch.driven_angle[rows]
        self.target[rows] = target
        self._angle[rows] = angle
        self._true[rows] = angle
        self._speed[rows] = 0.0
        self._drift.reset(np.asarray(rows))

    def _take_start(self, row: int, number: int) -> None:
        """Put a machine into one of its random poses."""
        if (row, number) not in self._ready:
            start = self._pose.copy()
            start[self._columns] = self._starts[row, number]
            self.batch.reset(start, rows=[row])
            self._ready[row, number] = self.batch.state(row)
        self.batch.restore(row, self._ready[row, number])

    def step(self, action: Any, rng: Generator) -> None:
        """Hold actions, (n, K), for a decision; actions beyond 1 are full commands."""
        command = 100.0 * np.asarray(action, float)
        if command.shape != self._angle.shape or not np.isfinite(command).all():
            joints = len(self.joints)
            raise ValueError(f"an action needs {joints} finite numbers per machine")
        self.batch.hold(command)
        after = self.batch.driven_angle
        error = self._drift.step(after - self._true, rng)
        self._true = after
        read = after + error
        self._speed = (read - self._angle) / self.period
        self._angle = read

    def observe(self, rng: Generator) -> Floats:
        """Return what the sensors read, (n, 3 K)."""
        read = self._angle + self._drift.noise(rng)
        seen = np.empty((len(read), 3, len(self.joints)))
        seen[:, 0] = read - self._middle
        seen[:, 1] = self.target - read
        seen[:, 2] = self._speed
        seen /= self._half
        if self.batch.failed.any():
            np.nan_to_num(seen, copy=False)
        seen.clip(-LARGEST, LARGEST, out=seen)
        return seen.reshape(len(read), -1).astype(np.float32)

    @property
    def reward(self) -> Array:
        """Minus the mean distance to the targets in halves of the range, (n,)."""
        away = np.abs(self.target - self._angle)
        if self.batch.failed.any():
            # a machine that diverged counts as 10 rad away
            np.nan_to_num(away, copy=False, nan=10.0)
        return away @ (-1.0 / (len(self.joints) * self._half))


def _opened(source: Any) -> IdentifiedModel:
    """Return the model of a run folder, of the result of a fit, or itself."""
    if isinstance(source, str | Path):
        return load_identified(source)
    return getattr(source, "model", source)


def _spaces(joints: int) -> tuple[Any, Any]:
    """Return the spaces of observations and actions of K joints."""
    actions = gymnasium.spaces.Box(-1.0, 1.0, (joints,), np.float32)
    return gymnasium.spaces.Box(-LARGEST, LARGEST, (3 * joints,), np.float32), actions


class Env(gymnasium.Env[Floats, Floats]):
    """A fitted machine whose joints are to be brought to random angles.

        env = hydroid.Env("runs/hyd", draws=20)
        observation, info = env.reset(seed=1, options={"draw": 3})

    Options of `reset`: `draw`, 0 for the fit's estimate and else the number of a draw,
    by default a random one of them; `pose`, of all joints [rad] or a name; `target`,
    angles [rad] of joints that take commands.

    Args:
        source: a run folder, or the result of a fit.
        draws: how many other machines there are.
        seed: of the draws.
        seconds: of an episode.
        decision_s: time that an action is held, about [s].
        errors: whether angles drift and sensors have noise, as the fit's error model
            says.

    Raises:
        RunError: the folder holds no estimate, or with draws no covariance.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  # gymnasium's own name and type

    def __init__(
        self,
        source: Any,
        *,
        draws: int = 0,
        seed: int = 0,
        seconds: float = 5.0,
        decision_s: float = DECISION,
        errors: bool = True,
    ) -> None:
        self._model = _opened(source)
        self._seconds = seconds
        self._thetas = self._model.theta[None]
        if draws:
            drawn = draw(self._model, draws, seed).theta
            self._thetas = np.vstack([self._thetas, drawn])
        self._errors = errors
        self._decision = decision_s
        self._made: dict[int, _Machines] = {}
        self._now = self._machine(0)
        self.joints = self._now.joints
        self.observation_space, self.action_space = _spaces(len(self.joints))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode; `info` names the draw."""
        super().reset(seed=seed)
        options = options or {}
        count = len(self._thetas)
        given = options.get("draw")
        if given is None:
            given = self.np_random.integers(count)
        number = int(given)
        if not 0 <= number < count:
            hint = f"0 to {count - 1}: name more with draws="
            raise SettingsError(f"is {number}", "draw", hint)
        self._now = self._machine(number)
        self._now.begin([0], self.np_random, options)
        return self._now.observe(self.np_random)[0], {"draw": number}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Hold an action for one decision."""
        now = self._now
        now.step(np.asarray(action)[None], self.np_random)
        over = bool(now.batch.time[0] >= self._seconds - 1e-9)
        observation = now.observe(self.np_random)[0]
        return observation, float(now.reward[0]), bool(now.batch.failed[0]), over, {}

    @property
    def plant(self) -> Plant:
        """The machine of this episode; it is stepped by the environment."""
        return self._now.batch.plants[0]

    def _machine(self, number: int) -> _Machines:
        if number not in self._made:
            self._made[number] = _Machines(
                self._model,
                self._thetas[[number]],
                errors=self._errors,
                decision=self._decision,
                threads=1,
            )
        return self._made[number]


class VectorEnv(GymnasiumVectorEnv[Floats, Floats, Any]):
    """n such machines in one call, each its own draw: `Env` says what they do.

    An episode that is over begins anew with the next step, whose action is not taken
    (`AutoresetMode.NEXT_STEP`).

    Args:
        source: a run folder, or the result of a fit.
        num_envs: n; the first is the fit's estimate, and the others are draws.
        seed: of the draws; None: all are the estimate.
        seconds, decision_s, errors: as of `Env`.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        source: Any,
        num_envs: int,
        *,
        seed: int | None = 0,
        seconds: float = 5.0,
        decision_s: float = DECISION,
        errors: bool = True,
    ) -> None:
        model = _opened(source)
        thetas = np.tile(model.theta, (num_envs, 1))
        if seed is not None and num_envs > 1:
            thetas[1:] = draw(model, num_envs - 1, seed).theta
        self._machines = _Machines(
            model, thetas, errors=errors, decision=decision_s, threads=None
        )
        self._seconds = seconds
        self.num_envs = num_envs
        self.joints = self._machines.joints
        observations, actions = _spaces(len(self.joints))
        self.single_observation_space = observations
        self.single_action_space = actions
        self.observation_space = batch_space(observations, num_envs)
        self.action_space = batch_space(actions, num_envs)
        self._over = np.zeros(num_envs, dtype=bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode of every machine, or of those that `options["reset_mask"]`
        has, (n,)."""
        if seed is not None:
            self._np_random = np.random.default_rng(seed)  # pyright: ignore[reportArgumentType]
        options = options or {}
        every = np.ones(self.num_envs, dtype=bool)
        rows = np.flatnonzero(options.get("reset_mask", every)).tolist()
        self._machines.begin(rows, self.np_random, options)
        # the others are over still, and begin anew with the next step
        self._over[rows] = False
        return self._machines.observe(self.np_random), {}

    def step(self, actions: Floats) -> tuple[Floats, Array, Any, Any, dict[str, Any]]:
        """Hold the actions, (n, K), for one decision."""
        machines = self._machines
        # what was over has no step: its action is not taken, and it begins anew
        began = self._over
        machines.step(actions, self.np_random)
        machines.begin(np.flatnonzero(began).tolist(), self.np_random, {})
        reward = np.where(began, 0.0, machines.reward)
        terminated = machines.batch.failed & ~began
        truncated = (machines.batch.time >= self._seconds - 1e-9) & ~began
        self._over = terminated | truncated
        return machines.observe(self.np_random), reward, terminated, truncated, {}
