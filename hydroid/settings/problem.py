"""What a fit estimates, simulates and compares: parameters, priors, the simulation, and the objectives."""

import difflib
import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from hydroid.quantity_table import CHOICES, MECHANICAL
from hydroid.settings.load import ByJoint, Joints, NotNegative, Positive, Settings


class ParameterSettings(Settings):
    """One parameter: what it is in the model, where it acts, what is known of it, or the value it is held at.

    parameters:
      A_A: {quantity: area_a, joints: [2], within: 2}                  # around the value of the arm's file
      M3:  {quantity: mass, link: link3, nominal: 20, sd: 1}           # weighed
      D:   {quantity: damping, each: true, bounds: [20, 5000]}         # D_boom, D_arm, ... of compared joints
      M:   {quantity: mass, each: true, within: 2}                     # M_link1, M_link2, ... of all links
      C:   {quantity: curve_a, joints: [2]}                            # C_1 to C_4, and a prior C
    """

    quantity: str
    """gain, damping, stiffness, friction or mass; in stage 2 also any quantity of `hydraulics` and area_a,
    area_b, opening_a, opening_b, pivot_distance_1, pivot_distance_2, pivot_angle. curve_a, curve_b, or curve
    for both: the factors NAME_1 to NAME_4 of the valve's curve, curve_1 to curve_4, whose `start` is a list;
    they get bounds, and a prior NAME: smooth, of this `sd` (0.3)"""
    joints: Joints | None = None
    """joints that share the parameter; null: all"""
    each: bool | Joints = False
    """joints that have a parameter each, NAME_boom, NAME_arm, ...; true: those that are compared. With one
    joint the name stays as it is. Entries under NAME_boom change the boom's. Of a mass: links; true: all"""
    link: str | None = None
    """link whose mass the parameter is"""
    bounds: tuple[float, float] | None = None
    """lower and upper bound, in the unit of the quantity; null: four standard deviations of the prior"""
    nominal: float | None = None
    """expected value, in the unit of the quantity; null: what `hydraulics` or the arm's file says"""
    within: Annotated[float, Field(gt=1)] | None = None
    """log-normal prior: 95 % lie between nominal / within and nominal * within"""
    sd: Positive | None = None
    """Gaussian prior: standard deviation around nominal, in the unit of the quantity"""
    start: float | None = None
    """where the search starts; null: nominal, else the middle of the bounds on the parameter's scale"""
    fixed: float | None = None
    """value at which the parameter is held, in the unit of the quantity; null: it is estimated"""
    per: str | None = None
    """group: an effect of each group of `log.groups`, NAME_monday, ..., which is added to the quantity in its
    logs, around 0 with standard deviation `sd`, and one of all other logs, NAME_other: an unseen day is
    predicted with the mean, and a wider band. The name of a group, or other: an effect of that one"""
    term: Annotated[str, Field(pattern="^[A-Za-z_]+$")] | None = None
    """name of a term of the model, of one parameter or several: a fit begins without it, adds it after the
    refinement, and keeps it where it lowers the error on parts of the logs left out by 5 %; null: always
    there"""

    @model_validator(mode="after")
    def _consistent(self) -> "ParameterSettings":
        if self.quantity not in CHOICES:
            near = difflib.get_close_matches(self.quantity, CHOICES, n=3, cutoff=0.4) or MECHANICAL
            raise ValueError(f"no quantity {self.quantity!r}; did you mean {' or '.join(map(repr, near))}?")
        row, mass = CHOICES[self.quantity], self.quantity == "mass"
        placed = self.joints is not None or self.each
        least = row.lowest if self.per is None else -math.inf
        low, high = self.bounds or (least, math.inf)
        starts = [(n, v) for n, v in (("nominal", self.nominal), ("start", self.start)) if v is not None]
        fixed = () if self.fixed is None else (self.fixed,)
        lowest = min((*(self.bounds or ()), *(v for _, v in starts), *fixed), default=1.0)
        refusals = [
            (mass != (self.link is not None), "a mass names its link, and only a mass does"),
            (row.of_the_pump and placed, f"all joints share the pump: a {self.quantity} has no joints"),
            (mass and placed, "a mass belongs to a link, not to joints"),
            (
                self.per is not None and (self.sd is None or mass),
                "an effect per group needs sd: standard deviation, around 0, and is no mass",
            ),
            (
                self.within is not None and self.sd is not None,
                "give within: factor or sd: standard deviation, not both",
            ),
            (
                not (self.can_be_free or fixed),
                "needs bounds: [lower, upper], a prior (within: factor), or fixed: value",
            ),
            (low >= high, "bounds must be [lower, upper] with lower < upper"),
            (mass and lowest <= 0, "a mass must be above 0 kg"),
            (lowest < least, f"a {self.quantity} cannot be {f'below {least:g}' if least else 'negative'}"),
            *((not low <= v <= high, f"{name} {v:g} lies outside the bounds") for name, v in starts),
        ]
        for wrong, message in refusals:
            if wrong:
                raise ValueError(message)
        return self

    @property
    def unit(self) -> str:
        """The unit of the quantity."""
        return CHOICES[self.quantity].unit

    @property
    def has_prior(self) -> bool:
        """Whether something besides the bounds is known of its value."""
        return self.within is not None or self.sd is not None

    @property
    def can_be_free(self) -> bool:
        """Whether it can be estimated: it has bounds, or a prior that gives them."""
        return self.bounds is not None or self.has_prior

    @property
    def states_start(self) -> bool:
        """Whether it says where a search starts."""
        return self.has_prior or self.nominal is not None or self.start is not None


