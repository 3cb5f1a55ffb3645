"""The models that anybody would try first: they recover their own equations, and
nothing moves by itself."""

from dataclasses import replace

import numpy as np
import pytest

from hydroid.fitting.baselines import NAMES, Baseline, fit_baselines
from hydroid.log import Log

LIMITS = np.radians([-90.0, 90.0])
NUMBERS = np.array([[20.0, 35.0], [1.4, 2.0], [0.5, -0.3], [0.08, 0.15]])
TRUE = Baseline(1, LIMITS, delay=0.13, numbers=NUMBERS)


def recorded(
    seed: int, model: Baseline = TRUE, noise: float = 0.0, joints: int = 1
) -> Log:
    """Steps of random size and length, 60 s at 50 Hz, and how the model follows them
    from rest."""
    rng = np.random.default_rng(seed)
    held = np.repeat(rng.uniform(-100, 100, 60) * (rng.random(60) < 0.7), 50)
    held[:50] = 0
    command = np.tile(held[:, None], (1, joints))
    silent = Log("made", np.arange(3000) * 0.02, command, np.zeros_like(command), 0.02)
    angle = model.predict(silent) + rng.normal(0, noise, 3000)
    return replace(silent, angle=np.tile(angle[:, None], (1, joints)))


@pytest.mark.parametrize(
    "limits", [LIMITS, np.array([-np.inf, np.inf])], ids=["limited", "unlimited"]
)
def test_nine_numbers_recover_their_own_equations(limits: np.ndarray) -> None:
    logs = [recorded(seed, replace(TRUE, limits=limits)) for seed in (1, 2)]
    fitted = fit_baselines(logs, 1, limits)["nine numbers"]
    assert fitted.delay == pytest.approx(TRUE.delay, abs=0.002)
    np.testing.assert_allclose(fitted.numbers, NUMBERS, rtol=0.01)


def test_each_baseline_predicts_better_than_the_simpler_ones() -> None:
    logs, unseen = [recorded(seed, noise=0.001) for seed in (1, 2)], [recorded(3)]
    errors = [
        np.std(model.errors(unseen))
        for model in fit_baselines(logs, 1, LIMITS).values()
    ]
    assert len(errors) == len(NAMES)
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.002


@pytest.mark.parametrize("name", NAMES)
def test_zero_command_moves_nothing(name: str) -> None:
    log = recorded(1)
    rest = replace(log, command=np.zeros_like(log.command))
    predicted = fit_baselines([log], 1, LIMITS)[name].predict(rest)
    assert np.all(predicted == rest.start[0])


def test_a_joint_stops_at_its_range_and_comes_back_at_once() -> None:
    pushed = recorded(1)
    pushed.command[:] = np.where(pushed.time < 30, 100.0, -100.0)[:, None]
    predicted = TRUE.predict(pushed)
    assert predicted.max() == LIMITS[1]
    assert predicted[1490] == LIMITS[1] > predicted[1530]


def test_delays_between_samples_act_in_between() -> None:
    log, free = (
        recorded(1),
        replace(TRUE, numbers=NUMBERS * [[1], [1], [1], [0]], limits=10 * LIMITS),
    )
    ends = [replace(free, delay=d).predict(log) for d in (0.10, 0.12)]
    middle = replace(free, delay=0.11).predict(log)
    assert middle == pytest.approx(np.mean(ends, axis=0), abs=1e-9)


def test_a_joint_without_commands_stands() -> None:
    log = recorded(1, joints=2)
    log.command[:, 1] = 0
    assert list(fit_baselines([log], 2, LIMITS)) == ["standing still"]
