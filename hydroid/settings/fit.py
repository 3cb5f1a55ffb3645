"""Settings of a fit, one YAML file per job, from the log to the search; and of a study,
which vary them."""

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from itertools import product, starmap
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, model_validator

from hydroid.errors import HydroidError, SettingsError
from hydroid.files import Plain, find_config
from hydroid.parameters import ParameterSet
from hydroid.quantity_table import TARGETS
from hydroid.rungs import (
    BY_COMMAND,
    RUNGS,
    WITHOUT_EFFECT,
    Rung,
    Stage,
    Stepping,
    rungs_of,
    stage_has,
)
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.expansion import by_group, expanded, with_curves
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.load import ByJoint, Joints, Positive, Settings, load, validate
from hydroid.settings.log import WITH_INPUT, LogSettings, log_file
from hydroid.settings.parameters import make_parameter
from hydroid.settings.problem import (
    ObjectiveSettings,
    ParameterSettings,
    PriorSettings,
    SimulationSettings,
)
from hydroid.settings.search import DesignSettings, RefinementSettings, SearchSettings

STAGE_HINTS: dict[Stage, str] = {
    "mech": "set stage: hyd",
    "hyd": "the hydraulics take its place",
}
"""what to do about a quantity that a stage lacks"""


class FitSettings(Settings):
    """All that a fit needs besides its logs."""

    stage: Stage = "mech"
    """mech: the hydraulics are a gain; hyd: the whole chain from command to torque is
    simulated"""
    arm: Arm = "hydrolek"  # pyright: ignore[reportAssignmentType]
    """name of a shipped arm, or path of an arm's YAML file,
    relative to this file or to the working folder"""
    outputs: Annotated[Joints, Field(min_length=1)] = (2,)
    """joints whose measured angle is compared"""
    tolerance_deg: Positive | ByJoint[Positive] | None = None
    """rms error on unseen logs up to which joints are predicted [deg], of all or by
    joint; null: 2 % of their travel there"""
    start_pose: str = "home"
    """name of the arm's pose that joints without a measured angle hold"""
    free_start: bool = True
    """whether simulated angles may begin beside the truth, as far as the sensor's noise
    in the rest before the first command allows: the drift of the errors begins as
    uncertain as that. false: it is exact"""
    parameters: dict[str, ParameterSettings]
    """the parameters of the model by name, those to be estimated and those that are
    fixed"""
    scale: Literal["log", "linear"] = "log"
    """log: parameters with a lower bound above 0 are searched, refined and reported by
    their logarithm; linear: by their value, as in equations (15) and (16)"""
    hydraulics: HydraulicSettings = HydraulicSettings()
    priors: dict[str, PriorSettings] = {}
    """what is known besides the logs, each under a name of your choice"""
    payloads: dict[str, Positive] = {}
    """mass that the arm carries at its tip, by the log's file name, or the end of its
    path where several have one name, as in {day2/log.csv: 250} [kg]"""
    log: LogSettings = LogSettings()
    simulation: SimulationSettings = SimulationSettings()
    objective: ObjectiveSettings = ObjectiveSettings()
    search: SearchSettings = SearchSettings()
    refinement: RefinementSettings | None = RefinementSettings()
    """the refinement's settings; null: no refinement, as in the article"""
    joint_refinement: bool = False
    """at the end, refine the parameters of both stages together: all that have bounds,
    fixed ones included"""
    design: DesignSettings = DesignSettings()

    def payload_name(self, log: str) -> str | None:
        """Return the name in `payloads` that a log's path ends with, the longest of
        several; None: its gripper is empty."""
        parts = log_file(log).parts
        named = [
            name
            for name in self.payloads
            if Path(name).parts == parts[-len(Path(name).parts) :]
        ]
        return max(named, key=lambda name: len(Path(name).parts), default=None)

    def payload_of(self, log: str) -> float:
        """Return the mass that the gripper holds in a log [kg]."""
        name = self.payload_name(log)
        if name is None:
            return 0.0
        return self.payloads[name]

    def parameters_of(self, quantity: str) -> tuple[str, ...]:
        """Return the parameters that set a quantity of every joint with an actuator;
        none if what the settings say counts for some joint."""
        joints = self.arm.joints
        # joints for which nothing has been found to set it
        open_joints = {n for n, joint in enumerate(joints, 1) if joint.actuator}
        found = list[str]()
        for name, parameter in self.parameters.items():
            if quantity in TARGETS[parameter.quantity] and parameter.per is None:
                found.append(name)
                open_joints -= {*(parameter.joints or open_joints)}
        if open_joints:
            return ()
        return tuple(found)

    @classmethod
    def names_of_joints(cls, values: Plain, folder: Path) -> tuple[str, ...]:
        """Return the names of the arm's joints; empty where no arm can be read."""
        arm = values.get("arm", cls.model_fields["arm"].default)
        if not isinstance(arm, str):
            return ()
        try:
            return load_arm(arm, folder).joint_names
        except HydroidError:
            return ()

    @model_validator(mode="before")
    @classmethod
    def _named(cls, values: Any, info: ValidationInfo) -> Any:
        """Find the arm first: joints and links may be given by its names."""
        if not isinstance(values, dict):
            return values
        parameters = values.get("parameters")
        if isinstance(parameters, dict):
            _check_names(parameters)
        context = info.context or {}
        arm = cls._arm_of(values, context.get("folder"))
        # the context carries the arm to the validators of joints, which turn names into
        # numbers
        context["arm"] = arm if isinstance(arm, Arm) else None
        if isinstance(parameters, dict):
            compared = values.get("outputs", cls.model_fields["outputs"].default)
            entries = expanded(parameters, compared, context["arm"])
            entries = by_group(entries, _groups(values.get("log")))
            entries, priors = with_curves(entries, values.get("priors"))
            values = {**values, "parameters": entries}
            if priors is not None:
                values["priors"] = priors
        return {**values, "arm": arm}

    @classmethod
    def _arm_of(cls, values: Plain, folder: Path | None) -> Any:
        """Return the arm that values of settings name or hold; anything else as it
        stands."""
        arm = values.get("arm", cls.model_fields["arm"].default)
        if isinstance(arm, str):
            return load_arm(arm, folder)
        if isinstance(arm, dict):
            return validate(arm, Arm, "arm", folder=folder)
        return arm

    @model_validator(mode="after")
    def _of_the_stage(self) -> "FitSettings":
        if self.joint_refinement and len(self.rungs) > 1:
            raise ValueError(
                "joint_refinement: refines one model; set simulation.model to it"
            )
        for name, parameter in self.parameters.items():
            quantity = parameter.quantity
            if not stage_has(self.stage, quantity):
                hint = STAGE_HINTS[self.stage]
                raise ValueError(
                    f"parameters.{name}: stage {self.stage} has no {quantity}; {hint}"
                )
            told_by = WITH_INPUT.get(quantity)
            if told_by and self.log.condition(told_by) is None:
                raise ValueError(
                    f"parameters.{name}: {quantity} needs the column log.{told_by}"
                )
        chosen = [p for p in self.parameters.values() if p.quantity == BY_COMMAND]
        terms = [parameter.term for parameter in chosen if parameter.term]
        if len({*terms}) < len(terms):
            raise ValueError(
                f"parameters: each {BY_COMMAND} with a term needs one of its own"
            )
        # this raises where a parameter cannot be made
        self.parameter_set()
        return self

    @property
    def rungs(self) -> tuple[Rung, ...]:
        """The models that a fit climbs, from the poorest to the richest."""
        return rungs_of(self.stage, self.simulation.model)

    @property
    def rung(self) -> Rung:
        """The model that is simulated: of several the first."""
        return self.rungs[0]

    @property
    def stepping(self) -> Stepping:
        """How finely the model steps."""
        return self.rung.stepping(
            self.simulation.steps_per_sample, self.hydraulics.substeps
        )

    @property
    def seeded(self) -> bool:
        """Whether another seed may lead a search elsewhere:
        not one that begins at stated starts alone."""
        if not self._states_start:
            return True
        return (
            self.search.algorithm != "multistart" or self.search.multistart.starts > 1
        )

    @property
    def _states_start(self) -> bool:
        """Whether any parameter that is estimated says where a search starts."""
        return any(p.states_start for p in self.parameters.values() if p.fixed is None)

    def terms(self, rung: Rung | None = None) -> tuple[str, ...]:
        """Names of the terms that a fit may add, in the order of the parameters; of a
        rung those alone that have an effect there.

        Those of `by_command_terms` are none of them: nothing of these is estimated.
        """
        names = (
            parameter.term
            for parameter in self.parameters.values()
            if parameter.term is not None
            and parameter.quantity != BY_COMMAND
            and (rung is None or rung.has(parameter.quantity))
        )
        return tuple(dict.fromkeys(names))

    def terms_of(self, joint: int) -> tuple[str, ...]:
        """Names of the terms whose parameters act on one joint each, numbered from 1,
        and some of them on this one: what the joint has of them can be fitted alone."""
        owners = dict[str, set[tuple[int, ...] | None]]()
        for parameter in self.parameters.values():
            if parameter.term is not None and parameter.quantity != BY_COMMAND:
                owners.setdefault(parameter.term, set()).add(parameter.joints)
        return tuple(
            term
            for term, joints in owners.items()
            if (joint,) in joints and all(one and len(one) == 1 for one in joints)
        )

    @property
    def by_command_terms(self) -> dict[str, int]:
        """Names of the terms by which the speed of one joint follows its command alone,
        and that joint, numbered from 1."""
        return {
            parameter.term: joint
            for parameter in self.parameters.values()
            if parameter.quantity == BY_COMMAND and parameter.term is not None
            for joint in parameter.joints or ()
        }

    def is_by_command(self, joint: int) -> bool:
        """Return whether the speed of a joint, numbered from 1, follows its command
        alone in the model that is simulated."""
        value = getattr(self.hydraulics, BY_COMMAND)
        for parameter in self.parameters.values():
            is_here = joint in (parameter.joints or (joint,))
            if is_here and parameter.quantity == BY_COMMAND:
                value = parameter.fixed
        return self.rung.has(BY_COMMAND) and (value or 0.0) >= 0.5

    def ignores(self, quantity: str, joint: int) -> bool:
        """Return whether a quantity has no effect on a joint, numbered from 1, because
        its speed follows its command alone."""
        return WITHOUT_EFFECT.issuperset(TARGETS[quantity]) and self.is_by_command(
            joint
        )

    def of_estimate(self, name: str | None) -> "FitSettings":
        """Return the settings that an estimate of a fit was refined with, and predicts
        with.

        `name` is that of the estimate, then those of the terms that it has:
        refined+pump; None: no fit's.
        """
        if name is None:
            return self
        model, *terms = name.split("+")
        settings = self
        # a joint refinement frees what the search had fixed
        if model == "joint":
            settings = self._all_free()
        if model in RUNGS:
            settings = settings.on(RUNGS[model])
        return settings._with_terms(terms)

    def on(self, rung: Rung) -> "FitSettings":
        """Return the settings of one rung of their stage alone."""
        if self.rungs == (rung,):
            return self
        return self.changed({"simulation.model": rung.name})

    def _all_free(self) -> "FitSettings":
        """Return the settings with every parameter free that can be."""
        changed = {
            name: parameter.changed({"fixed": None})
            for name, parameter in self.parameters.items()
            if parameter.can_be_free
        }
        return self.with_parameters(changed)

    def _with_terms(self, terms: Collection[str]) -> "FitSettings":
        """Return the settings without the parameters of all other terms, and without
        those that then have no effect, as the speed of their joints follows the
        commands alone."""
        others = {
            name
            for name, parameter in self.parameters.items()
            if parameter.term is not None and parameter.term not in terms
        }
        settings = self._without(others)
        idle = {
            name
            for name, parameter in settings.parameters.items()
            if parameter.joints
            and all(settings.ignores(parameter.quantity, j) for j in parameter.joints)
        }
        return settings._without(idle)

    def _without(self, names: set[str]) -> "FitSettings":
        """Return the settings without some parameters, and the priors on these."""
        if not names:
            return self
        kept = {
            name: parameter
            for name, parameter in self.parameters.items()
            if name not in names
        }
        priors = {
            name: prior
            for name, prior in self.priors.items()
            if names.isdisjoint(prior.names)
        }
        return self.changed({"parameters": kept, "priors": priors})

    def parameter_set(self) -> ParameterSet:
        """Return the parameters with units, bounds, priors and fixed values,
        in the order of theta."""
        log_scale = self.scale == "log"
        parameters = [
            make_parameter(
                name, settings, self.arm, self.hydraulics, log_scale=log_scale
            )
            for name, settings in self.parameters.items()
        ]
        if not self._states_start:
            # nominal values alone are no start: the search draws its own
            parameters = [replace(parameter, start=None) for parameter in parameters]
        return ParameterSet(tuple(parameters))

    def with_parameters(
        self, changed: Mapping[str, ParameterSettings]
    ) -> "FitSettings":
        """Return the settings with parameters changed, or further ones behind their
        own."""
        return self.changed({"parameters": self.parameters | dict(changed)})

    def acting_on(self, joint: int) -> set[str]:
        """Return the names of the free parameters that act on this joint only."""
        return {
            name
            for name, parameter in self.parameters.items()
            if parameter.fixed is None and parameter.joints == (joint,)
        }

    def alone(self, joint: int, values: Mapping[str, float]) -> "FitSettings":
        """Return the settings of one joint's own parameters, the others held at values
        by name.

        Joints that are not compared then follow their logged motion.
        """
        free = self.acting_on(joint)
        held = dict[str, ParameterSettings]()
        for name, parameter in self.parameters.items():
            # masses and the pump, too: one joint does not tell them
            if name not in free:
                held[name] = parameter.changed({"fixed": values[name]})
        changes = {"outputs": (joint,), "simulation.other_joints": "measured"}
        return self.with_parameters(held).changed(changes)


