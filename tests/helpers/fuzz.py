"""The kinds of files that hydroid reads, and the command that reads each.

A damaged file is accepted, or refused with one printable line; anything else is a
defect. An accepted log is also read by an independent reader, and must hold the same
numbers.
"""

import contextlib
import csv
import io
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from unicodedata import category

import numpy as np
import trimesh
import typer
import yaml
from arms import MODELS

from hydroid.commands.app import app
from hydroid.errors import HydroidError
from hydroid.log import open_table

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
LOGS = EXAMPLES / "logs"
TRUTH = EXAMPLES / "article" / "truth.yaml"
TINY = (
    "--algorithm=ga",
    "--set=search.ga={population: 4, generations: 1}",
    "--no-refinement",
    "--quiet",
)
NUMBERS = """0 -0 1e308 -1e308 1e999 1e-320 nan inf -inf .nan .inf 1e3 0x1F 010 1_0 1,5 1:30
2024-01-01 1.5.2"""
MARKS = """true false null yes off ~ " ' "" [ ] [[[[ { } # % %s%n {joint} &a *a <<:*a | > ? ; =1+1 sep=;"""
TOKENS = (
    *("", *NUMBERS.split(), *MARKS.split()),
    *(
        "9" * 30,
        "9" * 5000,
        "0x" + "f" * 6000,
        "a" * 5000,
        "٣",
        "é",
        "\u2028",
        "\x1b[31m",
        "\x85",
        "\x00",
    ),
    *("&a [*a]", "- ", ": ", "\t", "\n", "\r", '"\\ud800"', "\ufeff", "\\", "# "),
    *(
        "../../etc/passwd",
        "/",
        "..",
        "~root",
        "file:///etc/passwd",
        "<script>alert(1)</script>",
        "&x;",
    ),
    *(
        "!!python/object/apply:os.mkdir [made]",
        "!!python/name:os.system",
        "!!set {a, b}",
        "!!int x",
    ),
)


