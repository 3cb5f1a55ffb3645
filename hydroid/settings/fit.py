"""A fit's settings: one YAML file a job, from the log's columns to the search."""

import difflib
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from hydroid.parameters import Parameter, ParameterSet
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.cluster import ClusterSettings
from hydroid.settings.design import DesignSettings
from hydroid.settings.hydraulics import QUANTITIES, HydraulicSettings
from hydroid.settings.load import Settings
from hydroid.settings.log import LogSettings
from hydroid.settings.objective import ObjectiveSettings
from hydroid.settings.priors import PriorSettings
from hydroid.settings.search import (
    CmaesSettings,
    GaSettings,
    MultistartSettings,
    Nsga2Settings,
    PymooSettings,
    RefinementSettings,
)
from hydroid.settings.simulation import SimulationSettings

MECHANICAL_UNITS = {
    "gain": "N·m/%",
    "damping": "N·m·s/rad",
    "stiffness": "N·m/rad",
    "friction": "N·m",
    "mass": "kg",
}

Joint = Annotated[int, Field(ge=1)]


UNITS = MECHANICAL_UNITS | {q.name: q.unit for q in QUANTITIES.values()}
"""Quantities that a parameter can be, with their units."""


class ParameterSettings(Settings):
    """One parameter: what it is in the model, where it acts, its bounds, or the value it is held at."""

    quantity: str
    """gain, damping, stiffness, friction or mass; in stage 2 any quantity of the hydraulics"""
    joints: list[Joint] | None = None
    """joints that share it; left out: all"""
    link: str | None = None
    """the link whose mass it is"""
    bounds: tuple[float, float] | None = None
    fixed: float | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "ParameterSettings":
        if self.quantity not in UNITS:
            near = difflib.get_close_matches(self.quantity, UNITS, n=3, cutoff=0.4) or list(MECHANICAL_UNITS)
            raise ValueError(f"no quantity {self.quantity!r}; did you mean {' or '.join(map(repr, near))}?")
        if (self.quantity == "mass") != (self.link is not None):
            raise ValueError("a mass names its link, and only a mass does")
        if self.link is not None and self.joints is not None:
            raise ValueError("a mass belongs to a link, not to joints")
        if self.bounds is None and self.fixed is None:
            raise ValueError("needs bounds: [lower, upper], or fixed: value")
        if self.bounds is not None and not self.bounds[0] < self.bounds[1]:
            raise ValueError("bounds must be [lower, upper] with lower < upper")
        lowest = min(self.bounds or (self.fixed or 0.0,))
        if self.quantity == "mass" and min(lowest, self.fixed or lowest) <= 0:
            raise ValueError("a mass must be above 0 kg")
        if min(lowest, self.fixed or 0.0) < 0:
            raise ValueError(f"a {self.quantity} cannot be negative")
        return self

    @property
    def unit(self) -> str:
        """The unit of the quantity."""
        return UNITS[self.quantity]


class SearchSettings(Settings):
    """Which algorithm searches, from which seed, and how one estimate is taken from a Pareto set."""

    algorithm: Literal["ga", "nsga2", "cmaes", "pymoo", "multistart"] = "nsga2"
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    compromise: Literal["average", "utopia", "best"] = "average"
    """average: of the best point of each segment, the article's; utopia: nearest to it; best: lowest norm"""
    ga: GaSettings = GaSettings()
    nsga2: Nsga2Settings = Nsga2Settings()
    cmaes: CmaesSettings = CmaesSettings()
    pymoo: PymooSettings = PymooSettings()
    multistart: MultistartSettings = MultistartSettings()

    @property
    def name(self) -> str:
        """The algorithm, one of pymoo by its name there."""
        return self.pymoo.algorithm if self.algorithm == "pymoo" else self.algorithm


def _read_arm(value: Any, info: ValidationInfo) -> Any:
    """Read the arm's file where the settings name one."""
    return load_arm(value, (info.context or {}).get("folder")) if isinstance(value, str) else value


class FitSettings(Settings):
    """All that a fit needs besides its logs."""

    stage: Literal["mech", "hyd"] = "mech"
    """mech: the hydraulics are a gain; hyd: the whole chain from command to torque"""
    arm: Annotated[Arm, BeforeValidator(_read_arm)] = Field("hydrolek", validate_default=True)  # pyright: ignore[reportAssignmentType]
    """the arm's YAML: a shipped name, or a path (looked up beside this file first)"""
    outputs: Annotated[tuple[Joint, ...], Field(min_length=1)] = (2,)
    """joints whose measured angle is compared"""
    start_pose: str = "home"
    """the arm's pose in which joints without a measured angle stand"""
    parameters: dict[str, ParameterSettings]
    hydraulics: HydraulicSettings = HydraulicSettings()
    priors: dict[str, PriorSettings] = Field(default_factory=dict[str, PriorSettings])
    """what is known besides the logs, by any name"""
    payloads: dict[str, Annotated[float, Field(gt=0)]] = Field(default_factory=dict[str, float])
    """known mass in the gripper [kg], by a log's file name"""
    log: LogSettings = LogSettings()
    simulation: SimulationSettings = SimulationSettings()
    objective: ObjectiveSettings = ObjectiveSettings()
    search: SearchSettings = SearchSettings()
    refinement: RefinementSettings | None = RefinementSettings()
    """null: none, as in the article"""
    joint_refinement: bool = False
    """then refinement all parameters that have bounds together, those held fixed included"""
    design: DesignSettings = DesignSettings()
    """of `hydroid design`; a fit does not use it"""
    cluster: ClusterSettings = ClusterSettings()
    """of `--dask slurm`; no result depends on it"""

    @model_validator(mode="before")
    @classmethod
    def _named(cls, values: Any) -> Any:
        names = values.get("parameters") if isinstance(values, dict) else None
        if isinstance(names, dict) and not all(isinstance(n, str) and n.isidentifier() for n in names):
            raise ValueError("parameter names must be plain words such as K or M1")
        return values

    @model_validator(mode="after")
    def _of_the_stage(self) -> "FitSettings":
        if len(set(self.outputs)) < len(self.outputs):
            raise ValueError("outputs: a joint stands there twice")
        for name, parameter in self.parameters.items():
            hydraulic = parameter.quantity in QUANTITIES
            if self.stage == "mech" and hydraulic:
                raise ValueError(f"{name}: stage mech has no {parameter.quantity}; set stage: hyd")
            if self.stage == "hyd" and parameter.quantity == "gain":
                raise ValueError(f"{name}: stage hyd has no gain; the hydraulics take its place")
        return self

    def parameter_set(self) -> ParameterSet:
        """Return the parameters with units, bounds and fixed values, in the order of theta."""
        return ParameterSet(tuple(_parameter(name, p) for name, p in self.parameters.items()))

    def freed(self) -> "FitSettings":
        """Return the settings with every parameter free that has bounds, as a joint refinement has them."""
        free = {
            name: p if p.bounds is None else p.model_copy(update={"fixed": None})
            for name, p in self.parameters.items()
        }
        return self.model_copy(update={"parameters": free})


def _parameter(name: str, settings: ParameterSettings) -> Parameter:
    lower, upper = settings.bounds or (settings.fixed or 0.0,) * 2
    return Parameter(name, settings.unit, lower, upper, settings.fixed)
