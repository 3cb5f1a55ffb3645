from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from log_files import (
    RANGES,
    SETTINGS,
    assert_same,
    cells,
    faults,
    lines,
    place,
    read,
    save,
)

from hydroid.log import Reading, check_parts, write_log

holes = st.lists(st.tuples(st.integers(2, 75), st.integers(1, 3)), max_size=4)


@settings(max_examples=60, deadline=None)
@given(holes, st.lists(st.tuples(st.integers(1, 78), st.integers(1, 4)), max_size=6))
def test_repair_restores_length_and_leaves_the_rest_alone(
    tmp_path_factory, dropped, blanked
) -> None:
    values = cells()
    folder = tmp_path_factory.getbasetemp()
    whole, _ = read(save(folder / "whole.csv", lines(values)))
    gone = {row + k for row, run in dropped for k in range(run)}
    holes = np.zeros(values.shape, dtype=bool)
    holes[:, 1:] = np.isin(np.arange(len(values)), [*gone])[:, None]
    table = lines(values)
    for row, column in blanked:
        table[row + 1][column] = "n/a"
        holes[row, column] = True
    kept = [table[0], *(row for k, row in enumerate(table[1:]) if k not in gone)]
    log, findings = read(save(folder / "holed.csv", kept), repair=True)
    assert len(log.time) == len(values)
    for column in range(4):
        mine, true = (
            np.concatenate([x.command, x.angle], axis=1)[:, column]
            for x in (log, whole)
        )
        there = ~holes[:, column + 1]
        np.testing.assert_array_equal(mine[there], true[there])
        at = np.flatnonzero(there)
        if column < 2:
            expected = true[
                at[np.searchsorted(at, np.arange(len(true)), side="right") - 1]
            ]
            np.testing.assert_array_equal(mine, expected)
        else:
            np.testing.assert_allclose(
                mine, np.interp(whole.time, whole.time[at], true[at]), atol=1e-12
            )
    cell_count = sum(1 for row, column in set(blanked) if row not in gone)
    said = [finding.what for finding in findings if finding.what.startswith("repaired")]
    if gone or cell_count:
        assert said[0].startswith(
            f"repaired: cells filled: {cell_count}, samples inserted: {len(gone)}"
        )
    else:
        assert said == []


@pytest.mark.parametrize("wrapped", ["0 to 360", "-360 to 0"])
def test_an_encoder_that_wraps_is_joined_where_the_joints_range_says_how(
    tmp_path: Path, wrapped: str
) -> None:
    """Joint 1 goes through 0 and lies between -30 and 90 deg."""
    whole = cells()
    whole[:, 3] -= 15
    plain, _ = read(save(tmp_path / "plain.csv", lines(whole)))
    turned = whole.copy()
    turned[:, 3] %= 360
    turned[:, 3] -= 360 * (wrapped == "-360 to 0")
    log, findings = read(save(tmp_path / "turned.csv", lines(turned)))
    assert [finding.kind for finding in findings] == ["wrap"]
    np.testing.assert_allclose(log.angle, plain.angle, atol=1e-9)
    # where the range does not hold all of them, they stay as they are
    turned[40:, 3] += 85
    assert faults(save(tmp_path / "far.csv", lines(turned)))


def test_a_long_hole_is_not_repaired(tmp_path: Path) -> None:
    table = lines(cells())
    for row in table[30:41]:
        row[3] = ""
    (fault,) = faults(save(tmp_path / "log.csv", table), repair=True)
    assert place(fault) == "line 31, column q1_deg"
    table[40][3] = "10"
    assert faults(save(tmp_path / "log.csv", table), repair=True) == []


def test_a_hole_at_an_end_is_not_invented(tmp_path: Path) -> None:
    table = lines(cells())
    table[1][1] = table[-1][3] = ""
    path = save(tmp_path / "log.csv", table)
    log, (finding,) = read(path, repair=True)
    assert (finding.level, place(finding)) == ("warning", "line 2, column u1_pct")
    assert "no value is there (and 1 more row, up to line 81): left out" in finding.what
    assert len(log.time) == 78