def _check_names(parameters: Mapping[Any, Any]) -> None:
    """Raise ValueError where a parameter's name cannot be used in tables and by
    `--set`."""
    for name in parameters:
        if not isinstance(name, str) or not name.isidentifier():
            raise ValueError("parameter names must be plain words such as K or M1")


def _groups(log: Any) -> Collection[str]:
    """Return the names of the groups of logs,
    of the settings of logs as YAML or Python gives them."""
    groups = (
        log.get("groups") if isinstance(log, dict) else getattr(log, "groups", None)
    )
    return groups if isinstance(groups, dict) else ()


MOST_CELLS = 100_000  # of a study
Changes = dict[str, Any]  # settings to replace, by dotted key, as `--set` has them


class StudySettings(Settings):
    """A study."""

    title: str
    """what it answers"""
    base: str
    """settings of a fit: a shipped name, or a YAML file relative to the study's file"""
    set: Changes = {}
    """settings to replace in every cell, by dotted key"""
    logs: Annotated[tuple[str, ...], Field(min_length=1)]
    """fitted logs, relative to the study's file"""
    axes: dict[
        str, Annotated[dict[str, Changes] | tuple[Any, ...], Field(min_length=1)]
    ] = {}
    """what varies: a dotted key with a list of values, or a name with cells: {label:
    {key: value, ...}}"""
    seeds: Annotated[int, Field(ge=0, le=10_000)] = 10
    """number of seeds, from 1"""

    def changes(self) -> dict[str, Changes]:
        """Return the settings that each cell replaces, by the cell's name."""
        if math.prod(map(len, self.axes.values())) > MOST_CELLS:
            raise SettingsError(
                f"make more than {MOST_CELLS} cells", "axes", "leave some out"
            )
        cells = dict[str, Changes]()
        for choice in product(*starmap(_options, self.axes.items())):
            name = ", ".join(label for label, _ in choice) or "all"
            cells[name] = {}
            for _, change in choice:
                cells[name] |= change
        return cells


def _options(
    key: str, axis: Mapping[str, Changes] | tuple[Any, ...]
) -> list[tuple[str, Changes]]:
    """Return the cells along an axis of a study: their labels,
    and the settings that they replace."""
    if isinstance(axis, Mapping):
        return [*axis.items()]
    return [(f"{key} {value}", {key: value}) for value in axis]


def cell_settings(
    study: StudySettings, path: Path, extra: Changes | None = None
) -> dict[str, FitSettings]:
    """Return the settings of a fit of every cell, with `extra` ones replaced,
    by the cell's name."""
    config = find_config(study.base, path.parent)
    try:
        return {
            name: load(config, FitSettings, study.set | changes | (extra or {}))
            for name, changes in study.changes().items()
        }
    except SettingsError as error:
        where = error.where.replace("--set", f"{path}:")
        raise SettingsError(error.what, where, error.hint) from None