def damage(rng: Random, data: bytes) -> bytes:
    """Make one to four edits of the bytes, most of them at a token or a line."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = edit(rng, data)
    return data


def edit(rng: Random, data: bytes) -> bytes:
    at, token = (
        rng.randrange(len(data) + 1),
        rng.choice(TOKENS).encode("utf-8", "surrogatepass"),
    )
    words = [*re.finditer(rb"[A-Za-z0-9_.+-]+", data[:100_000])]
    lines = data.split(b"\n")
    here, there = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.choice(
        ("flip", "cut", "insert", "insert", *["word"] * 6, "repeat", "swap", "drop")
    ):
        case "flip" if data:
            out = bytearray(data)
            for _ in range(rng.choice((1, 1, 8))):
                out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
            return bytes(out)
        case "cut":
            return data[:at] + rng.choice(
                (b"", data[at + rng.choice((1, 2, 9, 100)) :])
            )
        case "word" if words:
            word = rng.choice(words)
            number = re.fullmatch(rb"-?\d{1,12}\.?\d*", word[0])
            if number and rng.random() < 0.7:  # it differs a little
                value = float(word[0]) * rng.choice(
                    (-1, 0.1, 0.5, 1.01, 2, 1e3)
                ) + rng.choice((0, 0, 1))
                token = f"{value:.6g}".encode()
            return data[: word.start()] + token + data[word.end() :]
        case "repeat":
            lines[here] = lines[here] * rng.choice((2, 3, 1000))
        case "swap":
            lines[here], lines[there] = lines[there], lines[here]
        case "drop":
            del lines[here]
        case _:
            return (
                data[:at]
                + rng.choice((token, rng.randbytes(rng.choice((1, 4, 64, 1000)))))
                + data[at:]
            )
    return b"\n".join(lines)


@dataclass(frozen=True)
class Kind:
    """One kind of file.

    seeds: intact files. place: path of the file below a room's folder. command: what
    reads it. check: looks at an accepted one. damaged: makes a damaged one of an intact
    one.
    """

    name: str
    seeds: Callable[[], Sequence[bytes]]
    place: str
    command: Callable[[Path, bytes], Sequence[str]]
    check: Callable[[Path, bytes], None] | None = None
    damaged: Callable[[Random, bytes], bytes] = damage

    def read_damaged(self, room: Path, seed: int) -> bool:
        """Damage a file as the seed says, and read it; what is raised names kind and
        seed."""
        rng = Random(f"{self.name} {seed}")
        try:
            return self.read(room, self.damaged(rng, rng.choice(self.seeds())))
        except Exception as error:
            error.add_note(f"the damaged {self.name} of seed {seed}")
            raise

    def read(self, room: Path, data: bytes) -> bool:
        """Return whether a file is accepted; False where it is refused in one line. All
        else raises."""
        path = room / self.place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        refusal = run(self.command(room, data))
        if refusal is None and self.check is not None:
            self.check(path, data)
        return refusal is None


def run(arguments: Sequence[str]) -> str | None:
    """Run a command in this process; return why it refused its input, or None.

    Raises:
        AssertionError: the refusal is not one printable line.
    """
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = app(list(arguments), standalone_mode=False)
        except HydroidError as refusal:
            text = str(refusal)
            assert text.isprintable(), ascii(text)
            assert 0 < len(text) < 2000, text
            return text
        except typer.Exit as end:
            code = end.exit_code
    for line in (out.getvalue() + err.getvalue()).splitlines():
        # other spaces than ours are not printable to Python, and do nothing
        acting = {category(c) for c in line if c != "\t"} & {"Cc", "Cf", "Cs"}
        assert not acting, ascii(line)
    return out.getvalue() if code else None


@cache
def logs() -> tuple[bytes, ...]:
    """Short logs in the dialects that are recognised."""
    plain, turning = (
        b"\n".join((LOGS / name).read_bytes().splitlines()[:82]) + b"\n"
        for name in ("rig_shoulder_1.csv", "rig_all_joints_1.csv")
    )
    text = turning.decode()
    rows = [line.split(",") for line in text.splitlines()]
    quoted = "\r\n".join(",".join(f'"{cell}"' for cell in row) for row in rows)
    comma = "sep=;\n" + text.replace(",", ";").replace(".", ",")
    noted = "# a rig\n\n" + "\n".join(line + ",note" for line in text.splitlines())
    slow = "\n".join(",".join(row) for row in [rows[0], *rows[1::3]])
    return (
        plain,
        turning,
        *(t.encode() for t in (quoted, comma, noted, slow)),
        text.encode("utf-16"),
    )


def check_log(path: Path, data: bytes) -> None:
    """Compare the numbers that hydroid reads from a log with those of an independent
    reader.

    Rows without any number do not count: below the names they may be text that is left
    out.
    """
    table, (names, cells) = open_table(path), _cells(data)
    read = np.array([[float(cell) for cell in table.columns[name]] for name in names]).T
    rows, others = (one[~np.isnan(one).all(axis=1)] for one in (read, cells))
    np.testing.assert_array_equal(rows, others)


def _cells(data: bytes) -> tuple[list[str], np.ndarray]:
    wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    even, odd = data[:200:2].count(0), data[1:200:2].count(0)
    encoding = "utf-16-be" if even > 90 else "utf-16-le" if odd > 90 else ""
    try:
        text = data.decode("utf-16" if wide else encoding or "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    lines = [
        x
        for x in lines
        if x.strip(" \t,;|") and not x.strip(" \t,;").startswith(("#", "sep="))
    ]
    # below a preamble
    lines = lines[next((i for i, x in enumerate(lines) if "time_s" in x), 0) :]
    for separator in ",;\t|":
        names = [
            name.strip() for name in next(csv.reader([lines[0]], delimiter=separator))
        ]
        if "time_s" in names:
            rows = [next(csv.reader([line], delimiter=separator)) for line in lines[1:]]
            decimal = "." if separator == "," else ","
            wanted = [
                i
                for i, n in enumerate(names)
                if n == "time_s" or n.endswith(("_pct", "_deg"))
            ]
            cells = [
                [_number(row, i, len(names), decimal) for i in wanted] for row in rows
            ]
            return [names[i] for i in wanted], np.array(cells)
    raise AssertionError("no separator gives a column time_s")


def _number(row: Sequence[str], column: int, width: int, decimal: str) -> float:
    """Return the number in a cell; NaN where there is none, or the row has fewer or
    more cells than names."""
    if (
        len(row) < width
        or any(cell.strip() for cell in row[width:])
        or "_" in row[column]
    ):
        return np.nan
    try:
        return float(row[column].replace(decimal, "."))
    except ValueError:
        return np.nan


@cache
def configs() -> tuple[bytes, ...]:
    shipped = [
        (ROOT / "configs" / f"{name}.yaml").read_bytes()
        for name in ("fit-mech", "fit-hyd")
    ]
    return (*shipped, (MODELS / "settings.yaml").read_bytes())


def overrides() -> tuple[bytes, ...]:
    keys = (
        "search.seed",
        "outputs",
        "parameters.K.bounds",
        "log.joints.4.command",
        "objective.segments",
    )
    values = [*TOKENS, "3", "[2,3]", "{times: [1,2]}"]
    return tuple(
        f"{key}={value}".encode("utf-8", "surrogatepass")
        for key in keys
        for value in values
    )


@cache
def rod() -> bytes:
    content = trimesh.creation.box((0.5, 0.06, 0.04)).export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def two(kind: str) -> bytes:
    return (MODELS / f"two.{kind}").read_bytes()


def start(room: Path, data: bytes) -> Sequence[str]:
    for name, content in {
        "rod.stl": rod(),
        "arm.yaml": two("yaml"),
        "arm.xml": two("xml"),
    }.items():
        if not (room / "arm" / name).exists():
            (room / "arm" / name).write_bytes(content)
    shutil.rmtree(room / "mine", ignore_errors=True)
    return ("init", str(room / "mine"), "--arm", str(room / "arm" / "arm.yaml"))


def robot(name: str, log: Path) -> Callable[[Path, bytes], Sequence[str]]:
    """Return what makes a project of a robot's file and a log."""

    def arguments(room: Path, _: bytes) -> Sequence[str]:
        mine = str(room / "mine")
        return ("init", mine, "--arm", str(room / name), "--log", str(log), "--force")

    return arguments


