import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from log_files import (
    NAMES,
    RANGES,
    RIG,
    RIG_RANGES,
    SETTINGS,
    cells,
    faults,
    lines,
    place,
    read,
    save,
)

from hydroid.errors import LogError
from hydroid.log import check_log
from hydroid.settings.log import LogSettings


@pytest.mark.parametrize(
    "name", ["rig_shoulder_1", "rig_shoulder_2", "rig_all_joints_1"]
)
def test_a_shipped_log_reads_fast_and_without_a_finding(name: str) -> None:
    start = time.process_time()
    log, findings = read(RIG / f"{name}.csv", ranges=RIG_RANGES, outputs=[2])
    assert findings == []
    assert time.process_time() - start < 0.5
    raw = np.loadtxt(RIG / f"{name}.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(log.command, raw[:, 1:8])
    np.testing.assert_allclose(
        log.angle, np.deg2rad(raw[:, 8:]), rtol=1e-15, atol=1e-300
    )
    np.testing.assert_allclose(log.time, raw[:, 0], atol=1e-12)
    assert (log.driven == raw[:, 1:8].any(axis=0)).all()
    assert log.has_angle.all()


def cell(row: int, column: int, text: str):
    return lambda rows: rows[row].__setitem__(column, text)


def values(change):
    return lambda rows: rows.__setitem__(slice(None), lines(change(cells())))


def clock(stamp):
    return lambda rows: [row.__setitem__(0, stamp(k)) for k, row in enumerate(rows[1:])]


FINE = ((3, "-30.9"), (3, "88.2"), (1, "100"), (2, "1e1"), (2, "٣"))
"""the range is -28.65 to 85.94 deg, and the margin 2 % of it"""
FAULTS = {
    "below the range": (cell(40, 3, "-31.1"), "line 41, column q1_deg", "joint 1 is -31.1 deg, allowed are"),
    "above the range": (cell(40, 3, "88.3"), "line 41, column q1_deg", "q1_deg in log.angle, or the joint's"),
    "command above": (cell(40, 1, "100.01"), "line 41, column u1_pct", "allowed are -100 to 100 %"),
    "command below": (cell(40, 1, "-100.01"), "line 41, column u1_pct", "command of joint 1 is -100.01 %"),
    "a jump": (cell(40, 4, "1000"), "line 41, column q2_deg", "jumps by"),
    "no time column": (lambda rows: [r.pop(0) for r in rows], "line 1", "lacks 'time_s'"),
    "two lacking": (
        lambda rows: [r.__delitem__(slice(2, 4)) for r in rows],
        "line 1",
        "lacks 'u2_pct' (command of joint 2) and 'q1_deg' (angle of joint 1)",
    ),
    "a name twice": (lambda rows: [r.append(r[3]) for r in rows], "line 1", "2 columns 'q1_deg'"),
    "one column": (lambda rows: [r.__setitem__(slice(None), [":".join(r)]) for r in rows], "", "one column"),
    "no times": (lambda rows: [r.__setitem__(0, "x") for r in rows[1:]], "line 2, column time_s", "'x'"),
    "backwards": (values(lambda t: t[::-1]), "line 3, column time_s", "does not increase"),
    "a clock that begins again": (
        values(lambda t: (t - (np.arange(len(t)) >= 50)[:, None] * [0.4, 0, 0, 0, 0]) * [4, 1, 1, 1, 1]),
        "line 52, column time_s",
        "hand in what was recorded before and after as two logs",
    ),
    "short": (values(lambda t: t[:20]), "column time_s", "at least 0.5 s is needed"),
    "empty": (values(lambda t: t[:0]), "column time_s", "samples: 0"),
    "every 6 s": (
        values(lambda t: t * [600, 1, 1, 1, 1]),
        "column time_s",
        "every 6 s, but needs one every 0.1 s or more often; take more samples, or check",
    ),
    "ks": (values(lambda t: t * [0.001, 1, 1, 1, 1]), "column time_s", "log.time.unit"),
}  # fmt: skip
"""change of a file, and place and words of its only fault"""
LEFT_OUT = {
    "digit groups": (cell(40, 2, "1_0"), "line 41, column u2_pct", "'1_0' is not a number: left out"),
    "text": (cell(40, 2, "#N/A"), "line 41, column u2_pct", "is not a number: left out"),
    "no text": (cell(40, 2, ""), "line 41, column u2_pct", "no value is there: left out"),
    "a cell more": (cell(40, 2, "3,4"), "line 41", "does not hold 5 cells with numbers: left out"),
    "no time of day": (
        clock(lambda k: "noon" if k == 7 else f"12:00:00.{k:02d}"), "line 9, column time_s", "'noon' is not",
    ),
    "names again": (lambda rows: rows.insert(40, rows[0]), "line 41", "does not hold 5 cells with numbers"),
    "a row twice": (lambda rows: rows.insert(41, rows[40]), "line 42, column time_s", "does not increase"),
}  # fmt: skip
"""change of one row of a file that costs this row only, and the place and words of the
warning"""


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_has_its_place_and_its_words(case: str, tmp_path: Path) -> None:
    change, where, said = FAULTS[case]
    (fault,) = faults(edited(tmp_path, change))
    assert place(fault) == where
    assert said in str(fault)


@pytest.mark.parametrize("case", LEFT_OUT)
def test_no_log_is_refused_for_one_row(case: str, tmp_path: Path) -> None:
    whole, _ = read(edited(tmp_path, lambda rows: None))
    change, where, said = LEFT_OUT[case]
    log, (finding, *lost) = read(edited(tmp_path, change))
    assert (finding.level, place(finding)) == ("warning", where)
    assert said in str(finding)
    assert {one.kind for one in lost} <= {"lost"}  # the sample that is bridged then
    np.testing.assert_allclose(log.time, whole.time, atol=1e-12)
    there = np.ones(len(whole.time), bool) if log.recorded is None else log.recorded
    assert there.sum() >= len(there) - 1
    np.testing.assert_array_equal(log.angle[there], whole.angle[there])
    np.testing.assert_array_equal(log.command[there], whole.command[there])


@pytest.mark.parametrize(("column", "text"), FINE)
def test_the_edge_of_what_a_cell_may_hold(
    column: int, text: str, tmp_path: Path
) -> None:
    assert faults(edited(tmp_path, cell(40, column, text))) == []


def test_rows_that_a_logger_writes_twice_are_left_out_in_any_number(
    tmp_path: Path,
) -> None:
    whole, _ = read(edited(tmp_path, lambda rows: None))

    def twice(rows: list[list[str]]) -> None:
        for row in range(len(rows) - 1, 0, -3):
            rows.insert(row, rows[row])

    log, (finding,) = read(edited(tmp_path, twice))
    assert finding.level == "warning"
    np.testing.assert_array_equal(log.angle, whole.angle)

    def other_angles(rows: list[list[str]]) -> None:
        twice(rows)
        for row in range(2, len(rows)):
            rows[row] = [*rows[row][:3], str(row * 1e-3), *rows[row][4:]]

    # a clock that is too coarse is no logger that writes twice
    (fault,) = faults(edited(tmp_path, other_angles))
    assert "does not increase" in str(fault)


PROSE = """# A machine

It has a boom, and a stick, which we measured.
The boom, says its owner, weighs half a ton, more or less.

- its bucket, its teeth, its paint
- its log, which is elsewhere
"""


@pytest.mark.parametrize("text", [PROSE, "a: 1\nb: [x, y]\nc: {d: e}\n"])
def test_a_text_that_is_no_log_is_refused_without_its_words(
    text: str, tmp_path: Path
) -> None:
    path = tmp_path / "README.md"
    path.write_text(text)
    (fault,) = faults(path)
    assert fault.what == "holds no table of numbers"
    assert len(str(fault)) < 120 + len(str(path))


def test_one_column_is_one_signal(tmp_path: Path) -> None:
    copied = LogSettings.model_validate(
        {"joints": {2: {"angle": {"column": "q1_deg"}}}}
    )
    (fault,) = faults(edited(tmp_path, lambda rows: None), copied)
    assert "angle of joint 1 and angle of joint 2" in fault.what


def edited(tmp_path: Path, edit, rows: int = 80) -> Path:
    table = lines(cells(rows))
    edit(table)
    return save(tmp_path / "log.csv", table)


def test_every_fault_of_a_file_is_reported_at_once(tmp_path: Path) -> None:
    def spoil(rows: list[list[str]]) -> None:
        rows[10][1] = "120"
        rows[12][2] = ""
        rows[14][3] = "91"
        rows[16][3] = "x"
        rows[20] = rows[20][:3]
        rows[30][4] = "-"

    path = edited(tmp_path, spoil)
    assert {place(fault) for fault in faults(path)} == {
        "line 11, column u1_pct",
        "line 15, column q1_deg",
    }
    left_out = next(
        one
        for one in check_log(path, SETTINGS, RANGES)[1]
        if one.kind == "row left out"
    )
    assert str(left_out).endswith(
        "line 13, column u2_pct: no value is there (and 3 more rows, up to line 31): left out"
    )
    with pytest.raises(LogError, match=r"log\.csv, line 11, column u1_pct: "):
        read(path)


@pytest.mark.parametrize(
    "stamp",
    [
        lambda k: f"2024-05-01T12:00:00.{k:02d}",
        lambda k: f"2024-05-01 12:00:00.{k:02d}Z",
        lambda k: f"20240501T12:00:00.{k:02d}+02:00",
        lambda k: f"01.05.2024 12:00:00.{k:02d}",
        lambda k: f"5/1/2024 12:00:00.{k:02d} PM",
        lambda k: f"12:00:00.{k:02d}0000000",
        lambda k: f"23:59:59.{k + 60:02d}" if k < 40 else f"00:00:00.{k - 40:02d}",
        lambda k: (
            f"2024-02-29 23:59:59.{k + 60:02d}"
            if k < 40
            else f"2024-03-01 00:00:00.{k - 40:02d}"
        ),
    ],
)
def test_dates_and_times_of_day_count_from_the_first(stamp, tmp_path: Path) -> None:
    plain, _ = read(save(tmp_path / "plain.csv", lines(cells())))
    path = edited(tmp_path, clock(stamp))
    for unit in ("s", "ms"):  # the unit is that of numbers
        log, notes = read(path, LogSettings.model_validate({"time": {"unit": unit}}))
        assert notes == []
        np.testing.assert_array_equal(log.time, plain.time)
        np.testing.assert_array_equal(log.angle, plain.angle)


def test_a_joint_is_undriven_or_unmeasured_only_if_the_config_says_so(
    tmp_path: Path,
) -> None:
    path = edited(tmp_path, lambda rows: [row.__delitem__(slice(2, 4)) for row in rows])
    assert len(faults(path)) == 1
    mapping = {"joints": {1: {"angle": None}, 2: {"command": None}}}
    log, findings = read(path, LogSettings.model_validate(mapping))
    assert findings == []
    assert log.driven.tolist() == [True, False]
    assert log.has_angle.tolist() == [False, True]
    with pytest.raises(LogError, match="output joint 1 has no angle column"):
        read(path, LogSettings.model_validate(mapping), outputs=[1])
    log, _ = read(
        edited(tmp_path, lambda rows: [row.__delitem__(slice(3, 5)) for row in rows]),
        outputs=None,
    )
    assert log.driven.all()
    assert not log.has_angle.any()


@pytest.mark.parametrize("unused", [0, 5])
def test_reading_takes_no_more_memory_than_four_times_the_file(
    unused: int, tmp_path: Path
) -> None:
    values = cells(20_000)
    values = np.column_stack([values, np.repeat(values[:, 3:4], unused, axis=1)])
    header = ",".join([*NAMES, *(f"spare{k}" for k in range(unused))])
    path = tmp_path / "log.csv"
    np.savetxt(path, values, "%.6f", ",", header=header, comments="")
    check_log(path, SETTINGS, RANGES)  # whatever is loaded once
    tracemalloc.start()
    try:
        log, _ = check_log(path, SETTINGS, RANGES)
        assert log is not None
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 4 * path.stat().st_size


def test_a_joint_that_the_arm_lacks_is_refused(tmp_path: Path) -> None:
    settings = LogSettings.model_validate({"joints": {5: None}})
    with pytest.raises(LogError, match="no joint 5; the arm has joints 1 to 2"):
        read(edited(tmp_path, lambda rows: None), settings)


def test_a_column_that_is_lacking_is_named_with_the_setting_that_asks_for_it(
    tmp_path: Path,
) -> None:
    own = {"joints": {2: {"angle": {"column": "pot", "unit": "deg"}}}}
    (fault,) = faults(
        edited(tmp_path, lambda rows: None), LogSettings.model_validate(own)
    )
    assert "lacks 'pot'" in fault.what
    assert "set log.joints.2.angle to the right column" in fault.hint


def test_a_joint_that_is_not_compared_may_be_absent(tmp_path: Path) -> None:
    path = edited(
        tmp_path, lambda rows: [row.__delitem__(slice(2, 5, 2)) for row in rows]
    )
    log, (note,) = read(path, outputs=[1])
    assert (note.level, note.what) == ("note", "has no column of joint 2")
    assert log.driven.tolist() == log.has_angle.tolist() == [True, False]
    (fault,) = faults(path, outputs=[2])
    assert "'u2_pct' (command of joint 2)" in fault.what
    named = LogSettings.model_validate({"joints": {2: {"angle": {"unit": "rad"}}}})
    assert len(faults(path, named, outputs=[1])) == 1


def test_a_jittering_clock_needs_no_repair_and_shifts_nothing(tmp_path: Path) -> None:
    """At 20 Hz, steps of 0.02 to 0.08 s: an integrating joint goes where the held
    commands take it."""
    rng = np.random.default_rng(0)
    time = 0.05 * np.arange(200) + rng.uniform(-0.016, 0.016, 200) - 0.0001
    command, angle = 60 * np.sign(np.sin(time)), 10 + 9 * np.sin(time)
    values = np.round(
        np.stack([time - time[0], command, command, angle, angle], axis=1), 4
    )
    path = save(tmp_path / "log.csv", lines(values))
    assert np.diff(values[:, 0]).max() > 1.5 * 0.05
    log, _ = read(path, LogSettings(period_s=0.05))
    np.testing.assert_allclose(
        np.rad2deg(log.angle[:, 0]), 10 + 9 * np.sin(log.time + time[0]), atol=0.01
    )
    travel = np.append(0, np.cumsum(np.diff(values[:, 0]) * values[:-1, 1]))
    there = np.interp(log.time + 0.05, values[:, 0], travel)[:-2]
    np.testing.assert_allclose(0.05 * np.cumsum(log.command[:-2, 0]), there, atol=1e-9)
    gap = save(tmp_path / "gap.csv", lines(np.delete(values, np.s_[50:52], axis=0)))
    bridged, (lost, *_) = read(gap, LogSettings(period_s=0.05))
    assert (lost.level, lost.what) == ("warning", "samples lost: 2")
    assert len(bridged.time) == len(log.time)


def test_a_faster_log_gives_the_means_of_its_commands(tmp_path: Path) -> None:
    """An integrating joint ends where the whole log takes it, wherever the steps
    fall."""
    values = cells(400)
    values[:, 1] = np.where((values[:, 0] > 0.4) & (values[:, 0] < 1.33), 80, 0)
    path = save(tmp_path / "log.csv", lines(values))
    for delay in (0.0, 0.03):
        exact, _ = read(path, LogSettings(delay_s=delay))
        coarse, _ = read(path, LogSettings(period_s=0.05, delay_s=delay))
        travel, found = (
            np.cumsum(x.command * x.period, axis=0) for x in (exact, coarse)
        )
        np.testing.assert_allclose(found[:-1], travel[4::5][:79], atol=1e-9)
        np.testing.assert_array_equal(coarse.command[0, 0], 0)


def test_a_slower_log_gives_commands_on_a_line_between_its_samples(
    tmp_path: Path,
) -> None:
    values = cells(400)[::5]
    slower, _ = read(save(tmp_path / "slow.csv", lines(values)))
    means = slower.command[:395].reshape(79, 5, 2).mean(axis=1)
    np.testing.assert_allclose(
        means, 0.5 * (values[:-1, 1:3] + values[1:, 1:3]), atol=1e-9
    )


def test_the_delay_setting_moves_the_command_only(tmp_path: Path) -> None:
    path = save(tmp_path / "log.csv", lines(cells()))
    plain, _ = read(path)
    late, _ = read(path, LogSettings(delay_s=0.07))
    np.testing.assert_array_equal(late.command[7:], plain.command[:-7])
    np.testing.assert_array_equal(late.command[:7], 0)
    np.testing.assert_array_equal(late.angle, plain.angle)