def test_torn_rows_and_rows_without_a_time_are_put_back(tmp_path: Path) -> None:
    table = lines(cells())
    table[20] = table[20][:2]
    table[40][0] = ""
    table[-1] = table[-1][:3]
    path = save(tmp_path / "log.csv", table)
    log, findings = read(path, repair=True)
    assert len(log.time) == 79
    assert "rows left out: 3" in findings[0].what


def dropped(
    folder: Path, *gaps: tuple[int, int], rows: int = 400
) -> tuple[Path, np.ndarray]:
    """A log without the samples from the first to before the last of each gap; and the
    whole log."""
    values = cells(rows)
    gone = [row for first, end in gaps for row in range(first, end)]
    return save(folder / "log.csv", lines(np.delete(values, gone, axis=0))), values


@pytest.mark.parametrize("count", [1, 2])
def test_up_to_two_lost_samples_are_bridged_with_a_warning(
    count: int, tmp_path: Path
) -> None:
    path, values = dropped(tmp_path, (100, 100 + count), (300, 301))
    whole, _ = read(save(tmp_path / "whole.csv", lines(values)))
    log, (lost,) = read(path)
    assert (lost.level, lost.kind) == ("warning", "lost")
    assert (
        lost.what
        == f"samples lost: {count + 1} (and 1 more row, up to line {302 - count})"
    )
    assert place(lost) == "line 102, column time_s"
    there = np.delete(np.arange(400), [*range(100, 100 + count), 300])
    np.testing.assert_array_equal(log.angle[there], whole.angle[there])
    np.testing.assert_array_equal(log.command[there], whole.command[there])
    np.testing.assert_array_equal(log.command[100], whole.command[99])  # it was held
    np.testing.assert_allclose(log.angle, whole.angle, atol=1e-3 * 100)


def test_a_gap_splits_a_log_and_only_what_is_lost_is_left_out(tmp_path: Path) -> None:
    path, values = dropped(tmp_path, (100, 103), (250, 300))
    whole, _ = read(save(tmp_path / "whole.csv", lines(values)))
    parts, (gap, *_) = check_parts(path, SETTINGS, RANGES)
    assert (gap.level, gap.kind, place(gap)) == (
        "warning",
        "gap",
        "line 102, column time_s",
    )
    assert "0.04 s without a sample" in gap.what
    assert "parts read: 3" in gap.what
    assert [part.source for part in parts] == [f"{path}[{k}]" for k in (1, 2, 3)]
    for part, (first, end) in zip(
        parts, [(0, 100), (103, 250), (300, 400)], strict=True
    ):
        assert part.begin == pytest.approx(0.01 * first)
        np.testing.assert_allclose(part.time, 0.01 * np.arange(end - first), atol=1e-12)
        np.testing.assert_array_equal(part.command, whole.command[first:end])
        np.testing.assert_array_equal(part.angle, whole.angle[first:end])
    # the arm may be moving there
    np.testing.assert_array_equal(parts[1].start, whole.angle[103])
    # each part says what its file had, and what was left out of it
    for part in parts:
        assert part.rows.count == len(part.time)
        np.testing.assert_allclose(part.rows.steps, 0.01, atol=1e-9)
        (statement,) = part.rows.left_out
        assert statement == f"line 102, column time_s: {gap.what}"
        assert part.part(0, 20).rows is None


def test_parts_shorter_than_half_a_second_are_left_out_and_counted(
    tmp_path: Path,
) -> None:
    path, _ = dropped(tmp_path, (100, 110), (130, 140))
    parts, (gap,) = check_parts(path, SETTINGS, RANGES)
    assert [len(part.time) for part in parts] == [100, 260]
    assert "parts read: 2, 1 shorter than 0.5 s left out" in gap.what
    short, _ = dropped(tmp_path, *[(k, k + 5) for k in range(30, 400, 30)])
    (fault,) = faults(short)
    assert "no part of 0.5 s without a gap" in fault.what


