"""README and documentation: the site builds, pages name only what exists, and what they
show runs."""

import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
import warm
import yaml
from log_files import halve

from hydroid.commands.app import COMMANDS as NAMES, click_command
from hydroid.quantity_table import QUANTITIES

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
RUN = (
    "quick_start",
    "first_log",
    "recording",
    "algorithms",
    "python",
    "use",
    "two_arms",
    "own_arm",
)
"""pages whose `sh` and `python` blocks are run, in this order; other blocks are only
shown"""
COMMANDS = {name: click_command(name) for name in NAMES}
each_page = pytest.mark.parametrize(
    "page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem
)


class Block(NamedTuple):
    language: str
    text: str
    where: str


def blocks(page: Path) -> list[Block]:
    text = page.read_text()
    found = re.finditer(r"^```(\w+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [
        Block(m[1], m[2], f"{page.name}:{text.count(chr(10), 0, m.start()) + 1}")
        for m in found
    ]


def test_the_site_builds_without_a_warning(tmp_path: Path):
    how = ["-W", "--keep-going", "-q", "-b", "html"]
    build = [sys.executable, "-m", "sphinx", *how, ROOT / "docs", tmp_path / "site"]
    done = subprocess.run(
        build,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr
    assert {p.stem for p in PAGES} <= {
        p.stem for p in (tmp_path / "site").glob("*.html")
    }


@each_page
def test_links_lead_to_files(page: Path):
    for target in re.findall(r"\]\(([^)]+)\)", page.read_text()):
        name = target.partition("#")[0]
        if not name.startswith("http") and name:
            assert (page.parent / name).exists(), target


@each_page
def test_commands_have_the_flags_that_are_shown(page: Path):
    shown = "\n".join(
        b.text for b in blocks(page) if b.language in ("sh", "console")
    ).replace("\\\n", "")
    lines = re.findall(r"^(?:\$ )?hydroid ([a-z-]+)([^#\n]*)", shown, re.MULTILINE)
    lines += re.findall(r"`hydroid ([a-z][a-z-]+)([^`#|\n]*)", page.read_text())
    for name, rest in lines:
        known = {
            option for parameter in COMMANDS[name].params for option in parameter.opts
        }
        assert set(re.findall(r" (--?[a-z][a-z-]*)", rest)) <= known, f"{name}{rest}"


@each_page
def test_files_and_make_targets_that_are_named_exist(page: Path):
    text, makefile = page.read_text(), (ROOT / "Makefile").read_text()
    folders = "configs|examples|docs|benchmarks|tests|hydroid"
    for name in re.findall(rf"`((?:{folders})/[\w./-]+)`", text):
        assert (ROOT / name.rstrip("/")).exists() or (
            ROOT / "hydroid" / name
        ).exists(), name
    for target in set(re.findall(r"(?:`|^)make ([a-z-]+)", text, re.MULTILINE)):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_table_of_commands_has_all_of_them():
    table = (ROOT / "docs" / "commands.md").read_text()
    named = re.findall(
        r"^\| [a-z]* ?\| `hydroid ([a-z]+-?[a-z]+) ", table, re.MULTILINE
    )
    assert sorted(named) == sorted(COMMANDS)


@pytest.mark.slow
def test_what_the_pages_show_runs(tmp_path: Path):
    """A page's commands, then its Python as one program; all pages share a folder, as
    for a reader."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    for log in (tmp_path / "examples").rglob("*.csv"):
        halve(log)
    # the files that own_arm.md takes for the reader's own
    urdf = tmp_path / "examples" / "urdf"
    (tmp_path / "robot.urdf").write_bytes((urdf / "robot.urdf").read_bytes())
    (tmp_path / "meshes").symlink_to(urdf / "meshes")
    for n, name in enumerate("abc", start=1):
        (tmp_path / f"{name}.csv").symlink_to(urdf / f"log_{n}.csv")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PATH": path}
    # shorter logs and searches than the pages show: that each command and flag works is
    # the statement here
    hydroid = f"""hydroid() {{ case $1 in
      fit-*) set -- "$@" --set refinement.iterations=5 --set search.multistart.starts=1 \
        --set simulation.model=quasi-static;;
      design) set -- "$@" --set design.effort=20;;
    esac; "{sys.executable}" -S "{warm.__file__}" "$WARM" "$@"; }}
