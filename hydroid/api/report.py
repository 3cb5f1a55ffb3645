"""Draw the report of finished runs and studies anew, and several side by side: `report`."""

from collections.abc import Sequence
from pathlib import Path

from hydroid.errors import RunError


def report(folders: Sequence[str | Path], out: str | Path = "runs/report", *, figures: bool = False) -> Path:
    """Draw the report of a folder anew, in its place; or several folders' reports side by side on one page.

        hydroid.report(["runs/hyd"])
        hydroid.report(["runs/hyd", "runs/validation"], "runs/report")

    Nothing is simulated, and no log is needed: a report carries all that it shows.

    Args:
        folders: of runs and studies; or their HTML files.
        out: folder for the page of several.
        figures: write every chart of the page as PNG and SVG, too, to the folder figures/ beside it.

    Returns:
        The page.

    Raises:
        RunError: a folder holds no report, or one of another version; or the page cannot be written.
    """
    from hydroid.files import write_atomic
    from hydroid.report.comparison import comparison, names_of
    from hydroid.report.page_file import content_html, read_page, write_figures

    files = [_page(Path(folder)) for folder in folders]
    contents = [read_page(file) for file in files]
    page, content = files[0], contents[0]
    if len(files) > 1:
        page = Path(out) / "comparison.html"
        content = comparison(dict(zip(names_of(files), contents, strict=True)))
    write_atomic(page, content_html(content))
    if figures:
        write_figures(content, page.parent / "figures")
    return page


def _page(folder: Path) -> Path:
    """The one page of a folder, that of a run before those of studies."""
    if folder.is_file():
        return folder
    found = sorted(folder.glob("*.html"), key=lambda file: (file.name != "report.html", file.name))
    if not found:
        hint = "name the folder of a fit, of validate, identifiability, suggest, design or collect"
        raise RunError("holds no report", where=str(folder), hint=hint)
    return found[0]
