"""The section of a report that shows the arm in motion, log by log."""

from collections.abc import Mapping, Sequence

import numpy as np

from hydroid.arm.model import load_model
from hydroid.report.moving_arm import MOST, Movement, moving_arm
from hydroid.report.page import PAGE, Plot, Section, Tab
from hydroid.settings.arm import Arm

MOTION = "The arm in motion"
"""title of the section"""
_FEWEST = 100
"""moments of a log at least"""
_CAPTION = (
    "Orange: simulated. Grey: measured, hidden where both agree. The picture begins where they differ "
    "most. Joints that are not compared follow the log."
)


def motion_section(
    arm: Arm, movements: Sequence[Movement], notes: Mapping[str, str] | None = None
) -> tuple[Section, ...]:
    """Return the section with one tab per log; `notes` are of logs by name. A log that diverged has none."""
    shown = [movement for movement in movements if np.isfinite(movement.simulated).all()]
    if not shown:
        return ()
    model, most = load_model(arm).compile(), max(_FEWEST, MOST // len(shown))
    tabs: list[Tab] = []
    for i, movement in enumerate(shown):
        moving = moving_arm(model, arm.joint_names, movement, most)
        plot = Plot(
            f"motion_{i + 1}", f"{movement.log}. {_CAPTION}", lambda moving=moving: moving, where=PAGE
        )
        tabs.append(Tab(movement.log, (plot,), (notes or {}).get(movement.log, "")))
    return (Section(MOTION, tabs=tuple(tabs)),)