class PriorSettings(Settings):
    """A prior on a combination of parameters; without a standard deviation it is an exact constraint.

    priors:
      total mass: {of: [M1, M2, M3, M4, M5, M6], value: 42.5, sd: 0.5}   # their sum
      forearm:    {of: M5, value: 4.0, sd: 0.4}                          # a Gaussian prior
      balance:    {of: {M3: 1, M4: -2}, value: 0, sd: 0.5}               # M3 - 2 M4
      areas:      {ratio: [A_A, A_B], value: 1.333}                      # A_A / A_B
      spool:      {of: {dead_A: 1, dead_B: -1}, value: 0, sd: 5, tails: heavy}    # alike, or not at all
      curve:      {smooth: [curve_1, curve_2, curve_3, curve_4], sd: 0.3}         # no bend without a reason
    """

    of: str | tuple[str, ...] | dict[str, float] | None = None
    """a parameter, a list of parameters whose sum is meant, or a mapping of parameters to their factors"""
    ratio: tuple[str, str] | None = None
    """two parameters: the ratio of the first to the second is meant"""
    smooth: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """positive parameters, such as the factors of a valve's curve: the ratios of neighbours, and the last
    one, are 1 but for a scatter of their logarithms of about `sd`, which the logs may show to be much less
    or much more"""
    value: float | None = None
    """value of the combination, in the unit of the parameters; of `smooth` there is none"""
    sd: Positive | None = None
    """standard deviation of the value; null: the constraint is exact"""
    tails: Literal["normal", "heavy"] = "normal"
    """heavy: the value may also be many standard deviations off, if the logs say so: Student's t with 2
    degrees of freedom, of scale sd, in place of a normal distribution"""

    @model_validator(mode="after")
    def _one(self) -> "PriorSettings":
        given = [one for one in (self.of, self.ratio, self.smooth) if one is not None]
        if len(given) != 1:
            raise ValueError(
                "give either of: parameter, [parameters] or {parameter: factor}, or ratio: [a, b], "
                "or smooth: [parameters]"
            )
        if (self.smooth is None) == (self.value is None):
            raise ValueError("has no value" if self.smooth else "needs a value")
        if self.sd is None and (self.smooth or self.tails == "heavy"):
            raise ValueError("needs sd: without one it is exact")
        if not self.smooth and not any(self.factors.values()):
            raise ValueError("names no parameter")
        return self

    @property
    def factors(self) -> dict[str, float]:
        """Parameters with their factors; of a ratio those of a - value b, which is 0 where it holds.

        Of `smooth` there are none.
        """
        if self.ratio is not None:
            return {self.ratio[0]: 1.0, self.ratio[1]: -(self.value or 0.0)}
        if isinstance(self.of, str):
            return {self.of: 1.0}
        return self.of if isinstance(self.of, dict) else dict.fromkeys(self.of or (), 1.0)


def _name_infinity(value: Any) -> Any:
    """Accept YAML's own infinity, `.inf`; refuse true, which equals 1."""
    if isinstance(value, bool):
        raise ValueError("must be 1, 2 or 'inf'")
    return "inf" if isinstance(value, float) and value == math.inf else value


class ObjectiveSettings(Settings):
    """Norm of the output error, equations (18) and (19), and the segments of equation (21)."""

    norm: Annotated[Literal[1, 2, "inf"], BeforeValidator(_name_infinity)] = "inf"
    """p of the norm: 1, 2 or inf (the article's choice, table 5)"""
    relative: bool = False
    """divide by the norm of the measured output of the same segment, equation (19)"""
    segments: Annotated[int, Field(ge=1, le=10_000)] = 8
    """number of segments of equal length, one objective each"""
    weights: ByJoint[Positive] = {}
    """factor on the error of a joint's angle, by joint, in the searches and in stage 1; 1 for joints that are
    not listed. The refinement of stage 2 weighs each joint by its own error (docs/uncertainty.md)"""
    pressure_weight: NotNegative = 0.0
    """stage 2: factor that turns a chamber pressure's error into an angle's in the searches [deg/bar]; 0:
    angles only. Above 0 the refinement compares pressures, too, and weighs them by their own errors"""
    noise_deg: Positive | ByJoint[Positive] | None = None
    """standard deviation of the sensor's noise of measured angles, for all joints or by joint [deg]; null: it
    is estimated from the residuals. The other parts of an error, such as drift, are always estimated"""

    def noise_of(self, joint: int) -> float | None:
        """Return the stated noise of a joint's angle [deg]."""
        return self.noise_deg.get(joint) if isinstance(self.noise_deg, dict) else self.noise_deg


class SimulationSettings(Settings):
    """How logs are simulated."""

    model: Literal["dynamic", "quasi-static", "ladder"] = "dynamic"
    """of stage 2. dynamic: oil stiffness, inertia and stops; quasi-static: speed follows valve and load at
    once, one step a sample; ladder: a fit searches and refines the quasi-static model, then refines the
    dynamic one from there, and keeps it where it is clearly nearer to the logs"""
    other_joints: Literal["locked", "passive", "measured"] = "locked"
    """how to treat joints that have no command in the log and are not compared. locked: they stand still,
    which is the fastest; passive: they move on their own spring and damper, as in the article; measured:
    they follow their logged motion"""
    steps_per_sample: Annotated[int, Field(ge=1, le=100)] = 1
    """MuJoCo steps per sample of the log; in the quasi-static model only the valves have so many"""
    threads: Annotated[int, Field(ge=0, le=1024)] = 0
    """number of threads. 0 means one per core; with --dask it means one per worker"""
    measured_cutoff_hz: Annotated[float, Field(gt=0, le=50)] = 4.0
    """cutoff of the low-pass filter on motion that joints follow [Hz]; its second derivative becomes a
    torque"""

    @property
    def steps(self) -> int:
        """Steps of the model in one sample of the log."""
        return self.steps_per_sample if self.model == "dynamic" else 1
