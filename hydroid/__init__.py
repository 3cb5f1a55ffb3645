"""hydroid: physical parameters of a hydraulic manipulator from its logs, on MuJoCo.

    fitted = hydroid.fit_hyd("a.csv", config="my-fit.yaml", out="runs/a")
    print(fitted.to_frame(), fitted.validate("b.csv"))

    plant = fitted.plant()
    plant.reset()
    angle = plant.step({"boom": 50})

Each command of `hydroid --help` is one function here: its arguments come first, its
options are keywords, and its result prints itself in a notebook. Every name is imported
when it is first used.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hydroid.commands.analyse import (
        QuantityResult as QuantityResult,
        analyse as analyse,
        quantity as quantity,
    )
    from hydroid.commands.check import check as check, convert as convert
    from hydroid.commands.export import draw as draw, export as export
    from hydroid.commands.fit import FitResult as FitResult, fit as fit
    from hydroid.commands.follow import follow as follow
    from hydroid.commands.init import init as init
    from hydroid.commands.inputs import load_settings as load_settings
    from hydroid.commands.logs import read_logs as read_logs
    from hydroid.commands.plan import design as design, suggest as suggest
    from hydroid.commands.stages import (
        adapt as adapt,
        fit_hyd as fit_hyd,
        fit_mech as fit_mech,
    )
    from hydroid.commands.study import study as study
    from hydroid.commands.validate import report as report, validate as validate
    from hydroid.commands.view import simulate as simulate, view as view
    from hydroid.errors import HydroidError as HydroidError
    from hydroid.identified_model import (
        IdentifiedModel as IdentifiedModel,
        identified as identified,
        load_identified as load_identified,
        start_values as start_values,
    )
    from hydroid.log import Log as Log, write_log as write_log
    from hydroid.parallel.cluster import open_workers as open_workers
    from hydroid.plant import (
        Plant as Plant,
        PlantBatch as PlantBatch,
        load_plant as load_plant,
    )
    from hydroid.use.draws import Draws as Draws
    from hydroid.use.environment import Env as Env, VectorEnv as VectorEnv

__version__ = "0.1.0"

# the imports above, which only type checkers perform, are the one list of names
_HOMES = {
    alias.name: node.module
    for node in ast.walk(ast.parse(Path(__file__).read_text(encoding="utf-8")))
    if isinstance(node, ast.ImportFrom)
    and node.module
    and node.module.startswith("hydroid.")
    for alias in node.names
}

__all__ = ["__version__", *_HOMES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'hydroid' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
