"""See an arm move: `view` in a window, `render` as a file."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hydroid.api.arms import read_arms
from hydroid.api.look import ModelSource, open_model, require_hydraulics
from hydroid.api.plan import run_logs
from hydroid.errors import SettingsError
from hydroid.files import write_atomic
from hydroid.identified_model import IdentifiedModel
from hydroid.log import Log
from hydroid.progress import Progress, no_progress

if TYPE_CHECKING:
    from hydroid.viewer.motion import Motion


def view(
    model: ModelSource,
    log: str | Path | Log | None = None,
    *,
    arm: str | None = None,
    pose: str | None = None,
    repair: bool = False,
) -> None:
    """Show an arm in MuJoCo's viewer in real time until its window is closed.

        hydroid.view("runs/a", "a.csv")

    Args:
        model: a run folder, a YAML file of values or an identified model.
        log: whose commands drive, beside the ghost of what it measured; None: the viewer's sliders.
        arm: right, left or both: the arms of a pair that move; None: the arm stands alone.
        pose: name of the start pose in the arm's file; by default the log's first angles, or the settings'
            start pose.
        repair: fill holes of the log up to `log.repair_s`.

    Raises:
        RunError: no window can be opened, or the simulation diverged.
        SettingsError: no such arm or pose, or two arms on sliders.
    """
    model = _opened(model)
    from hydroid.viewer.playback import Replay, make_sliders
    from hydroid.viewer.window import show

    if log is not None:
        show(Replay(_motion(model, log, arm, pose, repair)))
    elif arm is not None:
        raise SettingsError("needs a log: sliders are those of one arm", where="--arm")
    else:
        show(make_sliders(model, pose))


def render(
    model: ModelSource,
    out: str | Path,
    log: str | Path | Log | None = None,
    *,
    arm: str | None = None,
    span: tuple[float, float] = (0.0, np.inf),
    repair: bool = False,
    progress: Progress = no_progress,
) -> Path:
    """Render the motion of an arm under a log's commands beside the ghost of what the log measured.

        hydroid.render("runs/a", "a.png", "a.csv", span=(10, 20))

    No display is needed, but OpenGL. A program of one's own chooses it before it imports anything: it sets
    MUJOCO_GL to egl or osmesa in the environment.

    Args:
        model: a run folder, a YAML file of values or an identified model.
        out: a .mp4 film, a smaller .gif, or a .png of several moments.
        log: a CSV file or a log; None: the first log of the run folder `model`.
        arm: right, left or both: the arms of a pair that move; None: the arm stands alone.
        span: from when to when [s].
        repair: fill holes of the log up to `log.repair_s`.
        progress: called with what is done, how much of it, and how much there is.

    Returns:
        The file.

    Raises:
        RunError: no OpenGL, no package that writes films, or the simulation diverged.
        SettingsError: another kind of file, no such arm, or a span without time.
    """
    opened = _opened(model)
    from hydroid.viewer.film import check_kind, render_motion

    kind = check_kind(Path(out))
    motion = _motion(opened, run_logs(model)[0] if log is None else log, arm, None, repair)
    write_atomic(Path(out), render_motion(motion, kind, span, progress))
    return Path(out)


def _opened(model: ModelSource) -> IdentifiedModel:
    opened = open_model(model)
    if opened.nominal:
        require_hydraulics(opened)
    return opened


def _motion(
    model: IdentifiedModel, log: str | Path | Log, arm: str | None, pose: str | None, repair: bool
) -> "Motion":
    from hydroid.viewer.motion import simulated_motion

    return simulated_motion(model, read_arms(log, model.settings, arm, pose=pose, repair=repair))
