"""`estimate.yaml`: what a fit found, as plain values; `--json` of a fit prints the
same."""

import math
import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from hydroid.arrays import Array
from hydroid.errors import RunError, SettingsError
from hydroid.files import Plain, is_file, write_atomic, yaml_text
from hydroid.findings import Finding
from hydroid.joint_verdict import JointVerdict
from hydroid.settings.document import read_yaml
from hydroid.settings.load import JointNumber, NotNegative, Positive, Settings, validate

Interval = tuple[float | None, float | None]  # its ends; null: it has no limit there
NAME = "estimate.yaml"  # name of the file in a run folder and beside a saved plant
LARGER = 32
"""times that an estimate may be as large as settings: it has a covariance of all
parameters"""
DESCRIPTION = "run.json"
"""name of the file that describes a run: versions, seed, hashes of its logs and files,
status, seconds"""


class ParameterEstimate(Settings):
    """One parameter of the final estimate.

    A standard deviation or an end of the interval that is unlimited or unknown is null.
    """

    value: float
    unit: str
    sd: float | None = None
    """standard deviation, in the unit of the value"""
    sd_by_log: float | None = None
    """the same from the differences between several logs;
    null where one log alone determines the value"""
    interval: Interval = (None, None)
    """95 % interval"""
    interval_by_log: Interval = (None, None)
    """the same from `sd_by_log`"""
    flag: str | None = None
    """how well the logs determine it: a value of `posterior.uncertainty.Flag`"""
    source: str | None = None
    """from what it is known: a value of `posterior.uncertainty.Source`; null: it is not
    known, or fixed"""
    data_share: float | None = None
    """part of the information that the logs gave: 1 - posterior / prior variance;
    1 without a prior"""
    at_bound: Literal["lower", "upper"] | None = None
    effect_deg: float | None = None
    """rms change of the compared angles when the parameter changes by 1 % [deg]"""


class NamedEstimate(Settings):
    """One of the estimates that a fit compared: null errors where its simulation
    diverged."""

    values: dict[str, float]
    rms_deg: NotNegative | None = None
    """rms error of the compared angles [deg]"""
    objective: float | None = None
    """over the whole record: [deg], or [-] where `objective.relative` is set"""
    gained: tuple[float | None, float | None] | None = None
    """by how much it foretells parts of the logs left out better than the estimate
    without its last term: a difference of log-likelihoods, and its standard error"""


class Covariance(Settings):
    """What is known of the free parameters together:
    C^-1 = G' G per relative change (`Posterior.root`)."""

    parameters: tuple[str, ...]
    """the p free ones"""
    scale: tuple[float, ...]
    """what a relative change of 1 is, in the parameter's unit"""
    root: tuple[tuple[float, ...], ...]
    """G, (p, p): a relative change v is |G v| standard deviations long"""
    quantile: float
    """half a 95 % interval, in standard deviations"""

    @model_validator(mode="after")
    def _square(self) -> "Covariance":
        sizes = {len(self.scale), len(self.root), *map(len, self.root)}
        if sizes != {len(self.parameters)}:
            raise ValueError(
                "root must have a row and a column, and scale a value, for each of parameters"
            )
        return self


class QuantityEstimate(Settings):
    """One quantity that follows from the parameters, with what the fit knows of it."""

    label: str
    """in plain words"""
    joint: int
    """numbered from 1"""
    value: float
    unit: str
    sd: float | None = None
    """standard deviation, in the unit of the value; null: not determined"""
    interval: Interval = (None, None)
    """95 % interval"""
    reach: float | None = None
    """largest command of the logs in its direction [%], where it is of a larger one;
    null: the logs have its command"""
    data_share: float | None = None
    """part of the information that the logs gave; the rest is the priors'"""

    @property
    def said(self) -> str:
        """The label, and that the quantity is extrapolated if it is."""
        if self.reach is None:
            return self.label
        return f"{self.label} (extrapolated: the logs reach {self.reach:.0f} %)"

    @property
    def within(self) -> float:
        """Half of the 95 % interval relative to the value;
        infinite where the interval has no limit."""
        low, high = self.interval
        if low is None or high is None or self.value == 0:
            return math.inf
        return abs((high - low) / (2 * self.value))


class CurveEstimate(Settings):
    """A quantity against a command or an angle;
    `value` and `interval` are at the points of `at`."""

    label: str
    joint: int
    unit: str
    along: str
    """what `at` is, with its unit"""
    at: tuple[float, ...]
    value: tuple[float, ...]
    interval: tuple[Interval, ...]
    """95 % interval at each point by itself"""
    step: float | None = None
    """command [%] whose step it answers; null: it answers none"""
    moves: str = ""
    """what that command does with the joint's weight, raising or lowering, or with a
    joint that slides, extending or retracting; empty where it does neither"""


def _finding(value: Any) -> Any:
    """Return a finding from a mapping: files have no dataclasses."""
    try:
        if isinstance(value, dict):
            return Finding(**value)
        return value
    except TypeError:
        raise ValueError("is no finding") from None


