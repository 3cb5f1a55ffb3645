"""What `guess_columns` makes of tables that nobody has described."""

from pathlib import Path

import numpy as np
import pytest
from log_files import read

from hydroid.errors import LogError
from hydroid.log import ColumnGuess, Table, guess_columns, open_table
from hydroid.log.clues import joint_of, number_in
from hydroid.settings.log import LogSettings

JOINTS = ("swing", "boom", "stick", "bucket")
T = np.arange(2000) * 0.02
STEPS = np.repeat(np.random.default_rng(1).choice([-80.0, -40, 0, 0, 40, 80], 40), 50)
SWEEP = 20 * np.sin(0.4 * T)


def guess(
    folder: Path, names: list[str], *columns: np.ndarray, above: str = ""
) -> ColumnGuess:
    path = folder / "log.csv"
    np.savetxt(
        path,
        np.stack(columns, axis=1),
        delimiter=",",
        header=above + ",".join(names),
        comments="",
    )
    return guess_columns([open_table(path)], JOINTS)


@pytest.mark.parametrize(
    ("scale", "offset", "unit", "entry"),
    [
        (0.01, 0, "", {"scale": 100.0}),
        (0.1, 0, "V", {"scale": 10.0}),
        (10, 0, "", {"scale": 0.1}),
        (1, 0, "%", {}),
        (0.08, 12, "mA", {"scale": 12.5, "offset": -150.0}),
        (0.025, 2.5, "V", {"scale": 40.0, "offset": -100.0}),
        (0.05, 5, "V", {"scale": 20.0, "offset": -100.0}),
    ],
)
def test_the_range_of_a_command(
    scale: float, offset: float, unit: str, entry: dict, tmp_path: Path
) -> None:
    names = ["Time [ms]", f"boomCmd [{unit}]", "boomAngle"]
    found = guess(tmp_path, names, 1000 * T, offset + scale * STEPS, np.deg2rad(SWEEP))
    assert found.log["time"] == {"column": "Time [ms]", "unit": "ms"}
    mapped = found.log["joints"][2]
    assert mapped["command"] == {"column": names[1], **entry}
    assert mapped["angle"] == {"column": "boomAngle", "unit": "rad"}
    settings = LogSettings.model_validate(found.log)
    log, _ = read(tmp_path / "log.csv", settings, dict.fromkeys("1234", (-1.22, 1.22)))
    np.testing.assert_allclose(log.command[:, 1], STEPS, atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(log.angle[:, 1]), SWEEP, atol=1e-9)


def test_names_without_a_joint_go_by_their_order_and_that_is_said(
    tmp_path: Path,
) -> None:
    found = guess(
        tmp_path,
        ["t", "up", "down", "pot (deg)"],
        T,
        STEPS.clip(0),
        (-STEPS).clip(0),
        SWEEP,
    )
    assert found.log["joints"][1]["command"]["column"] == ["up", "down"]
    assert found.log["joints"][1]["angle"]["column"] == "pot (deg)"
    assert any("by its place in the log: check" in reason for reason in found.reasons)


@pytest.mark.parametrize(
    ("side_a", "side_b"),
    [
        ("I_boom_A_mA", "I_boom_B_mA"),
        ("I_boom_A_A", "I_boom_B_A"),
        ("boom coil A [A]", "boom coil B [A]"),
    ],
)
def test_two_coils_are_one_command(side_a: str, side_b: str, tmp_path: Path) -> None:
    """The unit of a current is no name of a side."""
    a, b = (12 * part.clip(0) for part in (STEPS, -STEPS))
    found = guess(tmp_path, ["t", side_b, side_a, "boom_deg"], T, b, a, SWEEP)
    assert found.log["joints"][2]["command"]["column"] == [side_a, side_b]


def test_a_current_loop_for_each_direction_is_its_range(tmp_path: Path) -> None:
    up, down = (4 + 0.16 * part.clip(0) for part in (STEPS, -STEPS))
    found = guess(
        tmp_path, ["t", "u2_up_mA", "u2_down_mA", "q2_deg"], T, up, down, SWEEP
    )
    command = found.log["joints"][2]["command"]
    assert command == {
        "column": ["u2_up_mA", "u2_down_mA"],
        "scale": 6.25,
        "offset": -25.0,
    }
    settings = LogSettings.model_validate(found.log)
    log, _ = read(tmp_path / "log.csv", settings, dict.fromkeys("12", (-9.0, 9.0)))
    np.testing.assert_allclose(log.command[:, 1], STEPS, atol=1e-9)


