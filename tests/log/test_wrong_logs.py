"""What `hydroid check` says of logs that are wrong in many ways; docs/logs.md shows the
same."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_files import RIG

import hydroid
from hydroid.log import LogFinding

ROOT = Path(__file__).parents[2]
Table = dict[str, np.ndarray]


@dataclass(frozen=True)
class Wrong:
    """One way in which logs are wrong.

    how: in words, for the table. said: level and words of the finding that must be
    there. make: the logs. settings: of `log`. config: that of the arm.
    """

    how: str
    said: str
    make: Callable[[], list[Table]]
    settings: Mapping[str, Any] = field(default_factory=dict)
    config: str | Path = "fit-mech"

    def line(self, folder: Path) -> str:
        """Return the line of the finding that `hydroid check` says of the logs."""
        level, words = self.said.split(": ", 1)
        overrides = {f"log.{key}": value for key, value in self.settings.items()}
        lines = hydroid.check(
            save(self, folder), config=self.config, set=overrides
        ).lines
        return next(x for x in lines if x.startswith(level) and words in x).replace(
            f"{folder}/", ""
        )


def rig(name: str = "rig_all_joints_1", rows: int = 4000) -> Table:
    """A log of the virtual rig, by column, after one second of rest."""
    table = load(RIG / f"{name}.csv")
    values = np.stack([*table.values()], axis=1)[:rows]
    rest = np.repeat(values[:1], 100, axis=0)
    rest[:, 1:8] = 0.0
    values = np.vstack([rest, values])
    values[:, 0] = 0.01 * np.arange(len(values))
    return dict(zip(table, values.T, strict=True))


def load(path: Path) -> Table:
    header = path.read_text().partition("\n")[0].split(",")
    return dict(zip(header, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))


def dig() -> Table:
    """A log of a real excavator, whose boom goes to negative angles by a positive
    command."""
    return load(EXCAVATOR / "fit_01.csv")


def of(
    prefix: str, change: Callable[[np.ndarray], np.ndarray], table: Table | None = None
) -> list[Table]:
    table = rig() if table is None else table
    return [
        {
            name: change(values) if name.startswith(prefix) else values
            for name, values in table.items()
        }
    ]


def leaking() -> list[Table]:
    """A log at whose end nothing is driven for 30 s, while the shoulder sinks by 0.1
    deg/s."""
    table = rig()
    steps = np.arange(1, 3001)
    for name, values in table.items():
        rest = np.full(len(steps), values[-1])
        if name == "time_s":
            rest = values[-1] + 0.01 * steps
        elif name.endswith("_pct"):
            rest = np.zeros(len(steps))
        elif name == "q2_deg":
            rest = values[-1] - 0.001 * steps
        table[name] = np.append(values, rest)
    return [table]


def boom(duties: list[float], *, stop: float = 60.0, seconds: float = 4.0) -> Table:
    """A boom of ours that rests, is driven by each duty [%], and rests; its pump comes
    up after 1.5 s."""
    period, noise = 0.01, np.random.default_rng(4)
    blocks = [np.zeros(100)] + [
        np.r_[np.full(int(seconds * 100), duty), np.zeros(100)] for duty in duties
    ]
    command = np.concatenate(blocks)
    angle, speed, since, angles = 20.0, 0.0, 0.0, []
    for u in command:
        since = since + period if u else 0.0
        wanted = 0.3 * np.sign(u) * max(abs(u) - 20, 0) * (1.0 if since > 1.5 else 0.6)
        speed += (wanted - speed) * period / 0.1
        angle += speed * period
        if not -10 < angle < stop:
            angle, speed = float(np.clip(angle, -10, stop)), 0.0
        angles.append(angle)
    table = rig(rows=len(command) - 100)
    still = {
        n: np.full(len(command), v[0]) * (n[0] != "u")
        for n, v in table.items()
        if n != "time_s"
    }
    moving = np.array(angles) + 0.02 * noise.normal(size=len(command))
    return {
        "time_s": period * np.arange(len(command)),
        **still,
        "u2_pct": command,
        "q2_deg": moving,
    }


def without(*rows: int) -> list[Table]:
    return of("", lambda values: np.delete(values, rows))


def exchanged() -> list[Table]:
    return [(table := rig("rig_shoulder_1")) | {"q2_deg": table["q1_deg"]}]


def renamed(old: str, new: str) -> list[Table]:
    return [{name.replace(old, new): values for name, values in rig().items()}]


def early(seconds: float) -> list[Table]:
    samples = round(100 * seconds)
    return of(
        "q", lambda q: np.r_[q[samples:], np.full(samples, q[-1])], boom([60, -60])
    )


def targets() -> list[Table]:
    """What the angle reaches 0.2 s later, as a controller holds it."""
    table = boom([60, -60, 80])
    return [
        table
        | {"u2_pct": np.r_[table["q2_deg"][20:], np.full(20, table["q2_deg"][-1])]}
    ]


def holed(angle: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(angle)) == 700, np.nan, angle)


def spiked(angle: np.ndarray) -> np.ndarray:
    return angle + 25 * (np.arange(len(angle)) == 700)


def dropped(angle: np.ndarray) -> np.ndarray:
    at = np.arange(len(angle))
    return np.where((at >= 700) & (at < 750), 0.0, angle)


def shifted(angle: np.ndarray) -> np.ndarray:
    return angle + 4 * (np.arange(len(angle)) >= 700)


def renumbered() -> list[Table]:
    """Three seconds are cut out, and the time counts on."""
    (table,) = without(*range(900, 1200))
    return [table | {"time_s": 0.01 * np.arange(len(table["time_s"]))}]


def frozen(angle: np.ndarray) -> np.ndarray:
    """From sample 253 on."""
    return np.where(np.arange(len(angle)) < 253, angle, angle[253])


def coarse(angle: np.ndarray) -> np.ndarray:
    return 2 * np.round(angle / 2)


EXCAVATOR = ROOT / "examples" / "excavator"
EXCAVATED = EXCAVATOR / "fit.yaml"
ROWS = np.insert(np.arange(4100), 900, 900)
JITTER = 0.004 * np.sin(np.arange(4100))


WRONG = (
    Wrong(
        "commands from −1 to 1",
        "warning: set log.command.scale: 100",
        lambda: of("u", lambda u: u / 100),
    ),
    Wrong(
        "commands in ±10 V",
        "warning: set log.command.scale: 10",
        lambda: of("u", lambda u: u / 10),
    ),
    Wrong(
        "one command of several in ±10 V",
        "warning: unlike the others",
        lambda: of("u2", lambda u: u / 10),
    ),
    Wrong(
        "commands in ±1000",
        "error: set log.command.scale: 0.1",
        lambda: of("u", lambda u: u * 10),
    ),
    Wrong(
        "commands in 4 to 20 mA",
        "warning: offset: -150",
        lambda: of("u2", lambda u: 12 + 0.08 * u),
    ),
    Wrong(
        "a joystick of 0 to 5 V",
        "warning: offset: -100",
        lambda: of("u2", lambda u: 2.5 + 0.025 * u),
    ),
    Wrong(
        "angles in rad, read as deg",
        "warning: set log.angle.unit: rad",
        lambda: of("q", np.deg2rad),
    ),
    Wrong(
        "angles in deg, read as rad",
        "error: unit: deg",
        lambda: [rig()],
        {"angle": {"unit": "rad"}},
    ),
    Wrong(
        "a unit in a name that the settings contradict",
        "warning: the file says",
        lambda: renamed("q2_deg", "q2 [rad]"),
        {"joints": {2: {"angle": {"column": "q2 [rad]"}}}},
    ),
    Wrong(
        "time in ms, read as s",
        "error: set log.time.unit: ms",
        lambda: of("time", lambda t: 1000 * t),
    ),
    Wrong(
        "a clock in days, read as s",
        "error: unit: day",
        lambda: of("time", lambda t: t / 86400),
    ),
    Wrong(
        "an angle that counts the other way",
        "error: angle.scale: -1",
        lambda: of("q3", np.negative),
    ),
    Wrong(
        "a command wired the other way",
        "warning: moves against",
        lambda: of("u2", np.negative),
    ),
    Wrong(
        "a command wired the other way, at a joint whose cylinder turns it to negative angles",
        "warning: at positive commands",
        lambda: of("u1", np.negative, dig()),
        config=EXCAVATED,
    ),
    Wrong(
        "clocks that differ by 0.3 s",
        "warning: which no machine can do",
        lambda: early(0.3),
    ),
    Wrong(
        "commands that are all 0",
        "warning: no joint is driven",
        lambda: of("u", np.zeros_like),
    ),
    Wrong(
        "a joystick whose lowering half is missing",
        "warning: lacks half of the command",
        lambda: of("u2", lambda u: u.clip(0), boom([60, -60])),
    ),
    Wrong("position targets in place of commands", "warning: as a target", targets),
    Wrong(
        "a clock that jitters",
        "note: is resampled",
        lambda: of("time", lambda t: t + JITTER),
    ),
    Wrong(
        "0.4 s without a sample",
        "warning: parts read: 2",
        lambda: without(*range(900, 940)),
    ),
    Wrong("a dropped sample", "warning: samples lost: 1", lambda: without(900)),
    Wrong(
        "a sample that is in the log twice",
        "warning: does not increase",
        lambda: of("", lambda v: v[ROWS]),
    ),
    Wrong("a cell that holds no number", "warning: left out", lambda: of("q2", holed)),
    Wrong(
        "a dead sensor",
        "warning: never changes",
        lambda: of("q2", lambda q: np.full_like(q, q[0])),
    ),
    Wrong(
        "a sensor that freezes",
        "warning: is frozen",
        lambda: of("q1", frozen, dig()),
        config=EXCAVATED,
    ),
    Wrong("a spike of 25 deg", "warning: jumps by 25", lambda: of("q2", spiked)),
    Wrong("half a second of zeros", "warning: jumps by", lambda: of("q2", dropped)),
    Wrong("a zero point that moves", "warning: jumps by", lambda: of("q2", shifted)),
    Wrong(
        "some seconds missing, and the time goes on without a gap",
        "warning: jumps by",
        renumbered,
    ),
    Wrong(
        "a sensor with steps of 2 deg",
        "note: in steps of 2 deg",
        lambda: of("q2", coarse),
    ),
    Wrong(
        "the angle of another joint",
        "warning: strong commands hardly move joint shoulder",
        exchanged,
    ),
    Wrong(
        "an encoder that wraps",
        "note: wraps by 360",
        lambda: of("q6", lambda q: (q + 280) % 360 - 180),
    ),
    Wrong(
        "an encoder of 0 to 360 deg on a joint that cannot turn all the way round",
        "note: wraps by 360",
        lambda: of("q5", lambda q: q % 360),
    ),
    Wrong(
        "a log of 50 Hz, read at 100 Hz",
        "note: commands follow a line between samples",
        lambda: of("", lambda values: values[::2]),
    ),
    Wrong(
        "a misspelt column",
        "error: did you mean 'U2_pct'?",
        lambda: renamed("u2", "U2"),
    ),
    Wrong(
        "a joint that is pushed against its stop",
        "note: upper end",
        lambda: [boom([100, 60, -60])],
    ),
    Wrong(
        "an arm that leaks",
        "note: moves slowly",
        leaking,
    ),
    Wrong(
        "a joint that stalls",
        "note: stalls",
        lambda: [boom([60], stop=30.0), boom([100])],
    ),
    Wrong(
        "no rest before the first command",
        "note: begins with",
        lambda: of("", lambda v: v[100:]),
    ),
)


def save(wrong: Wrong, folder: Path) -> list[Path]:
    paths: list[Path] = []
    for k, table in enumerate(wrong.make(), 1):
        paths.append(folder / f"log{k}.csv")
        values = np.stack([*table.values()], axis=1)
        np.savetxt(paths[-1], values, "%.8g", ",", header=",".join(table), comments="")
    return paths


SETTINGS = hydroid.load_settings("fit-mech")


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong.how)
def test_it_is_said_and_the_page_shows_it(wrong: Wrong, tmp_path: Path) -> None:
    line = wrong.line(tmp_path)
    page = (ROOT / "docs" / "logs.md").read_text()
    assert f"| {wrong.how} | {line} |\n" in page


def findings(folder: Path, table: Table) -> list[LogFinding]:
    (checked,) = hydroid.check(
        save(Wrong("", "", lambda: [table]), folder), config=SETTINGS
    ).result
    return [*checked.findings]


def test_a_good_log_has_no_finding(tmp_path: Path) -> None:
    assert findings(tmp_path, rig(rows=7500)) == []


@pytest.mark.parametrize(
    "duties", [[60, -60, 100, -100], [100, 100, -80, -80], [90], [-90, -90]]
)
@pytest.mark.parametrize("stop", [22.0, 30.0, 60.0])
def test_a_stop_is_no_other_sign(
    duties: list[float], stop: float, tmp_path: Path
) -> None:
    kinds = {
        finding.kind
        for finding in findings(tmp_path, boom(duties, stop=stop, seconds=8))
    }
    assert kinds & {"at a stop", "stall", "turned", "late"} == {"at a stop"}


def test_a_stop_at_the_end_of_the_range_says_nothing_against_the_range(
    tmp_path: Path,
) -> None:
    _, end = np.degrees(SETTINGS.arm.joint(2).limits)
    table = boom([60, -60, 100, -100], stop=float(end), seconds=8)
    (found,) = [
        one
        for one in findings(tmp_path, table)
        if one.subjects == ("shoulder", "upper")
    ]
    assert found.kind == "at the end of its range"
    assert "should end there" not in str(found)


def test_how_far_each_joint_moves(tmp_path: Path) -> None:
    (log,) = hydroid.check(
        save(Wrong("", "", lambda: [boom([50])]), tmp_path), config=SETTINGS
    ).result
    assert log.moved_deg == {
        "shoulder": pytest.approx(np.rad2deg(np.ptp(log.log.angle[:, 1])), abs=0.2)
    }


def test_small_motions_about_zero_are_not_taken_for_radians(tmp_path: Path) -> None:
    """A quick shake by strong commands stays within 3 deg, and yet moves far more than
    radians would."""
    time = np.arange(3000) * 0.01
    table = {name: np.zeros(3000) for name in rig()} | {"time_s": time}
    table["u2_pct"] = 60 * np.sign(np.sin(2 * np.pi * 0.25 * time + 0.1))
    table["q2_deg"] = 2.5 * np.cos(2 * np.pi * 0.25 * time)
    assert not [
        f for f in findings(tmp_path, table) if f.level == "warning" and "rad" in f.hint
    ]