class AngleError(Settings):
    """The error model of one angle (`posterior.error_model`)."""

    sensor_deg: NotNegative
    """standard deviation of the sensor's noise [deg]"""
    drift_per_s: NotNegative
    """growth of the drift's variance with time [deg²/s]"""
    drift_per_way: NotNegative
    """growth of the drift's variance with the way travelled [deg²/deg]"""
    lasting_deg: NotNegative
    """standard deviation of an error that lasts for a moment [deg]"""
    lasting_s: Positive
    """time constant of that error [s]"""
    after_10_s_deg: NotNegative
    """standard deviation of a prediction 10 s ahead, whatever the parameters,
    at the logs' mean speed [deg]
    """
    lasts_s: NotNegative = 0.0
    """time for which what is left of the error lasts [s]; 0: it is as the error model
    says"""

    def change_deg(self, seconds: float) -> float:
        """Return the standard deviation of how far the angle seems to move in a time
        beyond what is predicted, whatever the parameters, at the logs' mean speed [deg].

        The sensor's noise is in it at both ends.
        """
        noise = self.sensor_deg**2
        lasting = self.lasting_deg**2
        # `after_10_s_deg` has noise, lasting error and drift, each once
        drift = max(self.after_10_s_deg**2 - noise - lasting, 0.0)
        gone = 1.0 - math.exp(-seconds / self.lasting_s)
        variance = 2.0 * noise + 2.0 * lasting * gone + drift * seconds / 10.0
        return math.sqrt(variance)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers of the error model in rad and s."""
        degree = math.radians(1.0)
        return (
            (degree * self.sensor_deg) ** 2,
            degree**2 * self.drift_per_s,
            degree * self.drift_per_way,
            (degree * self.lasting_deg) ** 2,
            self.lasting_s,
        )


class FitSummary(Settings):
    """The final estimate of a fit, and the estimates that it was chosen from."""

    version: Literal[1] = Field(default=1, alias="schema")
    stage: Literal["mech", "hyd"]
    estimate: dict[str, ParameterEstimate]
    """by parameter"""
    joints: tuple[JointNumber, ...] = ()
    """joints that take commands, numbered from 1:
    those that the fit's logs drive or that it compared"""
    final: str | None = None
    """name of the final one among `estimates`; `joint`: a joint refinement of both
    stages"""
    converged: bool | None = None
    """whether every refinement converged; null: there was none"""
    ending: str | None = None
    """why the last refinement ended"""
    rms_deg: float | None = None
    """rms error of the compared angles on the fitted logs [deg]"""
    seed: int | None = None
    """of the search"""
    simulations: int | None = None
    """of the search"""
    diverged: int | None = None
    """simulations of the search that diverged"""
    findings: tuple[Annotated[Finding, BeforeValidator(_finding)], ...] = ()
    """what to know before using the estimate, the most important first
    (`hydroid.findings`)"""
    verdict: tuple[JointVerdict, ...] = ()
    """of each compared joint on the fitted logs; the page of a run adds the unseen
    logs"""
    estimates: dict[str, NamedEstimate] = {}
    """by name; the first is the search's own"""
    tried: dict[str, tuple[float | None, float | None] | None] = {}
    """what terms gained, as `gained` of an estimate: of a single joint on that joint
    alone, or where it was dropped of all joints together; null: it was not refined, as
    it promised too little or noise alone was left"""
    quantities: dict[str, QuantityEstimate] = {}
    """what follows from the final estimate, by name"""
    curves: dict[str, CurveEstimate] = {}
    """the same against a command or an angle"""
    covariance: Covariance | None = None
    """of the final estimate"""
    errors: dict[str, AngleError] = {}
    """what the residuals of each compared angle show of its error, by angle: `q2` of
    joint 2"""
    left_out_deg: dict[str, tuple[float, ...]] = {}
    """rms error of each compared angle on each fitted log if it is left out [deg];
    none of one log"""

    @property
    def values(self) -> dict[str, float]:
        """The final estimate by name."""
        return {name: parameter.value for name, parameter in self.estimate.items()}

    def plain(self) -> Plain:
        """Return mappings, lists, text and numbers, as YAML and JSON hold them."""
        return self.model_dump(mode="json", by_alias=True)


def write_estimate(folder: Path, summary: FitSummary) -> None:
    """Write `estimate.yaml`."""
    # one line a list
    write_atomic(
        folder / NAME, yaml_text(summary.plain(), default_flow_style=None, width=110)
    )


def read_estimate(source: Path) -> tuple[Path, Plain, FitSummary | None]:
    """Read parameter values by name: of a folder, an `estimate.yaml`, or a YAML file of
    `K: 0.2` lines.

    Returned are the file, its values, unchecked where they are not an estimate's, and
    the estimate where there is one.

    Raises:
        RunError: a folder that holds no estimate. SettingsError: a file that is none.
    """
    file = source
    if os.path.isdir(source):
        file = _estimate_in(source)
    content, lines = read_yaml(file, LARGER)
    if "estimate" in content:
        summary = validate(content, FitSummary, str(file), lines)
        return file, summary.values, summary
    values = content.get("parameters", content)
    is_flat = isinstance(values, dict) and not any(
        isinstance(v, dict) for v in values.values()
    )
    if not is_flat:
        hint = (
            "give the run folder, its estimate.yaml, or a YAML file of `K: 0.2` lines"
        )
        raise SettingsError("is no estimate", file, hint)
    return file, values, None


def _estimate_in(folder: Path) -> Path:
    """Return the file of the estimate in a folder."""
    file = folder / NAME
    if is_file(file):
        return file
    if is_file(folder / DESCRIPTION):
        raise RunError("holds no estimate yet", folder, "resume the fit")
    hint = "give a run folder, a folder that Plant.save wrote, or a YAML file of values"
    raise RunError("holds no estimate", folder, hint)


def finite_ends(interval: Array) -> Interval:
    """Return the ends of an interval, shape (2,), or None for one without a limit."""
    return finite(interval[0]), finite(interval[1])


def finite(value: float | None) -> float | None:
    """Return a number, or None where it is infinite or NaN, which JSON has no word
    for."""
    if value is None or not math.isfinite(value):
        return None
    return float(value)