def test_numbers_from_zero_other_words_for_joints_and_derived_signals(
    tmp_path: Path,
) -> None:
    names = [
        "stamp",
        "valve0",
        "pos0",
        "valve1",
        "pos1",
        "dipper_angle",
        "vel1_rad",
        "p1_bar",
    ]
    found = guess(
        tmp_path, names, T, STEPS, SWEEP, -STEPS, -SWEEP, SWEEP, SWEEP, SWEEP + 50
    )
    mapped = found.log["joints"]
    assert mapped[1]["command"]["column"] == "valve0"
    assert mapped[2]["angle"]["column"] == "pos1"
    assert mapped[3] == {
        "command": None,
        "angle": {"column": "dipper_angle", "unit": "deg"},
    }
    assert found.unused == ("vel1_rad", "p1_bar")
    assert any("count from 0" in reason for reason in found.reasons)


def test_the_bare_name_of_a_joint_or_of_what_a_command_moves_is_an_angle(
    tmp_path: Path,
) -> None:
    for names in (
        ["t", "valve_lift", "lift", "lift_speed"],
        ["t", "u2", "Boom_joint", "flow"],
    ):
        found = guess(tmp_path, names, T, STEPS, SWEEP, SWEEP)
        (mapped,) = found.log["joints"].values()
        assert mapped == {
            "command": {"column": names[1]},
            "angle": {"column": names[2], "unit": "deg"},
        }
        assert found.unused == (names[3],)


def test_no_time_is_an_error_that_lists_the_columns(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="it has a and b"):
        guess(tmp_path, ["a", "b"], STEPS, SWEEP)


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("u2_pct", 2),
        ("valve 007", 7),
        ("u0", 0),
        ("u100", None),
        ("u" + "9" * 5000, None),
    ],
)
def test_the_last_number_of_a_name_is_a_joints_if_it_has_two_digits_at_most(
    name: str, number: int | None
) -> None:
    assert number_in(name) == number


def test_digits_in_a_topics_name_number_no_joint():
    """`/CalibratedJointVals3.position[Boom]` is the boom's, and no column of a topic 3
    is joint 3's."""
    joints = ["swing", "boom", "stick", "bucket"]
    for name, joint in (("Boom", 2), ("Stick", 3), ("2", None)):
        assert joint_of(f"/CalibratedJointVals3.position[{name}]", joints) == joint
    assert number_in("/CalibratedJointVals3.position[Boom]") is None
    assert number_in("/CalibratedJointVals3.position[2]") == 2
    assert number_in("/valve3/command.data") == 3
    assert number_in("/valve3/angle [deg]") == 3


DUTY = 2.5 * np.repeat([0, 0.8, 0, -0.8, 0, 0.5, -1, 0], 100)
"""around a rest, of pulses of 5 to 10 %"""


def test_a_command_that_rests_beside_the_middle_rests_at_zero_and_is_in_the_range_of_the_others(
    tmp_path: Path,
) -> None:
    """As servo amplifiers are trimmed, whose converters overshoot."""
    rests = {"swing": 7.4695, "boom": 7.614, "stick": 6.9645}
    names, columns = ["t"], [0.02 * np.arange(len(DUTY))]
    for joint, rest in rests.items():
        names += [f"{joint}_cmd", f"{joint}_deg"]
        columns += [
            rest + (0.75 if joint == "stick" else 1.03) * DUTY,
            3 * np.sin(columns[0]),
        ]
    np.savetxt(
        tmp_path / "log.csv",
        np.stack(columns, 1),
        "%.6g",
        ",",
        header=",".join(names),
        comments="",
    )
    found = guess_columns([open_table(tmp_path / "log.csv")], list(rests))
    settings = LogSettings.model_validate(found.log)
    for number, (joint, rest) in enumerate(rests.items(), 1):
        command = settings.columns("command", number)
        assert command is not None
        assert command.scale * rest + command.offset == pytest.approx(0, abs=1e-3)
        share = 75 if joint == "stick" else 100
        assert np.abs(
            command.scale * columns[2 * number - 1] + command.offset
        ).max() == pytest.approx(share, abs=0.1)
        assert (
            f"{joint}_cmd: command in pulses of 5 to 10 % duty, at rest at {rest:.6g}"
            in str(found.reasons)
        )


