"""The kinds of files that hydroid reads: intact ones to start from, how to damage one, and how it is read.

`Kind.read` raises a HydroidError where the file is refused and `Wrong` where it is misread; anything else
that escapes is a defect. All that it writes lies below its room.
"""

import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

import numpy as np
import trimesh
import yaml
from fuzz_inputs import TOKENS, VALUES, change_tree, change_xml, damage
from fuzz_oracles import Wrong, check_log_reading, check_mesh, check_settings, expect, same

from hydroid.arm.mesh import mass_properties
from hydroid.arm.model import load_model, write_model
from hydroid.assets import assets, find_config
from hydroid.cli.options import overrides
from hydroid.cli.running import _continued
from hydroid.fitting.search import Search, make_algorithm
from hydroid.jobs import check_logs, load_settings, mechanical_values, read_logs, read_parameters
from hydroid.problem.problem import Memo, Problem
from hydroid.problem.stage import Stage
from hydroid.report.html import Section, report_html
from hydroid.report.table import Table
from hydroid.run.folder import RunFolder
from hydroid.search.algorithm import Population
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.fit import FitSettings
from hydroid.simulating import read_commands

ROOT = Path(__file__).parents[2]
LOGS = ROOT / "examples" / "logs"
DEEP = 4  # every so many-th accepted file is also used, not only read


@dataclass(frozen=True)
class Kind:
    """A kind of file: intact ones, how to damage one, how it is read (room, content, whether to use it)."""

    name: str
    seeds: Callable[[], list[bytes]]
    damage: Callable[[Random, bytes, list[bytes]], bytes]
    read: Callable[[Path, bytes, bool], None]

    def make(self, seed: int) -> bytes:
        """The damaged file of a seed."""
        rng = Random(f"{self.name} {seed}")
        seeds = self.seeds()
        return self.damage(rng, rng.choice(seeds), seeds)

    def try_one(self, seed: int, room: Path) -> None:
        self.read(room, self.make(seed), seed % DEEP == 0)


def silent(finding: object) -> None:
    text = str(finding)
    expect(text.isprintable(), f"a finding is not one printable line: {text!r}")


