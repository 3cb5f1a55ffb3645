"""The shipped arm as a model with known values, for tests of what a fit is used for."""

from collections.abc import Mapping

from made_logs import HYDRAULIC, TRUTH

from hydroid import load_settings
from hydroid.identified_model import IdentifiedModel, identified

VALUES = (
    TRUTH
    | HYDRAULIC
    | {"open_A": 0.3, "open_B": 0.3, "delay": 0.05, "friction": 20.0, "S": 0.0}
)
"""valves that open by 0.3, and little friction"""
EARLY = VALUES | {"A": 0.05, "C": 0.05}
"""valves that open from 0.05 V on, where those of `VALUES` have a wide dead band"""
EARLY_SETTINGS = {"onset_a": 0.05, "onset_b": 0.05, "leakage": 0.0}
"""of the hydraulics, with which every joint is as those of `EARLY`"""


def made_model(
    values: Mapping[str, float] = VALUES,
    changes: Mapping[str, object] | None = None,
    stage: str = "hyd",
    hydraulics: Mapping[str, float] | None = None,
) -> IdentifiedModel:
    """Return a model that begins in the study pose, of those values that its settings
    have parameters for.

    `hydraulics` are settings of the hydraulics by their names there.
    """
    every: dict[str, object] = {"start_pose": "study"}
    for name, value in (hydraulics or {}).items():
        every[f"hydraulics.{name}"] = value
    settings = load_settings(f"fit-{stage}", every | dict(changes or {}))
    known = settings.parameters.keys() & values.keys()
    return identified(settings, {name: values[name] for name in known}, "test")