def test_what_is_called_ms_and_is_no_time_is_measured(tmp_path: Path) -> None:
    time = 0.02 * np.arange(800)
    columns = np.stack([time, 60 * np.sign(np.sin(time)), 9 + 2 * np.sin(time)], axis=1)
    header = "Time,Boom Cmd,Boom Ms"
    np.savetxt(tmp_path / "log.csv", columns, "%.6g", ",", header=header, comments="")
    found = guess_columns([open_table(tmp_path / "log.csv")], ["boom"])
    assert found.log["joints"][1]["angle"]["column"] == "Boom Ms"
    assert found.log["joints"][1]["command"]["column"] == "Boom Cmd"


@pytest.mark.parametrize(
    ("name", "ends"), [("boom_pot_V", (0.6, 4.1)), ("boom_encoder_counts", (150, 3900))]
)
def test_a_sensors_signal_is_taken_for_the_whole_range(
    name: str, ends: tuple, tmp_path: Path
) -> None:
    time = 0.02 * np.arange(800)
    cells = np.interp(np.sin(time), [-1, 1], ends)
    columns = np.stack([time, 60 * np.cos(time), cells], axis=1)
    np.savetxt(
        tmp_path / "log.csv",
        columns,
        "%.9g",
        ",",
        header=f"time_s,boom_cmd,{name}",
        comments="",
    )
    found = guess_columns(
        [open_table(tmp_path / "log.csv")], ["boom"], ranges={1: (-0.5, 1.0)}
    )
    angle = LogSettings.model_validate(found.log).columns("angle", 1)
    assert angle is not None
    reached = angle.scale * np.array([cells.min(), cells.max()]) + angle.offset
    np.testing.assert_allclose(reached, np.degrees([-0.5, 1.0]), atol=1e-2)
    assert "taken for the whole range" in str(found.reasons)


def test_a_sensor_without_a_scale_is_spread_over_what_all_logs_reach(
    tmp_path: Path,
) -> None:
    names = "time_s,boom_cmd,boom_counts"
    tables = list[Table]()
    for name, cells in (("a", 600 + SWEEP), ("b", 500 + SWEEP), ("c", 700 + SWEEP)):
        rows = np.stack([T, STEPS, cells], axis=1)
        np.savetxt(tmp_path / name, rows, delimiter=",", header=names, comments="")
        tables.append(open_table(tmp_path / name))
    found = guess_columns(tables, ["boom"], ranges={1: (-0.5, 1.0)})
    angle = LogSettings.model_validate(found.log).columns("angle", 1)
    assert angle is not None
    reach = np.array([500 + SWEEP.min(), 700 + SWEEP.max()])
    reached = angle.scale * reach + angle.offset
    np.testing.assert_allclose(reached, np.degrees([-0.5, 1.0]), atol=1e-2)
    assert f"{angle.scale:.3g} deg per count" in str(found.reasons)


@pytest.mark.parametrize("counts", [1024, 3600, 4096])
@pytest.mark.parametrize("way", [1, -1])
def test_an_encoder_that_begins_anew_tells_its_scale(
    counts: int, way: int, tmp_path: Path
) -> None:
    """Of the joint's own shaft; its zero is not known."""
    turned = 40 * np.sin(0.4 * T)
    cells = np.mod(np.round(counts * (0.98 + way * turned / 360)), counts)
    columns = (T, STEPS, cells)
    found = guess(tmp_path, ["time_s", "boom_cmd", "boom_counts"], *columns)
    assert found.log["joints"][2]["angle"]["scale"] == pytest.approx(
        360 / counts, rel=1e-5
    )
    assert found.mirrored[2]["scale"] == -found.log["joints"][2]["angle"]["scale"]
    assert f"{counts} counts a turn" in str(found.reasons)


