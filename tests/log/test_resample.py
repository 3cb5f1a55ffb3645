from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_files import cells, lines, read, save

from hydroid.log.repair import resample
from hydroid.settings.log import LogSettings


def steps(kind: str) -> np.ndarray:
    rng = np.random.default_rng(1)
    return {
        "50 Hz": np.full(100, 0.02),
        "200 Hz": np.full(400, 0.005),
        "97 Hz, jitter": (1 + rng.uniform(-0.2, 0.2, 194)) / 97,
        "100 Hz": np.full(200, 0.01),
    }[kind]


@pytest.mark.parametrize("kind", ["50 Hz", "200 Hz", "97 Hz, jitter", "100 Hz"])
@given(delay=st.integers(-30, 30).map(lambda k: k * 0.005), start=st.floats(-100, 100))
def test_commands_are_held_and_lines_stay_lines(kind: str, delay: float, start: float) -> None:
    time = start + np.concatenate([[0.0], np.cumsum(steps(kind))])
    rng = np.random.default_rng(2)
    command = rng.uniform(-100, 100, (len(time), 2))
    angle = np.stack([0.3 + 0.2 * (time - start), 1 - (time - start)], axis=1)
    grid, u, q = resample(time, command, angle, 0.01, delay)
    np.testing.assert_allclose(np.diff(grid), 0.01, rtol=1e-9)
    assert grid[0] == 0
    assert 0 <= time[-1] - start - grid[-1] + 1e-4 < 0.01 + 1e-4
    np.testing.assert_allclose(q, np.stack([0.3 + 0.2 * grid, 1 - grid], axis=1), atol=1e-9)
    logged = (time - start <= (grid - delay)[:, None] + 1e-8).sum(axis=1)
    np.testing.assert_array_equal(u, np.concatenate([np.zeros((1, 2)), command])[logged])


def test_samples_on_the_grid_pass_unchanged() -> None:
    rng = np.random.default_rng(3)
    time = np.round(np.arange(1000) * 0.01 + rng.uniform(-4e-5, 4e-5, 1000), 6) + 1.7e9
    command, angle = rng.uniform(-100, 100, (1000, 3)), rng.normal(size=(1000, 3))
    angle[:, 1] = np.nan
    grid, u, q = resample(time, command, angle, 0.01)
    np.testing.assert_array_equal(u, command)
    np.testing.assert_array_equal(q, angle)
    np.testing.assert_array_equal(grid, np.arange(1000) * 0.01)


def test_a_resampled_log_is_said_to_be(tmp_path: Path) -> None:
    path = save(tmp_path / "log.csv", lines(cells(60, 0.02)))
    log, findings = read(path)
    assert len(log.time) == 119
    assert [f.what for f in findings] == ["resampled from steps of 0.02 s to 0.01 s"]
    log, findings = read(path, LogSettings(period_s=0.02))
    assert len(log.time) == 60
    assert findings == []


def test_the_delay_setting_moves_the_command_only(tmp_path: Path) -> None:
    path = save(tmp_path / "log.csv", lines(cells()))
    plain, _ = read(path)
    late, _ = read(path, LogSettings(delay_s=0.07))
    np.testing.assert_array_equal(late.command[7:], plain.command[:-7])
    np.testing.assert_array_equal(late.command[:7], 0)
    np.testing.assert_array_equal(late.angle, plain.angle)
