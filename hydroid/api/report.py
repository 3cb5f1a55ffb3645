"""Draw the report of finished runs and studies anew, and several side by side: `report`."""

from collections.abc import Sequence
from pathlib import Path

from hydroid.errors import RunError


def report(folders: Sequence[str | Path], out: str | Path = "runs/report") -> Path:
    """Draw the report of a folder anew, in its place; or several folders' reports side by side on one page.

        hydroid.report(["runs/hyd"])
        hydroid.report(["runs/hyd", "runs/validation"], "runs/report")

    Nothing is simulated, and no log is needed: a report carries all that it shows.

    Args:
        folders: of runs and studies; or their HTML files.
        out: folder for the page of several.

    Returns:
        The page.

    Raises:
        RunError: a folder holds no report, or one of another version; or the page cannot be written.
    """
    from hydroid.files import write_atomic
    from hydroid.report.comparison import comparison, names_of
    from hydroid.report.page_file import content_html, read_page

    files = [_page(Path(folder)) for folder in folders]
    contents = [read_page(file) for file in files]
    if len(files) == 1:
        write_atomic(files[0], content_html(contents[0]))
        return files[0]
    file = Path(out) / "comparison.html"
    write_atomic(file, content_html(comparison(dict(zip(names_of(files), contents, strict=True)))))
    return file


def _page(folder: Path) -> Path:
    """The one page of a folder, that of a run before those of studies."""
    if folder.is_file():
        return folder
    found = sorted(folder.glob("*.html"), key=lambda file: (file.name != "report.html", file.name))
    if not found:
        hint = "name the folder of a fit, of validate, identifiability, suggest, design or collect"
        raise RunError("holds no report", where=str(folder), hint=hint)
    return found[0]
