"""Draw the report of finished runs anew, or several side by side: `report`."""

from collections.abc import Sequence
from pathlib import Path


def report(
    runs: Sequence[str | Path], out: str | Path = "runs/report", *, without: Sequence[str] = ()
) -> Path:
    """Draw the report of a run anew, in its place; or several runs side by side on one page.

        hydroid.report(["runs/hyd"])
        hydroid.report(["runs/mech", "runs/hyd"], "runs/report")

    Nothing is simulated, and no log is needed: a run stores all that its report shows.

    Args:
        runs: folders of finished runs.
        out: folder for the page of several.
        without: names of validations of the run that are left out.

    Returns:
        The page.

    Raises:
        RunError: a folder holds no finished run, or one of another version; or the page cannot be written.
    """
    from hydroid.report.drawing import draw

    return draw(runs, out, without)
