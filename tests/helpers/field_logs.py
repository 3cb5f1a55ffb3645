"""Logs as machines record them, of which the truth is known: are they read rightly, or
is it said?

All are of the template's arm, a boom and a stick, so that `hydroid init DIR --log LOG`
takes them alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from printed import Known, follow
from truths import Speed, judged

import hydroid
from hydroid.errors import HydroidError
from hydroid.log import Log
from hydroid.settings.arm import Arm
from hydroid.settings.cylinder import LinearActuator

JOINTS = ("boom", "stick")
PERIOD = 0.02
RANGES = {"boom": (-30.0, 60.0), "stick": (-130.0, -20.0)}
SPEEDS = {"boom": 0.2, "stick": -0.3}
"""[deg/s] of each % above the dead band; the stick's rod pushes it down"""
DEAD = 15.0  # [%]
CLOSE_COMMAND, CLOSE_ANGLE = 2.0, 0.5
"""differences from the truth [%, deg] below which a log is read rightly"""
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Truth:
    """Time [s], commands [%] and angles [deg] by joint."""

    time: np.ndarray
    command: Columns
    angle: Columns


@dataclass(frozen=True)
class FieldLog:
    """A log of one kind: what writes it of the truth; `said`: words of the line that
    must be printed.

    Without these it must be read rightly, though `lost` [s] of it may be missing.
    """

    name: str
    write: Callable[[Truth, Arm], str]
    said: str = ""
    lost: float = 0.1
    steps: tuple[float, ...] = (70, -60, 100, -100, 45, -80)


