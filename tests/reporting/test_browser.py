"""Pages in a real browser: no error, no request, nothing cut off, at the width of a
phone and of a screen."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from report_fits import make_fit, make_prediction, make_problem, make_record

from hydroid.fitting.verdict import judge
from hydroid.reporting.page_file import write_page
from hydroid.reporting.predictions import fit_page, validation_page

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    None,
)
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")

PROBE = f"<script>{Path(__file__).with_name('probe.js').read_text()}</script>"


def browse(page: Path, *how: str) -> str:
    assert BROWSER is not None
    how = (
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--virtual-time-budget=60000",
        *how,
    )
    command = [
        BROWSER,
        *how,
        f"--user-data-dir={page.parent / 'profile'}",
        page.as_uri(),
    ]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=240, check=True
    ).stdout


def seen(page: Path, width: int, *options: str) -> dict:
    """What a browser finds in a page of a width [px] with all its folded parts open."""
    probed = page.with_name("probed.html")
    source = page.read_text(encoding="utf-8")
    probed.write_text(source.replace("<head>", f"<head>{PROBE}", 1), encoding="utf-8")
    text = browse(probed, f"--window-size={width},900", "--dump-dom", *options)
    found = re.search(r"FOUND(.*)END", text)
    assert found, text[-2000:]
    return json.loads(
        found[1].replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">")
    )


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    problem = make_problem(("<a>&b.csv", "other.csv"), outputs=(2, 3))
    fit = make_fit(problem, effects=(1e-3, 1e-3, 0.0, 1e-3))
    folder = tmp_path_factory.mktemp("pages")
    log = replace(problem.logs[0], source="unseen.csv")
    results = [make_prediction(log, (2, 3), fit=name) for name in ("a", "b")]
    arm, fits = (
        problem.settings.arm,
        {p.fit: judge(problem.settings, [], {}, [p]) for p in results},
    )
    for page in (
        fit_page(make_record(problem, fit)),
        validation_page(results, fits, arm),
    ):
        write_page(page, folder)
    return {name: folder / f"{name}.html" for name in ("report", "validation")}


@pytest.mark.parametrize("name", ["report", "validation"])
@pytest.mark.parametrize(
    "how",
    [
        (400,),
        (1400,),
        (1400, "--force-dark-mode", "--blink-settings=preferredColorScheme=0"),
    ],
    ids=["phone", "screen", "dark"],
)
def test_a_page_is_whole_in_a_browser(pages: dict[str, Path], name: str, how: tuple):
    found = seen(pages[name], *how)
    assert found["problems"] == []
    assert found["requests"] == []
    assert found["content"] <= found["width"] + 1
    assert found["charts"] > 0
    assert found["empty"] == 0
    assert found["unnamed"] == 0
    assert found["moved"] > 0
    levels = found["headings"]
    assert levels[0] == 1
    assert np.max(np.diff(levels)) <= 1


def test_choosing_a_cell_moves_chart_and_arm_together(pages: dict[str, Path]):
    """One log is shown at a time."""
    chosen = seen(pages["report"], 1400)["chosen"]
    assert chosen["row"] == "other.csv fitted"
    assert chosen["charts"] == [chosen["row"]]
    assert chosen["arms"] == [chosen["row"]]


INJECTED = "<img src=x onerror=\"ran='a name'\">"  # short: pages shorten long names
SCRIPT = "<script>ran='a script'</script>"


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A validation whose fits and logs are called as HTML that runs a script."""
    problem = make_problem(outputs=(2, 3))
    logs = [
        replace(problem.logs[0], source=name) for name in (INJECTED, f"{INJECTED}.csv")
    ]
    results = [
        make_prediction(log, (2, 3), fit=name)
        for name in (INJECTED, SCRIPT)
        for log in logs
    ]
    fits = {p.fit: judge(problem.settings, [], {}, [p]) for p in results}
    page = validation_page(results, fits, problem.settings.arm)
    return write_page(page, tmp_path_factory.mktemp("hostile"))


def test_names_are_text_in_a_browser_in_tooltips_too(hostile: Path):
    found = seen(hostile, 1400)
    assert found["ran"] == "nothing"
    assert found["images"] == 0
    assert found["problems"] == []
    labels = [text for text in found["tooltips"] if text.startswith(INJECTED)]
    assert labels, found["tooltips"]


def test_a_script_that_got_into_a_page_is_not_run(
    pages: dict[str, Path], tmp_path: Path
):
    """The second line of defence: the policy names the page's own scripts."""
    page = tmp_path / "page.html"
    source = pages["report"].read_text(encoding="utf-8")
    page.write_text(
        source.replace(
            "<main>", f"<main>{INJECTED}{SCRIPT}<base href='https://a.org'>"
        ),
        encoding="utf-8",
    )
    found = seen(page, 1400)
    assert found["ran"] == "nothing"
    assert found["images"] == 1
    assert (
        len([problem for problem in found["problems"] if problem.startswith("refused")])
        >= 3
    )


def test_a_page_is_printed_on_paper(pages: dict[str, Path], tmp_path: Path):
    paper = tmp_path / "page.pdf"
    browse(pages["report"], f"--print-to-pdf={paper}")
    assert paper.read_bytes().startswith(b"%PDF")
    assert paper.stat().st_size > 30_000  # with its charts