def urdf() -> tuple[bytes, ...]:
    text = (EXAMPLES / "urdf/robot.urdf").read_text()
    return (text.replace("meshes/", f"{EXAMPLES / 'urdf/meshes'}/").encode(),)


def models() -> tuple[bytes, ...]:
    text = (ROOT / "models" / "hydrolek.xml").read_text()
    return (
        text.replace('meshdir="../meshes"', f'meshdir="{ROOT / "meshes"}"').encode(),
    )


def simulate(room: Path, data: bytes) -> Sequence[str]:
    (room / "log.csv").write_bytes(logs()[0])
    values = room / "values.yaml"
    given = values if values.exists() else TRUTH
    arm = yaml.safe_load((ROOT / "configs" / "hydrolek.yaml").read_text())
    model = (
        room / "model.xml"
        if (room / "model.xml").exists()
        else ROOT / "models" / "hydrolek.xml"
    )
    arm |= {"model": str(model), "pair": None}
    (room / "arm.yaml").write_text(yaml.safe_dump(arm))
    own = f"--set=arm={room / 'arm.yaml'}"
    out = f"--out={room / 'out.csv'}"
    return ("simulate", str(room / "log.csv"), f"--fit={given}", out, own, "--quiet")


@cache
def finished(folder: Path) -> Path:
    log = folder / "log.csv"
    log.write_bytes(logs()[0])
    assert run(("fit-mech", str(log), "--out", str(folder / "run"), *TINY)) is None
    return folder / "run"


def run_kinds(folder: Path) -> Iterator[Kind]:
    """Yield the kinds that need a finished run, which is made in `folder`: its own
    files."""

    def copied(room: Path) -> Path:
        shutil.copytree(finished(folder), room / "run", dirs_exist_ok=True)
        return room / "run"

    def command(name: str) -> Callable[[Path, bytes], Sequence[str]]:
        def arguments(room: Path, data: bytes) -> Sequence[str]:
            (copied(room) / name).write_bytes(data)
            if name == "checkpoint.npz":
                log = str(folder / "log.csv")
                return (
                    "fit-mech",
                    log,
                    "--resume",
                    "--out",
                    str(room / "run"),
                    "--quiet",
                    *TINY,
                )
            log, out = str(folder / "log.csv"), f"--out={room / 'v'}"
            return ("validate", log, f"--fit={room / 'run'}", "--json", out)

        return arguments

    for name in (
        "run.json",
        "config.yaml",
        "arm.yaml",
        "estimate.yaml",
        "checkpoint.npz",
    ):
        seeds = cache(lambda name=name: ((finished(folder) / name).read_bytes(),))
        yield Kind(name, seeds, f"run/{name}", command(name))


def renamed(rng: Random, data: bytes) -> bytes:
    """Damage the names of a log's columns; one time in four anything."""
    names, end, rows = data.partition(b"\n")
    if rng.random() < 0.25:
        return damage(rng, data)
    return damage(rng, names) + end + rows


def guess(room: Path, _: bytes) -> Sequence[str]:
    return ("convert", str(room / "log.csv"), "--out", str(room / "out.csv"))


def check(room: Path, *how: str) -> Sequence[str]:
    (room / "log.csv").write_bytes(logs()[0])
    return ("check", str(room / "log.csv"), *how)


KINDS = {
    kind.name: kind
    for kind in (
        Kind(
            "log",
            logs,
            "log.csv",
            lambda room, _: ("check", str(room / "log.csv")),
            check_log,
        ),
        Kind("names", logs, "log.csv", guess, damaged=renamed),
        Kind(
            "config",
            configs,
            "c.yaml",
            lambda room, _: check(room, "--config", str(room / "c.yaml")),
        ),
        Kind(
            "set",
            overrides,
            "set",
            lambda room, data: check(room, "--set", data.decode(errors="replace")),
        ),
        Kind("arm", lambda: (two("yaml"),), "arm/arm.yaml", start),
        Kind("mesh", lambda: (rod(),), "arm/rod.stl", start),
        Kind("values", lambda: (TRUTH.read_bytes(),), "values.yaml", simulate),
        Kind("model", models, "model.xml", simulate),
        Kind(
            "urdf", urdf, "robot.urdf", robot("robot.urdf", EXAMPLES / "urdf/log_1.csv")
        ),
        Kind(
            "mjcf",
            lambda: ((EXAMPLES / "boom/boom.xml").read_bytes(),),
            "boom.xml",
            robot("boom.xml", EXAMPLES / "boom/fit_up_40.csv"),
        ),
    )
}