def make_truth(steps: tuple[float, ...], arm: Arm | None = None) -> Truth:
    """Rest, then steps of both joints in turn, of 2 s with 1 s of rest between.

    With an arm its cylinders have the speeds, which turn the joints by their pins; in
    the middle of the ranges the joints' speeds are the same.
    """
    commands = {name: [np.zeros(100)] for name in JOINTS}
    for k, step in enumerate(steps * 2):
        driven = JOINTS[k // len(steps)]
        for name in JOINTS:
            commands[name] += [
                np.full(100, step if name == driven else 0.0),
                np.zeros(50),
            ]
    command = {name: np.concatenate(parts) for name, parts in commands.items()}
    angle = {name: _moved(command[name], name, arm) for name in JOINTS}
    return Truth(PERIOD * np.arange(len(command["boom"])), command, angle)


def settled(name: str, command: float) -> float:
    """Return the speed of a joint [deg/s] that a command [%] settles at."""
    return float(SPEEDS[name] * np.sign(command) * max(abs(command) - DEAD, 0.0))


def lever(name: str, arm: Arm | None, angles: np.ndarray) -> np.ndarray:
    """Return how much farther a joint's cylinder moves per angle than in the middle of
    the joint's range, at angles [deg]."""
    if arm is None:
        return np.ones(len(angles))
    cylinder = arm.joints[JOINTS.index(name)].actuator
    assert isinstance(cylinder, LinearActuator)
    middle = cylinder.moment_arm(np.radians([np.mean(RANGES[name])]))
    return cylinder.moment_arm(np.radians(angles)) / middle


def _moved(command: np.ndarray, name: str, arm: Arm | None) -> np.ndarray:
    low, high = RANGES[name]
    grid = np.linspace(low, high, 200)
    levers = lever(name, arm, grid)
    angle, speed, angles = (low + high) / 2, 0.0, list[float]()
    for u in command:
        speed += (settled(name, u) - speed) * PERIOD / 0.1
        step = PERIOD * speed / np.interp(angle, grid, levers)
        angle = float(np.clip(angle + step, low, high))
        angles.append(angle)
    return np.array(angles)


def text(columns: Mapping[str, np.ndarray]) -> str:
    """Return a CSV of columns; of numbers with nine digits."""
    cells = [
        values.tolist()
        if values.dtype.kind in "UO"
        else ["" if np.isnan(value) else f"{value:.9g}" for value in values]
        for values in columns.values()
    ]
    return (
        "\n".join(
            [",".join(columns), *(",".join(row) for row in zip(*cells, strict=True))]
        )
        + "\n"
    )


def table(truth: Truth) -> Columns:
    """Return the columns of a well-kept log."""
    columns = {"time_s": truth.time}
    columns |= {f"{name}_cmd_pct": truth.command[name] for name in JOINTS}
    return columns | {f"{name}_angle_deg": truth.angle[name] for name in JOINTS}


def commands(
    label: str, change: Callable[[np.ndarray], np.ndarray]
) -> Callable[[Truth, Arm], str]:
    """Return what writes commands as they are sent, under the joint's name and a
    label."""

    def write(truth: Truth, arm: Arm) -> str:
        columns = {"time_s": truth.time} | {
            f"{n}_{label}": change(truth.command[n]) for n in JOINTS
        }
        return text(
            columns | {f"{name}_angle_deg": truth.angle[name] for name in JOINTS}
        )

    return write


def lengths(
    label: str, factor: float, *, travel: bool = False
) -> Callable[[Truth, Arm], str]:
    """Return what writes the lengths of cylinders in place of angles, or the travel of
    their rods."""

    def write(truth: Truth, arm: Arm) -> str:
        columns = {"time_s": truth.time} | {
            f"{n}_cmd_pct": truth.command[n] for n in JOINTS
        }
        for joint in arm.joints:
            assert isinstance(joint.actuator, LinearActuator)
            length = joint.actuator.length(np.radians(truth.angle[joint.name]))
            shortest = joint.actuator.length(np.array(joint.limits)).min()
            columns[f"{joint.name}_{label}"] = factor * (length - travel * shortest)
        return text(columns)

    return write


def wires(
    label: str, low: float, high: float, *, clip: float = 1.0
) -> Callable[[Truth, Arm], str]:
    """Return what writes draw wires along the cylinders, whose signal goes from low to
    high over the stroke.

    A wire that is too short stays at a part of it, `clip`.
    """

    def write(truth: Truth, arm: Arm) -> str:
        columns = {"time_s": truth.time} | {
            f"{n}_cmd_pct": truth.command[n] for n in JOINTS
        }
        for joint in arm.joints:
            assert isinstance(joint.actuator, LinearActuator)
            length = joint.actuator.length(np.radians(truth.angle[joint.name]))
            shortest, longest = np.sort(joint.actuator.length(np.array(joint.limits)))
            part = ((length - shortest) / (longest - shortest)).clip(0, clip)
            columns[f"{joint.name}_{label}"] = low + (high - low) * part
        return text(columns)

    return write


def changed(change: Callable[[Columns], Columns]) -> Callable[[Truth, Arm], str]:
    """Return what writes a well-kept log whose columns are changed."""
    return lambda truth, arm: text(change(table(truth)))


def lines(change: Callable[[list[str]], list[str]]) -> Callable[[Truth, Arm], str]:
    """Return what writes a well-kept log whose lines are changed."""
    return lambda truth, arm: "\n".join(change(text(table(truth)).splitlines()))


def _stamps(columns: Columns) -> Columns:
    start = np.datetime64("2026-03-01T23:59:50.000")
    stamps = start + np.round(1e3 * columns["time_s"]).astype("m8[ms]")
    return {"stamp": stamps.astype(str)} | {
        name: own for name, own in columns.items() if name != "time_s"
    }


def _renamed(columns: Columns, factor: float, name: str) -> Columns:
    others = {key: values for key, values in columns.items() if key != "time_s"}
    whole = np.array([f"{round(factor * one)}" for one in columns["time_s"]])
    return {name: whole} | others


def _dirty(rows: list[str]) -> list[str]:
    cells = rows[300].split(",")
    rows[300] = ",".join([*cells[:3], "nan", *cells[4:]])
    return [*rows[:500], rows[499], *rows[500:700], rows[0], *rows[700:]]


def _half(columns: Columns) -> Columns:
    return {n: v.clip(0) if "cmd" in n else v for n, v in columns.items()}


def _targets(columns: Columns) -> Columns:
    ahead = {
        n: np.r_[v[10:], np.full(10, v[-1])] for n, v in columns.items() if "angle" in n
    }
    kept = {name: own for name, own in columns.items() if "cmd" not in name}
    return kept | {name.replace("angle", "target"): own for name, own in ahead.items()}


def _counts(columns: Columns) -> Columns:
    turned = {
        n.replace("deg", "counts"): np.round(2048 + v * 4096 / 360)
        for n, v in columns.items()
    }
    return {n: v for n, v in columns.items() if "angle" not in n} | {
        n: v for n, v in turned.items() if "angle" in n
    }


def _backwards(columns: Columns) -> Columns:
    counts = _counts(columns)
    return {n: 4095 - v if "counts" in n else v for n, v in counts.items()}


def _other_sign(columns: Columns) -> Columns:
    return columns | {"stick_angle_deg": -columns["stick_angle_deg"]}


def _slower(columns: Columns) -> Columns:
    """Return angles in every second row, as where channels of several rates are joined."""
    rows = np.arange(len(columns["time_s"]))
    return {
        n: np.where(rows % 2 == 0, v, np.nan) if "angle" in n else v
        for n, v in columns.items()
    }


def _switched(columns: Columns) -> Columns:
    switched = {"time_s": columns["time_s"]}
    for name in JOINTS:
        command = columns[f"{name}_cmd_pct"]
        switched[f"{name}_up"] = (command > 0).astype(str)
        switched[f"{name}_down"] = (command < 0).astype(str)
    return switched | {n: v for n, v in columns.items() if "angle" in n}


def _german(columns: Columns) -> Columns:
    german = {"boom": "Ausleger", "stick": "Stiel"}
    renamed = {"Zeit": columns["time_s"]}
    for name in JOINTS:
        renamed[f"{german[name]}_Ventil"] = columns[f"{name}_cmd_pct"]
        renamed[f"{german[name]}_Winkel"] = columns[f"{name}_angle_deg"]
    return renamed


def _turning(columns: Columns) -> Columns:
    counts = _counts(columns)
    return {n: (v + 1500) % 4096 if "counts" in n else v for n, v in counts.items()}


def _ten_bits(columns: Columns) -> Columns:
    """Return potentiometers of which one never gives more than an angle could be."""
    others = {name: own for name, own in columns.items() if "angle" not in name}
    pots = {f"{n}_pot": np.round(500 + 2 * columns[f"{n}_angle_deg"]) for n in JOINTS}
    return others | pots


def _pots(columns: Columns) -> Columns:
    others = {name: own for name, own in columns.items() if "angle" not in name}
    return others | {
        f"{name}_pot_V": 2.5 + columns[f"{name}_angle_deg"] / 60 for name in JOINTS
    }


def _jump(columns: Columns) -> Columns:
    moved = columns["boom_angle_deg"] + 12.0 * (columns["time_s"] > 20)
    return columns | {"boom_angle_deg": moved}


def _still(columns: Columns) -> Columns:
    return {name: 0 * own if "cmd" in name else own for name, own in columns.items()}


def _received(command: np.ndarray) -> np.ndarray:
    """Return pulses, and 0 while a receiver has no signal."""
    pulses = 1500 + 5 * command
    pulses[500:530] = 0
    return pulses


def _thousandths(columns: Columns) -> Columns:
    return {
        name.replace("deg", "mdeg"): 1e3 * own if "angle" in name else own
        for name, own in columns.items()
    }


def _logged_at(columns: Columns) -> Columns:
    return {
        "logged at" if name == "stamp" else name: own
        for name, own in _stamps(columns).items()
    }


def _encoders(columns: Columns) -> Columns:
    return {
        name.replace("angle_counts", "enc"): own
        for name, own in _counts(columns).items()
    }


FIELD_LOGS = (
    FieldLog("pulses of 1000 to 2000 µs", commands("us", lambda u: 1500 + 5 * u)),
    FieldLog("duty of 0 to 100 % around 50", commands("duty", lambda u: 50 + 0.5 * u)),
    FieldLog("4 to 20 mA", commands("valve_mA", lambda u: 12 + 0.08 * u)),
    FieldLog(
        "3 to 9 V of a supply of 12 V", commands("joystick_V", lambda u: 6 + 0.03 * u)
    ),
    FieldLog(
        "0.25 to 0.75 of a supply", commands("joystick", lambda u: 0.5 + 0.0025 * u)
    ),
    FieldLog(
        "-1, 0 and 1 of switched valves",
        commands("cmd", lambda u: u / 100),
        steps=(100, -100, 100),
    ),
    FieldLog("bytes around 127", commands("joy", lambda u: np.round(127 + 1.27 * u))),
    FieldLog("permille on a bus", commands("cmd", lambda u: 10 * u)),
    FieldLog("cylinder lengths in mm", lengths("cyl_mm", 1e3)),
    FieldLog("travel of the rods in cm", lengths("stroke_cm", 1e2, travel=True)),
    FieldLog("cylinder lengths without a unit", lengths("cylinder_length", 1.0)),
    FieldLog("a hole of 2 s", lines(lambda rows: rows[:600] + rows[700:]), lost=2.1),
    FieldLog("a last line cut off", lines(lambda rows: [*rows[:-1], rows[-1][:7]])),
    FieldLog("a cell without a number, a row twice, names again", lines(_dirty)),
    FieldLog(
        "more names than cells",
        lines(lambda rows: [rows[0] + ",note,operator", *rows[1:]]),
    ),
    FieldLog("dates and times past midnight", changed(_stamps)),
    FieldLog("time in ns", changed(lambda columns: _renamed(columns, 1e9, "time_ns"))),
    FieldLog("pulses of 900 to 2100 µs", commands("us", lambda u: 1500 + 6 * u)),
    FieldLog(
        "channels of a receiver", commands("cmd", lambda u: np.round(992 + 8.19 * u))
    ),
    FieldLog("a receiver that loses its signal", commands("pwm", _received), lost=0.7),
    FieldLog("cylinder lengths in inches", lengths("cyl_in", 1 / 0.0254)),
    FieldLog("angles in thousandths of a degree", changed(_thousandths)),
    FieldLog("an angle of the other sign", changed(_other_sign)),
    FieldLog("channels of several rates", changed(_slower), steps=(50, -50, 45, -45)),
    FieldLog(
        "true and false of switched valves", changed(_switched), steps=(100, -100, 100)
    ),
    FieldLog("German names", changed(_german)),
    FieldLog("encoders that begin anew", changed(_turning), "4096 counts a turn"),
    FieldLog("counts as small as angles", changed(_ten_bits), "to 416 counts, "),
    FieldLog("dates under another name", changed(_logged_at)),
    FieldLog(
        "pulses without their lower half",
        commands("us", lambda u: 1500 + 5 * u.clip(0)),
        "lacks half of the command",
    ),
    FieldLog(
        "a joystick without its lowering half",
        changed(_half),
        "lacks half of the command",
    ),
    FieldLog("targets in place of commands", changed(_targets), "targets of positions"),
    FieldLog("encoder counts", changed(_counts), "taken for the whole range"),
    FieldLog("encoders called enc", changed(_encoders), "taken for the whole range"),
    FieldLog("encoders that count backwards", changed(_backwards), "counts backwards"),
    FieldLog(
        "a draw wire that counts backwards", wires("wire_V", 10, 0), "counts backwards"
    ),
    FieldLog("draw wires in mA", wires("wire_mA", 4, 20), "taken for the whole stroke"),
    FieldLog("draw wires in V", wires("wire_V", 0, 10), "taken for the whole stroke"),
    FieldLog(
        "draw wires in counts",
        wires("wire_counts", 0, 4095),
        "taken for the whole stroke",
    ),
    FieldLog("potentiometers in V", changed(_pots), "taken for the whole range"),
    FieldLog(
        "a draw wire that is too short",
        wires("wire_mm", 0, 400, clip=0.6),
        "is frozen",
    ),
    FieldLog("an encoder that slips", changed(_jump), "jumps by"),
    FieldLog(
        "a counter of samples for the time",
        changed(lambda c: _renamed(c, 50.0, "sample")),
        "looks like a time",
    ),
    FieldLog("commands that are all 0", changed(_still), "no command is ever given"),
    FieldLog(
        "no command at all",
        changed(lambda c: {n: v for n, v in c.items() if "cmd" not in n}),
        "looks like a command",
    ),
)


@dataclass(frozen=True)
class Outcome:
    """What became of a log: "right", "said" in one line, "refused", or "wrong" in
    silence.

    Where commands were followed also "named": the verdict says that the fit predicts
    badly.
    """

    verdict: str
    line: str = ""


def outcome(log: FieldLog, folder: Path, arm: Arm) -> Outcome:
    """Write a log, give it to `init`, and compare what is read then with the truth."""
    truth, path = make_truth(log.steps, arm), folder / "log.csv"
    path.write_text(log.write(truth, arm))
    try:
        result = hydroid.init(folder / "mine", log=path)
        printed = [str(line) for line in result.lines]
        told = next(
            (line.strip() for line in printed if log.said and log.said in line), ""
        )
        if log.said and not told and not result.result.missing:
            printed = [
                *map(
                    str, hydroid.check(path, config=folder / "mine" / "fit.yaml").lines
                )
            ]
            told = next((line for line in printed if log.said in line), "")
        if told:
            return Outcome("said", told)
        if missing := result.result.missing:
            return Outcome("refused", missing)
        settings = hydroid.load_settings(folder / "mine" / "fit.yaml")
        parts = hydroid.read_logs(path, settings)
    except HydroidError as error:
        return Outcome(
            "said" if log.said and log.said in str(error) else "refused", str(error)
        )
    return Outcome("right" if is_right(parts, truth, log.lost) else "wrong")


def followed(
    log: FieldLog, folder: Path, arm: Arm, budget: str, known: Known | None = None
) -> Outcome:
    """Write two logs, and follow the commands that `init` prints for the first,
    validated on the second.

    Right: it is read rightly, and the fit predicts the second and has the joints'
    speeds. Many logs hold the same once they are read: what is `known` is not fitted
    again.
    """
    read = outcome(log, folder, arm)
    if read.verdict != "right":
        return read
    other = replace(log, steps=tuple(-step for step in log.steps[::-1]))
    (folder / "other.csv").write_text(other.write(make_truth(other.steps, arm), arm))
    words = ["followed", "--log", "log.csv"]
    found = follow(folder, words, "other.csv", budget, known)
    speeds = _speeds(make_truth(log.steps, arm), arm)
    found = judged(found, speeds, max(map(abs, log.steps)))
    return Outcome(found.verdict, found.line)


def _speeds(truth: Truth, arm: Arm) -> dict[str, Speed]:
    """Return the speeds of the joints [deg/s] by commands [%], in the middle of the
    travel that the log shows."""
    speeds = dict[str, Speed]()
    for name, angles in truth.angle.items():
        middle = (angles.min() + angles.max()) / 2
        (farther,) = lever(name, arm, np.array([middle]))

        def speed(u: float, name: str = name, farther: float = farther) -> float:
            return settled(name, u) / farther

        speeds[name] = speed
    return speeds


def is_right(parts: list[Log], truth: Truth, lost: float) -> bool:
    """Return whether logs hold commands and angles of the truth, but for a part of its
    time [s]."""
    read = 0.0
    for part in parts:
        begin = getattr(part, "begin", 0.0)
        last = len(truth.time) - 1
        rows = np.minimum(np.rint((begin + part.time) / PERIOD).astype(int), last)
        # those that a longer period averages
        together = [
            np.minimum(rows + k, last) for k in range(round(part.period / PERIOD))
        ]
        read += part.duration
        for number, name in enumerate(JOINTS):
            wanted = np.mean([truth.command[name][row] for row in together], axis=0)
            size = np.abs(np.abs(part.command[:, number]) - np.abs(wanted))
            off = np.abs(np.degrees(part.angle[:, number]) - truth.angle[name][rows])
            # a command averaged over a lost or doubled row may differ for a sample
            if np.quantile(size, 0.99) > CLOSE_COMMAND or not off.max() <= CLOSE_ANGLE:
                return False
    return read >= truth.time[-1] - lost