def test_counts_of_a_joint_without_ends_are_left_out(tmp_path: Path) -> None:
    columns = (T, STEPS, 2000 + 10 * SWEEP)
    found = guess(tmp_path, ["time_s", "swing_cmd", "swing_counts"], *columns)
    assert found.log["joints"][1]["angle"] is None
    assert "tells no scale" in str(found.reasons)


def test_sensors_of_which_one_counts_all_count(tmp_path: Path) -> None:
    """120 to 160 are possible angles, too."""
    names = ["time_s", "boom_cmd", "stick_cmd", "boom_pot", "stick_pot", "swing_angle"]
    columns = (T, STEPS, -STEPS, 600 + SWEEP, 140 + SWEEP, SWEEP)
    np.savetxt(
        tmp_path / "log.csv",
        np.stack(columns, axis=1),
        delimiter=",",
        header=",".join(names),
        comments="",
    )
    ranges = dict.fromkeys((1, 2, 3), (-0.5, 1.0))
    found = guess_columns([open_table(tmp_path / "log.csv")], JOINTS, ranges=ranges)
    settings = LogSettings.model_validate(found.log)
    for joint in (2, 3):
        angle = settings.columns("angle", joint)
        assert angle is not None
        assert angle.scale * 40 == pytest.approx(np.degrees(1.5), rel=1e-3)
    swing = settings.columns("angle", 1)
    assert swing is not None
    assert (swing.unit, swing.scale) == ("deg", 1)


@pytest.mark.parametrize(
    ("name", "cells", "boom", "unit"),
    [
        ("telescope_pot_cnt", (600, 1700), (-20, 20), "m"),
        ("telescope_pot", (1331, 3516), (-20, 20), "m"),
        ("telescope_pot", (600, 1700), (766, 2934), "m"),
        ("telescope_pot", (600, 1700), (-20, 20), "mm"),
        ("telescope_pot", (0.6, 1.7), (766, 2934), "m"),
        ("telescope_wire", (1331, 3516), (-20, 20), "mm"),
        ("telescope_wire", (1331, 3516), (766, 2934), "m"),
        ("telescope_pos", (1331, 3516), (766, 2934), "mm"),
    ],
)
def test_a_sensor_of_a_slide_counts_as_one_of_a_turning_joint_does(
    name: str, cells: tuple, boom: tuple, unit: str, tmp_path: Path
) -> None:
    """By its name, by its size, or as the others do; the boom's may hold degrees."""
    columns = [T, STEPS, np.interp(SWEEP, [-20, 20], boom)]
    columns += [STEPS, np.interp(SWEEP, [-20, 20], cells)]
    np.savetxt(
        tmp_path / "log.csv",
        np.stack(columns, axis=1),
        delimiter=",",
        header=f"time_s,boom_cmd,boom_pot,telescope_cmd,{name}",
        comments="",
    )
    found = guess_columns(
        [open_table(tmp_path / "log.csv")],
        ["boom", "telescope"],
        slides=[2],
        ranges={1: (-0.5, 1.0), 2: (0.0, 1.8)},
    )
    angle = found.log["joints"][2]["angle"]
    assert angle["unit"] == unit
    counts = "offset" in angle
    assert counts == (f"{name}: {cells[0]} to {cells[1]} counts" in str(found.reasons))
    if counts:
        reached = angle["scale"] * np.array(cells) + angle["offset"]
        np.testing.assert_allclose(reached, [0.0, 1.8], atol=1e-4)
    else:
        assert angle == {"column": name, "unit": unit}


def test_a_command_that_is_never_0_has_its_rest_elsewhere(tmp_path: Path) -> None:
    columns = (T, 8 + 1.9 * np.sin(0.4 * T + 1), SWEEP)
    found = guess(tmp_path, ["time_s", "boom_cmd", "boom_deg"], *columns)
    (reason,) = [one for one in found.reasons if one.startswith("boom_cmd")]
    assert "never 0" in reason


def test_two_arms_keep_their_columns_apart(tmp_path: Path) -> None:
    names = "time_s,right_boom_cmd,left_boom_cmd,right_boom_deg,left_boom_deg"
    rows = np.stack([T, STEPS, -STEPS, 10 + SWEEP, SWEEP], axis=1)
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=names, comments="")
    tables = [open_table(tmp_path / "log.csv")]
    for side, other in (("left", "right"), ("right", "left")):
        found = guess_columns(tables, [f"{side}_boom", f"{side}_stick"])
        boom = found.log["joints"][1]
        assert boom["command"]["column"] == f"{side}_boom_cmd"
        assert boom["angle"]["column"] == f"{side}_boom_deg"
        assert 2 not in found.log["joints"]
        assert {f"{other}_boom_cmd", f"{other}_boom_deg"} <= {*found.unused}


