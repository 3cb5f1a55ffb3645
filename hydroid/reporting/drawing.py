"""Reports of finished runs, drawn from what the runs store; nothing is simulated, and no log is needed."""

from collections.abc import Collection, Sequence
from os.path import commonpath
from pathlib import Path

from hydroid.reporting.comparison import comparison_page
from hydroid.reporting.fit_report import fit_page
from hydroid.reporting.page_file import write_figures, write_page
from hydroid.run.record import load_record


def draw(
    runs: Sequence[str | Path], out: str | Path, without: Collection[str] = (), *, figures: bool = False
) -> Path:
    """Draw the report of one run in its folder, or one page in `out` that compares several; return the page.

    Args:
        runs: folders of finished runs.
        out: folder for the page of several.
        without: names of validations that are left out.
        figures: write every chart as PNG and SVG too, to figures/ beside the page.

    Raises:
        RunError: a folder holds no finished run of this version, or the page cannot be written.
    """
    records = [load_record(run, without) for run in runs]
    if len(runs) == 1:
        folder, page = Path(runs[0]), fit_page(records[0])
    else:
        paths = [Path(run).resolve() for run in runs]
        parent = commonpath([path.parent for path in paths])
        names = (str(path.relative_to(parent)) for path in paths)
        folder, page = Path(out), comparison_page(dict(zip(names, records, strict=True)))
    write_page(page, folder)
    if figures:
        write_figures(page, folder / "figures")
    return folder / f"{page.name}.html"
