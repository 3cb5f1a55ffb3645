from pathlib import Path

import numpy as np
from hypothesis import given, settings, strategies as st
from log_files import cells, faults, lines, place, read, save

holes = st.lists(st.tuples(st.integers(2, 75), st.integers(1, 3)), max_size=4)


@settings(max_examples=60, deadline=None)
@given(holes, st.lists(st.tuples(st.integers(1, 78), st.integers(1, 4)), max_size=6))
def test_repair_restores_length_and_leaves_the_rest_alone(tmp_path_factory, dropped, blanked) -> None:
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
        mine, true = (np.concatenate([x.command, x.angle], axis=1)[:, column] for x in (log, whole))
        there = ~holes[:, column + 1]
        np.testing.assert_array_equal(mine[there], true[there])
        at = np.flatnonzero(there)
        if column < 2:
            expected = true[at[np.searchsorted(at, np.arange(len(true)), side="right") - 1]]
            np.testing.assert_array_equal(mine, expected)
        else:
            np.testing.assert_allclose(mine, np.interp(whole.time, whole.time[at], true[at]), atol=1e-12)
    cell_count = sum(1 for row, column in set(blanked) if row not in gone)
    said = [finding.what for finding in findings if finding.what.startswith("repaired")]
    if gone or cell_count:
        assert said[0].startswith(f"repaired: cells filled: {cell_count}, samples inserted: {len(gone)}")
    else:
        assert said == []


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
    found = faults(path, repair=True)
    assert {place(fault) for fault in found} == {"line 2, column u1_pct", "line 81, column q1_deg"}
    assert all("between good cells" in fault.hint for fault in found)


def test_torn_rows_and_rows_without_a_time_are_put_back(tmp_path: Path) -> None:
    table = lines(cells())
    table[20] = table[20][:2]
    table[40][0] = ""
    table[-1] = table[-1][:3]
    path = save(tmp_path / "log.csv", table)
    assert len(faults(path)) == 2
    log, findings = read(path, repair=True)
    assert len(log.time) == 79
    assert "rows left out: 3" in findings[0].what
