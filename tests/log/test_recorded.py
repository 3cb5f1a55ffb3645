"""Which samples of a log stand for a row of the file: a slower log says nothing new
between its rows."""

from pathlib import Path

import numpy as np
import pytest
from log_files import cells, lines, read, save

from hydroid.settings.log import LogSettings


def test_a_log_on_its_own_grid_is_recorded_throughout(tmp_path: Path) -> None:
    log, _ = read(save(tmp_path / "log.csv", lines(cells())))
    assert log.recorded is None
    assert log.part(10, 30).recorded is None


@pytest.mark.parametrize("times", [2, 5, 8])
def test_of_a_slower_log_only_the_samples_at_its_rows_are_recorded(
    tmp_path: Path, times: int
) -> None:
    file = save(tmp_path / "log.csv", lines(cells(40, 0.01 * times)))
    log, _ = read(file, LogSettings(period_s=0.01))
    assert len(log.time) == 39 * times + 1
    assert log.recorded is not None
    np.testing.assert_array_equal(np.flatnonzero(log.recorded), times * np.arange(40))
    # these have the file's own values, and the others lie between them
    own = np.deg2rad(cells(40, 0.01 * times)[:, 3])
    np.testing.assert_allclose(log.angle[log.recorded, 0], own, atol=1e-12)
    part = log.part(times, 3 * times + 1)
    assert part.recorded is not None
    assert np.flatnonzero(part.recorded).tolist() == [0, times, 2 * times]


def test_a_bridged_gap_is_not_recorded(tmp_path: Path) -> None:
    table = lines(cells())
    del table[31:33]  # rows 30 and 31
    log, _ = read(save(tmp_path / "log.csv", table), repair=True)
    assert log.recorded is not None
    assert np.flatnonzero(~log.recorded).tolist() == [30, 31]


def test_a_row_beside_the_grid_is_the_nearest_sample(tmp_path: Path) -> None:
    """Rows 25 ms apart with jitter, on a grid of 10 ms."""
    values = cells(40, 0.025)
    values[:, 0] += np.random.default_rng(0).uniform(-1e-3, 1e-3, 40)
    values[:, 0] -= values[0, 0]
    log, _ = read(save(tmp_path / "log.csv", lines(values)), LogSettings(period_s=0.01))
    assert log.recorded is not None
    nearest = np.rint(np.round(values[:, 0], 10) / 0.01).astype(int)
    assert {*np.flatnonzero(log.recorded).tolist()} == {
        *np.minimum(nearest, len(log.time) - 1).tolist()
    }
