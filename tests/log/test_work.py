"""Stretches in which an arm works against the world are left out of a log."""

import numpy as np
import pytest

import hydroid
from hydroid.commands.inputs import load_settings
from hydroid.commands.logs import read_logs
from hydroid.errors import LogError, SettingsError
from hydroid.log.read import check_parts
from hydroid.settings.load import validate
from hydroid.settings.log import LogSettings

RANGES = {"boom": (-1.0, 1.0)}
TIME = np.arange(0.0, 20.0, 0.05)


def _written(tmp_path, cells=None, name="dig_1.csv"):
    """A log of a joint that moves for 20 s, with a column of work where there are
    cells."""
    columns = {"time_s": 100.0 + TIME, "u1_pct": 50 * np.sin(TIME)}
    columns["q1_deg"] = 20 * np.sin(0.5 * TIME)
    if cells is not None:
        columns["digging"] = cells
    rows = np.column_stack([np.asarray(one, dtype=str) for one in columns.values()])
    path = tmp_path / name
    path.write_text("\n".join([",".join(columns), *map(",".join, rows.tolist())]))
    return path


def _read(path, **work):
    settings = validate({"work": work, "period_s": 0.05}, LogSettings, "log", {})
    parts, findings = check_parts(path, settings, RANGES)
    return parts, {finding.kind: finding for finding in findings}


DIGS = (TIME > 7.0) & (TIME < 12.0)


@pytest.mark.parametrize(
    ("cells", "work"),
    [
        (1.0 * DIGS, {"column": "digging"}),
        (None, {"spans": {"dig_*.csv": [[7.01, 11.99]]}}),
    ],
)
def test_work_is_left_out_and_the_log_is_split_there(tmp_path, cells, work):
    parts, found = _read(_written(tmp_path, cells), **work)
    assert [part.duration for part in parts] == pytest.approx([7.0, 7.95], abs=0.051)
    assert parts[1].begin == pytest.approx(12.0)
    assert found["work"].level == "note"
    assert "25 % of its rows" in str(found["work"])
    whole, _ = _read(_written(tmp_path))
    first = parts[0].angle[:, 0]
    np.testing.assert_array_equal(first, whole[0].angle[: len(first), 0])


def test_a_log_without_work_is_used_whole(tmp_path):
    (log,), found = _read(_written(tmp_path, 0.0 * TIME), column="digging")
    assert log.duration == pytest.approx(TIME[-1], abs=0.06)
    assert not {"work", "no work"} & {*found}


def test_a_log_without_the_column_is_used_whole_and_says_so(tmp_path):
    (log,), found = _read(_written(tmp_path, DIGS), column="diging")
    assert log.duration == pytest.approx(TIME[-1], abs=0.06)
    assert found["no work"].level == "note"
    assert "no column 'diging'" in str(found["no work"])
    assert "without a use: digging" in str(found["no work"])


@pytest.mark.parametrize("column", ["digging", "diging"])
def test_a_column_of_work_that_no_log_has_is_an_error(tmp_path, column):
    files = [
        _written(tmp_path, cells, f"{k}.csv") for k, cells in enumerate((DIGS, None))
    ]
    settings = load_settings(
        "fit-hyd", {"outputs": [1], "log.work.column": column, "log.period_s": 0.05}
    )
    checks = hydroid.check(files, config=settings).result
    levels = {
        one.level for check in checks for one in check.findings if "work" in one.kind
    }
    if column == "digging":
        assert levels == {"note"}
        assert len(read_logs(files, settings, fitted=True)) == 3
        return
    assert levels == {"error"}
    with pytest.raises(LogError, match=r"no column 'diging'.*no log has it"):
        read_logs(files, settings, fitted=True)
    # of a validation the fit's logs had it
    assert len(read_logs(files, settings)) == 2


@pytest.mark.parametrize(
    ("cells", "words"),
    [(TIME + 1.0, "nothing is left"), (np.full(len(TIME), "yes"), "no numbers")],
)
def test_work_that_leaves_nothing_or_says_nothing_is_one_line(tmp_path, cells, words):
    parts, found = _read(_written(tmp_path, cells), column="digging")
    assert not parts
    assert words in str(found["unreadable"])
    assert "\n" not in str(found["unreadable"])


def test_a_stretch_that_ends_before_it_begins_is_refused():
    with pytest.raises(SettingsError, match="ends after it begins"):
        validate({"work": {"spans": {"a.csv": [[5, 3]]}}}, LogSettings, "log", {})