"""
    with warm.warm_process() as address:
        environment["WARM"] = address
        run_pages(tmp_path, hydroid, environment)


def run_pages(folder: Path, hydroid: str, environment: dict[str, str]) -> None:
    """Run what the pages show in a folder, with a shell's function `hydroid`."""
    for name in RUN:
        page = blocks(ROOT / "docs" / f"{name}.md")
        shell = [
            (b.where, ["bash", "-ec", hydroid + b.text])
            for b in page
            if b.language == "sh"
        ]
        code = "".join(b.text for b in page if b.language == "python")
        for where, command in (*shell, (name, [sys.executable, "-c", code])):
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True
            )
            assert done.returncode == 0, f"{where}\n{done.stderr[-2000:]}"


FIGURES = runpy.run_path(str(ROOT / "docs" / "figures.py"))


def test_the_pages_state_the_figures_of_one_file():
    figures, marked = (
        yaml.safe_load(FIGURES["FILE"].read_text(encoding="utf-8")),
        [*FIGURES["marked"]()],
    )
    assert {page.name for page, _ in marked} >= {
        "README.md",
        "measured.md",
        "quick_start.md",
    }
    for page, text in marked:
        assert text == FIGURES["filled"](text, figures), (
            f"{page}: write it again, python docs/figures.py --pages"
        )
        assert (
            text.count("<!--=")
            == text.count("<!--/-->")
            == len(FIGURES["MARKED"].findall(text))
        ), page
        # Markdown takes a line that begins so for HTML, to its end
        assert not re.search(r"^<!--=.*--> *\S", text, re.MULTILINE), page


def test_a_row_that_stands_on_two_pages_has_the_same_figures():
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for page in FIGURES["PAGES"]:
        text = re.sub(r"<!--.*?-->", "", page.read_text(encoding="utf-8"))
        for header, body in re.findall(
            r"^(\|.*\|)\n\|[ :|-]+\|\n((?:\|.*\|\n?)+)", text, re.MULTILINE
        ):
            for name, cells in re.findall(r"^\| ([^|]+) \|(.*)\|$", body, re.MULTILINE):
                rows.setdefault((header, name), {})[str(page)] = cells
    several = {key: pages for key, pages in rows.items() if len(pages) > 1}
    assert several
    for key, pages in several.items():
        assert len({*pages.values()}) == 1, (key, pages)


def test_figures_are_rounded_as_they_are_printed():
    """By hand: a fit that errs by 0.18499 deg, of whose samples 84.57 % are inside, and
    a diverged one."""
    joint = {"unseen_deg": 0.18499, "inside_percent": 84.57, "unseen_mae_deg": 1.5}
    text = " ".join(f"<!--=rig.boom.{name}-->?<!--/-->" for name in (*joint, "lost"))
    shown = FIGURES["filled"](text, {"rig": {"boom": joint | {"lost": None}}})
    assert re.sub(r"<!--.*?-->", "", shown) == "0.18 85 1.50 diverged"


def test_the_sentence_names_where_a_simple_model_is_better_or_may_be():
    good = {"speed tables": ["better"] * 5, "nine numbers": ["better"] * 5}
    bad = good | {
        "nine numbers": ["worse", "worse", "worse", "cannot be told", "worse"]
    }
    excavator = {joint: {"compared": good} for joint in ("boom", "arm", "swing")} | {
        "bucket": {"compared": bad}
    }
    figures = {"rig": {"shoulder": {"compared": good}}, "excavator": excavator}
    sentence = FIGURES["PARTS"]["not better"]
    assert sentence(figures).endswith(
        "by both simple models, but for the bucket after 5 s (cannot be told) and "
        "the bucket after 1 and 10 s (worse)."
    )
    excavator["bucket"]["compared"] = good
    assert sentence(figures).endswith("than by both simple models.")


def test_the_page_of_settings_is_up_to_date_and_describes_each_of_them():
    script = runpy.run_path(str(ROOT / "docs" / "settings_reference.py"))
    page = (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
    assert page == script["reference"](), "write it again with `make docs`"
    assert script["undescribed"]() == []
    assert QUANTITIES["flow_limit"].factor == 1e-3 / 60