def test_a_log_has_several_of_the_settings_periods(tmp_path: Path) -> None:
    path, _ = dropped(tmp_path)
    period = 1.0
    coarse = SETTINGS.changed({"period_s": period})
    parts, findings = check_parts(path, coarse, RANGES)
    assert not parts
    (fault,) = [one for one in findings if one.level == "error"]
    assert "at least 5 s (5 times log.period_s, 1 s) is needed" in fault.what
    less = coarse.changed({"period_s": 0.5})
    assert len(check_parts(path, less, RANGES)[0]) == 1


def test_a_gap_that_is_short_against_the_new_period_does_not_split(
    tmp_path: Path,
) -> None:
    path, _ = dropped(tmp_path, (100, 110))
    coarse = SETTINGS.changed({"period_s": 0.05})
    (one,) = check_parts(path, coarse, RANGES)[0]
    # the rows are those of the file, before it was resampled
    assert one.rows.count == 390
    np.testing.assert_allclose(one.rows.steps, [0.01, 0.01, 0.11], atol=1e-9)
    assert len(check_parts(path, SETTINGS, RANGES, Reading(repair=True))[0]) == 1


CUTS = {
    "fewer cells": lambda line: line.rsplit(",", 2)[0],
    "no last cell": lambda line: line.rpartition(",")[0] + ",",
    "a sign": lambda line: line.rpartition(",")[0] + ",-",
    "an exponent": lambda line: line.rpartition(",")[0] + ",1e",
    "one letter": lambda line: line[:1],
}


@pytest.mark.parametrize("cut", CUTS)
def test_a_last_line_that_is_cut_off_is_left_out(cut: str, tmp_path: Path) -> None:
    path = save(tmp_path / "log.csv", lines(cells()))
    *rows, last = path.read_text().splitlines()
    path.write_text("\n".join([*rows, CUTS[cut](last)]))
    log, (finding,) = read(path)
    assert (finding.level, finding.what) == (
        "warning",
        "the last line is cut off and left out",
    )
    assert place(finding) == "line 81"
    assert_same(log, read(save(tmp_path / "short.csv", lines(cells(79))))[0])


def test_a_line_that_is_cut_off_elsewhere_is_left_out(tmp_path: Path) -> None:
    table = lines(cells())
    table[40] = table[40][:2]
    _, (finding, _) = read(save(tmp_path / "log.csv", table))
    assert (finding.level, finding.kind, place(finding)) == (
        "warning",
        "row left out",
        "line 41",
    )


def test_where_many_rows_hold_no_numbers_none_is_left_out(tmp_path: Path) -> None:
    """Then the column is another one than the settings say."""
    table = lines(cells())
    for row in table[10:15]:
        row[3] = "off"
    (fault,) = faults(save(tmp_path / "log.csv", table))
    assert "'off' is not a number (and 4 more rows, up to line 15)" in fault.what
    assert "--repair" in fault.hint


def test_a_column_of_text_is_not_to_be_repaired(tmp_path: Path) -> None:
    table = lines(cells())
    for row in table[1:]:
        row[3] = "off"
    (fault,) = faults(save(tmp_path / "log.csv", table))
    assert "this column holds no numbers" in fault.what
    assert fault.hint == "name a column that holds numbers in log.angle"


def test_a_part_is_written_and_read_back_to_the_same_bits(tmp_path: Path) -> None:
    parts, _ = check_parts(dropped(tmp_path, (150, 200))[0], SETTINGS, RANGES)
    for part in parts:
        write_log(tmp_path / "part.csv", part, SETTINGS, exact=True)
        assert_same(read(tmp_path / "part.csv")[0], part)