def put(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


@cache
def basis() -> tuple[FitSettings, Arm]:
    settings = load_settings("fit-mech")
    return settings, settings.arm


def quick() -> tuple[FitSettings, Arm]:
    """A fit small enough to be run."""
    small = {"population": 4, "generations": 2}
    changes = {"search.ga": small, "search.nsga2": small, "objective.segments.equal": 2, "refinement": None}
    settings = load_settings("fit-mech", changes | {"search.algorithm": "nsga2", "simulation.threads": 1})
    return settings, settings.arm


# logs


@cache
def log_seeds() -> list[bytes]:
    plain, turning = (
        b"\n".join((LOGS / name).read_bytes().splitlines()[:82]) + b"\n"
        for name in ("rig_shoulder_1.csv", "rig_all_joints_1.csv")
    )
    text = turning.decode()
    rows = [line.split(",") for line in text.splitlines()]
    quoted = "\r\n".join(",".join(f'"{cell}"' for cell in row) for row in rows)
    german = "sep=;\n" + text.replace(",", ";").replace(".", ",")
    noted = "# a rig\n\n" + "\n".join(line + ",note" for line in text.splitlines())
    wrapped = [
        rows[0],
        *([*r[:13], f"{(175 + 0.2 * k + 180) % 360 - 180:.3f}", r[14]] for k, r in enumerate(rows[1:])),
    ]
    slow = "\n".join(",".join(row) for row in [rows[0], *rows[1::3]])
    spun = "\n".join(",".join(row) for row in wrapped)
    return [plain, turning, *(t.encode() for t in (quoted, german, noted, slow, spun)), text.encode("utf-16")]


def read_a_log(room: Path, data: bytes, deep: bool) -> None:
    settings, arm = basis()
    path = put(room / "log.csv", data)
    for _, log, findings in check_logs([path], settings):
        for finding in findings:
            silent(finding)
        expect((log is None) == any(f.level == "error" for f in findings), "errors and the log disagree")
        if log is not None:
            check_log_reading(data, log, log.joints)
    if deep:
        for _, log, findings in check_logs([path], settings, repair=True):
            for finding in findings:
                silent(finding)
            expect(log is None or np.isfinite(log.angle).all(), "a repaired log is not finite")
        read_commands(path, settings, "home", silent)
    read_logs([path], settings, silent)


# settings


@cache
def config_seeds() -> list[bytes]:
    small = {
        "parameters": {
            "K": {"quantity": "gain", "bounds": [0.1, 1]},
            "D": {"quantity": "damping", "fixed": 200},
        }
    }
    shown = small | {
        "log": {"joints": {4: {"command": {"scale": 0.5}}, 7: None}, "delay_s": 0.1},
        "priors": {
            "gain": {"of": {"K": 1}, "value": 0.4, "sd": 0.1},
            "r": {"ratio": ["K", "D"], "value": 0.002},
        },
        "payloads": {"log.csv": 2.0},
        "objective": {
            "norm": 2,
            "weights": {2: 3.0},
            "noise_deg": {2: 0.1},
            "segments": {"times": [0.2, 0.5]},
        },
        "simulation": {"other_joints": "passive", "threads": 1},
        "search": {"algorithm": "ga", "seed": 7},
        "refinement": None,
    }
    shipped = [find_config(name).read_bytes() for name in ("fit-mech", "fit-hyd", "article-mech")]
    return [*shipped, *(yaml.safe_dump(c, sort_keys=False).encode() for c in (small, shown))]


@cache
def default_settings(text: bytes) -> dict[str, Any]:
    """Defaults of all that a file of settings may leave out."""
    one = {"K": {"quantity": "gain", "bounds": [0.1, 1]}}
    whole = FitSettings.model_validate({"parameters": one}).model_dump(mode="json")
    whole["parameters"] = {}
    return whole


def damaged_yaml(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    if rng.random() < 0.5:
        return damage(rng, data, others)
    tree = change_tree(rng, yaml.safe_load(data))
    try:
        return yaml.safe_dump(tree, sort_keys=False, allow_unicode=rng.random() < 0.5).encode(
            "utf-8", "surrogatepass"
        )
    except (yaml.YAMLError, TypeError, ValueError):  # a key that YAML cannot write
        return damage(rng, data, others)


def read_a_config(room: Path, data: bytes, deep: bool) -> None:
    settings = load_settings(put(room / "config.yaml", data))
    text = data.decode("utf-8-sig")
    check_settings(text, settings.model_dump(mode="json"), default_settings(b""))
    path = put(room / "log.csv", log_seeds()[1])
    stage = Stage(settings)
    if deep:
        problem = Problem(settings, read_logs([path], settings, settings.arm, silent))
        unit = np.random.default_rng(1).random((2, int(stage.parameters.free.sum())))
        if settings.search.algorithm in ("ga", "nsga2"):
            algorithm, rng = make_algorithm(problem, settings.search), np.random.default_rng(1)
            genes = algorithm.start(rng)
            scores = rng.random((len(genes), 1 if algorithm.single else 2))
            algorithm.ask(algorithm.tell(None, Population(genes, scores)), rng)
        result = problem.evaluate(problem.theta(unit))
        expect(not np.isnan(result.overall).any(), "an objective is not a number")
        run = room / "run"
        shutil.rmtree(run, ignore_errors=True)
        RunFolder(run).begin(settings, [path])
        again, _ = RunFolder(run).settings()
        expect(again.model_copy(update={"arm": settings.arm}) == settings, "the run folder's settings differ")


def damaged_override(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    key, _, value = data.decode().partition("=")
    value = rng.choice((value, rng.choice(TOKENS), json.dumps(rng.choice(VALUES), default=str)))
    text = (
        rng.choice((key, key, key, key + rng.choice((".", ".x", "..", ".2", "=")), rng.choice(TOKENS)))
        + "="
        + value
    )
    return text.encode("utf-8", "surrogatepass")


def override_seeds() -> list[bytes]:
    texts = (
        "search.seed=3 outputs=[2,3] parameters.K.bounds=[0.1,1] log.joints.4.command=null refinement=null "
        "arm=hydrolek simulation.threads=1 parameters.M3.fixed=22.5 objective.segments={times:[1,2]} "
        "log.delay_s=0.2 refine=true start_pose=rig"
    )
    return [text.encode() for text in texts.split()]


def read_an_override(room: Path, data: bytes, deep: bool) -> None:
    text = data.decode("utf-8", "surrogatepass")
    changes = overrides([text])
    settings = load_settings("fit-mech", changes)
    (key,) = changes
    taken: Any = settings.model_dump(mode="json")
    for name in key.split("."):
        taken = taken[name]
    given = yaml.load(text.partition("=")[2], Loader=yaml.BaseLoader)
    if not isinstance(given, list | dict) and not isinstance(taken, list | dict):
        expect(same("" if given is None else given, taken), f"{text!r} was read as {taken!r}")


# arms


@cache
def boxes() -> dict[str, bytes]:
    base, long = trimesh.creation.box((0.2, 0.2, 0.1)), trimesh.creation.box((0.5, 0.06, 0.04))
    long.apply_translation((0.25, 0, 0))
    return {"base.stl": base.export(file_type="stl"), "rod.stl": long.export(file_type="stl")}


@cache
def arm_seeds() -> list[bytes]:
    linear = {
        "kind": "linear",
        "a": 0.25,
        "b": 0.065,
        "theta0": 90,
        "stroke": 100,
        "area_a": 800,
        "area_b": 600,
    }
    linear |= {"max_opening": 0.35, "towards": [-1, 0, 0]}
    joint = {"axis": [0, -1, 0], "at": [0, 0, 0.1], "range": [-50, 50]}
    small = {
        "name": "two",
        "model": "two.xml",
        "meshes": ".",
        "base": {"mesh": "base.stl", "at": [0, 0, 0.5]},
        "links": [
            {"name": n, "mesh": "rod.stl", "mass": 2.0, "parameter": p}
            for n, p in (("upper", "M1"), ("fore", "M2"))
        ],
        "fixed": [{"name": "tool", "mesh": "rod.stl", "mass": 1.0, "carried_by": "fore", "at": [0.5, 0, 0]}],
        "joints": [
            {"name": "shoulder", **joint, "actuator": linear},
            {
                "name": "elbow",
                **joint,
                "actuator": {"kind": "rotary", "displacement": 10, "max_opening": 0.2},
            },
        ],
        "payload": {"carried_by": "fore", "at": [0.5, 0, 0]},
        "poses": {"home": [0, 0], "up": [30, -20]},
    }
    shipped = find_config("hydrolek").read_bytes().replace(b"../meshes", bytes(assets() / "meshes"))
    return [shipped, *[yaml.safe_dump(small, sort_keys=False).encode()] * 3]


def read_an_arm(room: Path, data: bytes, deep: bool) -> None:
    path = put(room / "arm" / "arm.yaml", data)
    for name, mesh in boxes().items():
        put(path.parent / name, mesh)
    arm = load_arm(path)
    dump = arm.model_dump(mode="json")
    text = data.decode("utf-8-sig")
    dump |= {k: v for k, v in yaml.load(text, Loader=yaml.BaseLoader).items() if k in ("model", "meshes")}
    check_settings(text, dump, {"fixed": [], "payload": None})
    expect(np.isfinite(arm.masses).all() and (arm.masses > 0).all(), "a mass is not positive")
    if deep:
        model = room / "built" / "arm.xml"  # never where the damaged file would have it
        write_model(arm, model)
        compiled = load_model(model, arm).compile()
        expect(np.isfinite(compiled.body_inertia).all(), "an inertia is not finite")
        total = compiled.body_mass[1:].sum()
        expect(np.isclose(total, arm.masses.sum(), rtol=1e-9), f"the model weighs {total} kg")


# parameters


@cache
def value_seeds() -> list[bytes]:
    truth = (ROOT / "examples" / "article" / "truth.yaml").read_bytes()
    plain = {"K": 0.4, "D": 200.0, "S": 10, **{f"M{i}": 2.0 * i for i in range(1, 7)}}
    nested = {"stage": "mech", "parameters": plain, "units": {"K": "N·m/%"}}
    return [truth, *(yaml.safe_dump(c, allow_unicode=True).encode() for c in (plain, nested))]


def read_values(room: Path, data: bytes, deep: bool) -> None:
    settings, arm = basis()
    path = put(room / "values.yaml", data)
    stage = Stage(settings)
    values = read_parameters(path)
    if deep:
        mechanical_values(path, settings)
    theta = stage.parameters.vector(values, str(path))
    expect((theta >= 0).all(), "a negative parameter was accepted")
    given = yaml.load(data.decode("utf-8-sig"), Loader=yaml.BaseLoader)
    given = given.get("parameters", given)
    for name, value in zip(stage.parameters.names, theta, strict=True):
        expect(same(given[name], float(value)), f"{name}: {given[name]!r} was read as {value!r}")


# run folders


@cache
def begun(room: Path) -> Path:
    """A run folder with an estimate and a checkpoint, made once a room."""
    settings, arm = quick()
    log = put(room / "kept" / "log.csv", log_seeds()[1])
    run = room / "kept" / "run"
    folder = RunFolder(run)
    folder.begin(settings, [log])
    problem = Problem(settings, read_logs([log], settings, silent))
    memo = Memo(problem)
    Search(problem, settings.search, memo).run(None, folder.save, lambda row: None)
    values = {"stage": "mech", "final": "best", "parameters": problem.parameters.mapping(memo.best)}
    folder.write("estimate.yaml", yaml.safe_dump(values))
    return run


def run_seeds() -> list[bytes]:
    """Which of a run's files is damaged stands before it."""
    run = begun(kept_room())
    names = ("run.json", "run.json", "config.yaml", "arm.yaml", "estimate.yaml")
    return [name.encode() + b"\0" + (run / name).read_bytes() for name in names]


@cache
def kept_room() -> Path:
    import atexit
    import tempfile

    room = tempfile.mkdtemp(prefix="fuzz-")
    atexit.register(shutil.rmtree, room, ignore_errors=True)
    return Path(room)


def damaged_run(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    name, _, content = data.partition(b"\0")
    if name == b"run.json":
        if rng.random() < 0.5:
            content = json.dumps(
                change_tree(rng, json.loads(content)), indent=2, default=str, skipkeys=True
            ).encode()
        else:
            content = damage(rng, content, [content])
        if rng.random() < 0.02:
            content = b'{"a":' * 100_000
    else:
        content = damaged_yaml(rng, content, [content])
    return name + b"\0" + content


def read_a_run(room: Path, data: bytes, deep: bool) -> None:
    run = begun(kept_room())
    settings, arm = quick()
    name, _, content = data.partition(b"\0")
    file = run / name.decode()
    intact = file.read_bytes()
    log = run.parent / "log.csv"
    try:
        file.write_bytes(content)
        folder = RunFolder(run)
        if name == b"estimate.yaml":
            folder.estimate()
        if deep:
            _continued(run, {}, True, 1)
        then, _ = folder.settings()
        folder.check(settings, [log])
        if name == b"run.json":
            there = json.loads(content.decode("utf-8-sig"))
            digest = json.loads(intact)["logs"]
            expect(there["logs"] == digest, "a run of other logs may be continued")
        if name == b"config.yaml":
            free = {"simulation": then.simulation, "arm": then.arm}
            expect(
                then.model_copy(update=free) == settings.model_copy(update=free),
                "other settings may be continued",
            )
    finally:
        file.write_bytes(intact)


# checkpoints


def checkpoint_seeds() -> list[bytes]:
    return [(begun(kept_room()) / "checkpoint.npz").read_bytes()]


def damaged_checkpoint(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    if rng.random() < 0.5:
        return damage(rng, data, others)
    with np.load(io.BytesIO(data)) as file:
        arrays: dict[str, Any] = dict(file)
    name = rng.choice([*arrays])
    value = arrays[name]
    match rng.randrange(9):
        case 0:
            del arrays[name]
        case 1:
            arrays[name] = value[: len(value) // 2]
        case 2:
            arrays[name] = value.reshape(-1)[::-1]
        case 3:
            arrays[name] = np.array([{"a": 1}], dtype=object)
        case 4:
            arrays[name] = value.astype(rng.choice(("f4", "i1", "c16", "U8", "?")))
        case 5:
            arrays[name] = np.full(value.shape, rng.choice((np.nan, np.inf, -1, 1e308)))
        case 6:
            flat = value.copy().reshape(-1)
            flat[rng.randrange(max(1, flat.size))] += 1
            arrays[name] = flat.reshape(value.shape)
        case 7:
            arrays[name] = np.zeros(30_000_000, dtype=np.uint8) if rng.random() < 0.05 else np.zeros((0, 3))
        case _:
            arrays[name] = arrays[rng.choice([*arrays])]
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def read_a_checkpoint(room: Path, data: bytes, deep: bool) -> None:
    run = begun(kept_room())
    file = run / "checkpoint.npz"
    intact = file.read_bytes()
    whole = _flat(RunFolder(run).checkpoint())
    try:
        file.write_bytes(data)
        found = _flat(RunFolder(run).checkpoint())
        expect(found == whole, "another state than the one that was saved may be continued")
    finally:
        file.write_bytes(intact)


def _flat(value: Any) -> Any:
    """A checkpoint as comparable plain values, whatever its classes are."""
    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if isinstance(value, dict):
        return {key: _flat(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_flat(inner) for inner in value]
    return _flat(vars(value)) if hasattr(value, "__dict__") else value


# models and meshes


@cache
def model_seeds() -> list[bytes]:
    text = (assets() / "models" / "hydrolek.xml").read_text()
    return [text.replace('meshdir="../meshes"', f'meshdir="{assets() / "meshes"}"').encode()]


def damaged_model(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    if rng.random() < 0.03:
        bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">' + "".join(
            f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
        )
        outside = '<!DOCTYPE x [<!ENTITY i SYSTEM "file:///etc/passwd">'
        return (rng.choice((bomb, outside)) + "]>\n").encode() + data.replace(
            b'model="hydrolek"', b'model="&i;"'
        )
    return (
        change_xml(rng, data.decode()).encode("utf-8", "replace")
        if rng.random() < 0.6
        else damage(rng, data, others)
    )


def read_a_model(room: Path, data: bytes, deep: bool) -> None:
    _, arm = basis()
    path = put(room / "model" / "arm.xml", data)
    model = load_model(path, arm).compile()
    for values in (model.body_mass, model.body_inertia, model.body_pos, model.jnt_range, model.qpos0):
        expect(np.isfinite(values).all(), "the model is not finite")
    try:
        bodies = ElementTree.fromstring(data).iter("body")
    except (ElementTree.ParseError, ValueError):  # entities, which MuJoCo's reader leaves as they stand
        bodies = []
    for body in bodies:
        given = body.find("inertial")
        if given is not None and "mass" in given.attrib and body.get("name"):
            mass = model.body(body.get("name")).mass[0]
            expect(
                np.isclose(mass, float(given.get("mass", "")), rtol=1e-12),
                f"{body.get('name')} weighs {mass}",
            )
    if deep:
        run = room / "run"
        shutil.rmtree(run, ignore_errors=True)
        settings, _ = basis()
        own = arm.model_copy(update={"model": path})
        RunFolder(run).begin(settings, own, [put(room / "log.csv", log_seeds()[0])])
        copied = load_model(run / "model" / "arm.xml", arm).compile()
        for name in (
            "body_mass",
            "body_inertia",
            "body_pos",
            "body_quat",
            "jnt_axis",
            "jnt_range",
            "mesh_vert",
        ):
            one, other = getattr(model, name), getattr(copied, name)
            expect(
                one.shape == other.shape and np.allclose(one, other, rtol=1e-9, atol=1e-12),
                f"the copy's {name} differs",
            )


@cache
def mesh_seeds() -> list[bytes]:
    tube = trimesh.creation.annulus(0.05, 0.08, 0.3, sections=8)
    box = trimesh.creation.box((0.2, 0.1, 0.4))
    solid = [box.export(file_type="stl"), tube.export(file_type="stl")]
    return [
        *solid,
        *solid,
        (assets() / "meshes" / "jaw_left.stl").read_bytes(),
        box.export(file_type="stl_ascii").encode(),
    ]


def damaged_mesh(rng: Random, data: bytes, others: list[bytes]) -> bytes:
    if data.startswith(b"solid") or rng.random() < 0.4:
        return damage(rng, data, others)
    head, body = data[:84], np.frombuffer(data[84:], np.uint8).reshape(-1, 50).copy()
    corners = body[:, 12:48].copy().view("<f4")
    match rng.randrange(8):
        case 0:
            corners[rng.randrange(len(corners)), rng.randrange(9)] = rng.choice(
                (np.nan, np.inf, 1e38, 0, 1e-40)
            )
        case 1:
            corners *= rng.choice((1000, -1, 1e-6, 0, 1e12, 0.5))
        case 2:
            body = np.delete(body, rng.randrange(len(body)), axis=0)
            corners = np.delete(corners, 0, axis=0) if len(corners) > len(body) else corners
            return head[:80] + len(body).to_bytes(4, "little") + body.tobytes()
        case 3:
            head = head[:80] + rng.choice((0, 1, len(body) + 1, 2**31, 2**32 - 1)).to_bytes(4, "little")
        case 4:
            body = np.concatenate([body, body])
            corners = np.concatenate([corners, corners])
            head = head[:80] + len(body).to_bytes(4, "little")
        case 5:
            corners = corners.reshape(-1, 3, 3)[:, ::-1].reshape(-1, 9)
        case 6:
            corners = corners + np.float32(rng.choice((1, 100, 1e6)))
        case _:
            corners[rng.randrange(len(corners))] = corners[rng.randrange(len(corners))]
    body[:, 12:48] = np.ascontiguousarray(corners.astype("<f4")).view(np.uint8)
    return head + body.tobytes()


def read_a_mesh(room: Path, data: bytes, deep: bool) -> None:
    found = mass_properties(put(room / "link.stl", data))
    for values in (found.volume, found.centre, found.inertia):
        expect(np.isfinite(values).all(), "the mesh's numbers are not finite")
    expect((np.linalg.eigvalsh(found.inertia) > 0).all(), "the inertia is not positive")
    check_mesh(data, found.volume, found.centre, found.inertia)


# the report


class _Page(HTMLParser):
    def __init__(self, source: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags, self.text = list[str](), ""
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append(tag + "".join(f" {name}" for name, _ in attrs))

    def handle_data(self, data: str) -> None:
        self.text += data


def _page(word: str) -> _Page:
    table = Table(word, (word, "n"), ((word, 1.0),), word)
    section = Section(word, word, ((word, word),), (table,), (), (word,))
    return _Page(report_html(word, word, (section,), {"hydroid": word}))


@cache
def _harmless() -> list[str]:
    return _page("x").tags


def read_a_page(room: Path, data: bytes, deep: bool) -> None:
    word = data.decode("utf-8", "replace").replace("\r", " ").replace("\0", " ")
    page = _page(word)
    expect(not word or page.tags == _harmless(), "a name became markup")
    expect(word in page.text, "a name is not shown as it stands")


def page_seeds() -> list[bytes]:
    return [
        b"log.csv",
        b"<script src=x>",
        b'"><img onerror=1>',
        b"{{ 7*7 }}",
        b"{% raw %}",
        b"&lt;",
        b"--><!--",
        b"M1",
    ]


KINDS = {
    kind.name: kind
    for kind in (
        Kind("log", log_seeds, damage, read_a_log),
        Kind("config", config_seeds, damaged_yaml, read_a_config),
        Kind("set", override_seeds, damaged_override, read_an_override),
        Kind("arm", arm_seeds, damaged_yaml, read_an_arm),
        Kind("values", value_seeds, damaged_yaml, read_values),
        Kind("run", run_seeds, damaged_run, read_a_run),
        Kind("checkpoint", checkpoint_seeds, damaged_checkpoint, read_a_checkpoint),
        Kind("model", model_seeds, damaged_model, read_a_model),
        Kind("mesh", mesh_seeds, damaged_mesh, read_a_mesh),
        Kind("page", page_seeds, damage, read_a_page),
    )
}
__all__ = ["KINDS", "Kind", "Wrong"]
