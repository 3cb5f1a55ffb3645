"""hydroid: physical parameters of a hydraulic manipulator from its logs, on MuJoCo.

    settings = hydroid.load_settings("fit-hyd", {"search.seed": 3})
    logs = hydroid.read_logs(["a.csv", "b.csv"], settings)
    result = hydroid.fit(settings, logs, out="runs/a")

    plant = hydroid.load_plant("runs/a")
    plant.reset()
    angle = plant.step(command)

Each command of `hydroid --help` is one function here. Every name is imported when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hydroid.api.arms import collisions as collisions
    from hydroid.api.arms import read_arms as read_arms
    from hydroid.api.arms import simulate_arms as simulate_arms
    from hydroid.api.convert import Conversion as Conversion
    from hydroid.api.convert import convert as convert
    from hydroid.api.fit import FitResult as FitResult
    from hydroid.api.fit import fit as fit
    from hydroid.api.judge import identifiability as identifiability
    from hydroid.api.judge import sensitivity as sensitivity
    from hydroid.api.judge import surface as surface
    from hydroid.api.judge import validate as validate
    from hydroid.api.look import Check as Check
    from hydroid.api.look import LogCheck as LogCheck
    from hydroid.api.look import check as check
    from hydroid.api.look import load_settings as load_settings
    from hydroid.api.look import plot_actuator as plot_actuator
    from hydroid.api.look import read_commands as read_commands
    from hydroid.api.look import read_logs as read_logs
    from hydroid.api.model import simulate as simulate
    from hydroid.api.motion import render as render
    from hydroid.api.motion import view as view
    from hydroid.api.plan import design as design
    from hydroid.api.plan import suggest as suggest
    from hydroid.api.quantity import QuantityResult as QuantityResult
    from hydroid.api.quantity import quantity as quantity
    from hydroid.api.report import report as report
    from hydroid.api.stages import FitOptions as FitOptions
    from hydroid.api.stages import FitRuns as FitRuns
    from hydroid.api.stages import collect as collect
    from hydroid.api.stages import fit_hyd as fit_hyd
    from hydroid.api.stages import fit_mech as fit_mech
    from hydroid.api.start import init as init
    from hydroid.api.studies import study as study
    from hydroid.api.study import Study as Study
    from hydroid.errors import HydroidError as HydroidError
    from hydroid.identified_model import IdentifiedModel as IdentifiedModel
    from hydroid.identified_model import identified as identified
    from hydroid.identified_model import load_identified as load_identified
    from hydroid.identified_model import start_values as start_values
    from hydroid.log import Log as Log
    from hydroid.log import write_log as write_log
    from hydroid.parallel.cluster import open_workers as open_workers
    from hydroid.plant import Plant as Plant
    from hydroid.plant import load_plant as load_plant
    from hydroid.project import Project as Project

__version__ = "0.1.0"

_NAMES = {
    "hydroid.api.arms": "collisions read_arms simulate_arms",
    "hydroid.api.convert": "Conversion convert",
    "hydroid.api.fit": "FitResult fit",
    "hydroid.api.report": "report",
    "hydroid.api.stages": "FitOptions FitRuns collect fit_hyd fit_mech",
    "hydroid.api.judge": "identifiability sensitivity surface validate",
    "hydroid.api.look": "Check LogCheck check load_settings plot_actuator read_commands read_logs",
    "hydroid.api.model": "simulate",
    "hydroid.api.motion": "render view",
    "hydroid.api.plan": "design suggest",
    "hydroid.api.quantity": "QuantityResult quantity",
    "hydroid.api.start": "init",
    "hydroid.api.studies": "study",
    "hydroid.api.study": "Study",
    "hydroid.errors": "HydroidError",
    "hydroid.identified_model": "IdentifiedModel identified load_identified start_values",
    "hydroid.log": "Log write_log",
    "hydroid.parallel.cluster": "open_workers",
    "hydroid.plant": "Plant load_plant",
    "hydroid.project": "Project",
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = ["__version__", *_HOMES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'hydroid' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