@pytest.mark.parametrize(
    ("shift", "limits", "offset"),
    [
        (360, (-130, -20), -360),
        (360, (-10, 20), -360),
        (0, (-130, -20), 0),
        (360, (180, 340), 0),
    ],
    ids=["in its range", "in no range", "negative", "a range beyond half a turn"],
)
def test_angles_from_0_to_360_are_moved_by_a_turn(
    shift: float, limits: tuple[float, float], offset: float, tmp_path: Path
) -> None:
    """Angles of -80 to -40 deg, as a sensor counts them that has no negative ones."""
    log = tmp_path / "log.csv"
    angle = SWEEP - 60 + shift
    header = "t,stick_cmd,stick_deg"
    np.savetxt(
        log, np.stack([T, STEPS, angle], 1), delimiter=",", header=header, comments=""
    )
    low, high = np.radians(limits).tolist()
    found = guess_columns([open_table(log)], ["stick"], ranges={1: (low, high)})
    assert found.log["joints"][1]["angle"].get("offset", 0) == offset
    assert any("a whole turn" in reason for reason in found.reasons) == bool(offset)


@pytest.mark.parametrize(
    ("other", "own", "kind"),
    [
        ("Boom_Spool_Pos", "Boom_Angle", "angle"),
        ("Boom_Valve_Position [mm]", "Boom_Angle", "angle"),
        ("Boom_Valve_Feedback [V]", "Boom_Angle", "angle"),
        ("Boom_Angle_SP", "Boom_Angle_PV", "angle"),
        ("Ausleger_Winkel_Soll", "Ausleger_Winkel_Ist", "angle"),
        ("Boom_SP_deg", "Boom_PV_deg", "angle"),
        ("Boom_Joystick", "Boom_Valve_Cmd", "command"),
        ("joy_boom [%]", "pwm_boom [%]", "command"),
        ("Boom_Angle_Cmd", "Boom_Cmd", "command"),
        ("lever_boom", "u_boom", "command"),
        ("Boom_Valve_Feedback", "Boom_Valve", "command"),
    ],
)
def test_of_two_columns_the_joints_own_is_taken(
    other: str, own: str, kind: str, tmp_path: Path
) -> None:
    """Whatever their order; and a line names the other one."""
    rest = {"command": "boom_deg", "angle": "boom_cmd"}[kind]
    signals = {"command": STEPS, "angle": SWEEP}
    (other_kind,) = signals.keys() - {kind}
    for names in ([other, own], [own, other]):
        columns = [signals[kind], signals[kind], signals[other_kind]]
        found = guess(tmp_path, ["t", *names, rest], T, *columns)
        assert found.log["joints"][2][kind]["column"] == own
        assert other in found.unused


@pytest.mark.parametrize("name", ["cycle", "PLC_Tick", "counter"])
def test_a_counter_is_no_time_by_its_values(name: str, tmp_path: Path) -> None:
    """Counts of 10 ms, every fifth of them logged, look like times in ms."""
    counts = 5.0 * np.arange(len(T))
    with pytest.raises(LogError, match=f"{name} counts.*such as {name}_ms"):
        guess(tmp_path, [name, "boom_cmd", "boom_deg"], counts, STEPS, SWEEP)
    named = [f"{name}_ms", "boom_cmd", "boom_deg"]
    assert guess(tmp_path, named, counts, STEPS, SWEEP).log["time"]["unit"] == "ms"


def test_a_column_of_the_commands_direction_is_named(tmp_path: Path) -> None:
    names = ["t", "boom_pwm", "boom_dir", "boom_deg"]
    found = guess(tmp_path, names, T, np.abs(STEPS), 1.0 * (STEPS > 0), SWEEP)
    assert found.unused == ("boom_dir",)
    assert any("boom_dir: like the direction" in reason for reason in found.reasons)
