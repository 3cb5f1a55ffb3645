"""What a fit estimates, simulates and compares: parameters, priors, the simulation,
and the objectives."""

import difflib
import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from hydroid.arrays import Limits
from hydroid.quantity_table import CHOICES, MECHANICAL
from hydroid.rungs import BY_COMMAND, Climb
from hydroid.settings.load import ByJoint, Joints, NotNegative, Positive, Settings


class ParameterSettings(Settings):
    """One parameter: what it is in the model, where it acts, what is known of it,
    or the value it is held at.

    parameters:
      A_A: {quantity: area_a, joints: [2], within: 2}           # around the value of the arm's file
      M3:  {quantity: mass, link: link3, nominal: 20, sd: 1}    # weighed
      D:   {quantity: damping, each: true, bounds: [20, 5000]}  # D_boom, ... of compared joints
      M:   {quantity: mass, each: true, within: 2}              # M_link1, M_link2, ... of all links
      C:   {quantity: curve_a, joints: [2]}                     # C_1 to C_4, and a prior C
    """

    quantity: str
    """gain, damping, stiffness, friction or mass; in stage 2 also any quantity of
    `hydraulics` and area_a, area_b, opening_a, opening_b, pivot_distance_1,
    pivot_distance_2, pivot_angle. curve_a, curve_b, or curve for both: the factors
    NAME_1 to NAME_4 of the valve's curve, curve_1 to curve_4, whose `start` is a list;
    they get bounds, and a prior NAME: smooth, of this `sd` (0.3)"""
    joints: Joints | None = None
    """joints that share the parameter; null: all"""
    each: bool | Joints = False
    """joints that have a parameter each, NAME_boom, NAME_arm, ...; true: those that are
    compared. With one joint the name stays as it is. Entries under NAME_boom change the
    boom's. Of a mass: links; true: all"""
    link: str | None = None
    """link whose mass the parameter is"""
    bounds: Limits | None = None
    """lower and upper bound, in the unit of the quantity; null:
    four standard deviations of the prior, as far as the quantity can be so"""
    nominal: float | None = None
    """expected value, in the unit of the quantity; null:
    what `hydraulics` or the arm's file says"""
    within: Annotated[float, Field(gt=1)] | None = None
    """log-normal prior: 95 % lie between nominal / within and nominal * within"""
    sd: Positive | None = None
    """Gaussian prior: standard deviation around nominal, in the unit of the quantity"""
    start: float | None = None
    """where the search starts; null: nominal,
    else the middle of the bounds on the parameter's scale"""
    fixed: float | None = None
    """value at which the parameter is held, in the unit of the quantity; null: it is
    estimated"""
    per: str | None = None
    """group: an effect of each group of `log.groups`, NAME_monday, ..., which is added
    to the quantity in its logs, around 0 with standard deviation `sd`, and one of all
    other logs, NAME_other: an unseen day is predicted with the mean, and a wider band.
    The name of a group, or other: an effect of that one"""
    term: Annotated[str, Field(pattern=r"^[^\W\d]\w*$")] | None = None
    """name of a term of the model, of one parameter or several: a fit begins without
    it, adds it after the refinement, and keeps it where it foretells parts of the logs
    left out clearly better. One whose parameters all act on one joint is tried on that
    joint alone. One of `by_command` (fixed: 1, of one joint) is tried last. The joint
    keeps it where load and pump predict worse; its parameters that then have no effect
    are left out. null: always there"""

    @model_validator(mode="after")
    def _consistent(self) -> "ParameterSettings":
        self._check_quantity()
        self._check_place()
        self._check_knowledge()
        self._check_values()
        self._check_choice()
        return self

    def _check_quantity(self) -> None:
        """Raise ValueError where there is no such quantity."""
        if self.quantity in CHOICES:
            return
        near = difflib.get_close_matches(self.quantity, CHOICES, n=3, cutoff=0.4)
        choice = " or ".join(map(repr, near or MECHANICAL))
        raise ValueError(f"no quantity {self.quantity!r}; did you mean {choice}?")

    def _check_place(self) -> None:
        """Raise ValueError where the quantity cannot act on these joints or this
        link."""
        is_mass = self.quantity == "mass"
        names_joints = self.joints is not None or self.each
        if is_mass != (self.link is not None):
            raise ValueError("a mass names its link, and only a mass does")
        if CHOICES[self.quantity].of_the_pump and names_joints:
            raise ValueError(
                f"all joints share the pump: a {self.quantity} has no joints"
            )
        if is_mass and names_joints:
            raise ValueError("a mass belongs to a link, not to joints")

    def _check_knowledge(self) -> None:
        """Raise ValueError where too much or too little is said of the value."""
        effect_without_sd = self.per is not None and self.sd is None
        effect_on_mass = self.per is not None and self.quantity == "mass"
        if effect_without_sd or effect_on_mass:
            raise ValueError(
                "an effect per group needs sd: standard deviation, around 0, and is no mass"
            )
        if self.within is not None and self.sd is not None:
            raise ValueError("give within: factor or sd: standard deviation, not both")
        if not self.can_be_free and self.fixed is None:
            raise ValueError(
                "needs bounds: [lower, upper], a prior (within: factor), or fixed: value"
            )

    def _check_choice(self) -> None:
        """Raise ValueError where what is either so or not is to be estimated, or where
        several joints are to choose as one."""
        if self.quantity != BY_COMMAND:
            return
        if self.fixed not in (0.0, 1.0) or self.per is not None:
            raise ValueError(f"{BY_COMMAND} is not estimated: needs fixed: 0 or 1")
        if self.term is not None and len(self.joints or ()) != 1:
            raise ValueError(f"a term of {BY_COMMAND} names one joint")

    def _check_values(self) -> None:
        """Raise ValueError where bounds, nominal value, start or fixed value cannot
        be."""
        lower, upper = self.bounds or (-math.inf, math.inf)
        if lower >= upper:
            raise ValueError("bounds must be [lower, upper] with lower < upper")
        self._check_limits()
        for name, value in (("nominal", self.nominal), ("start", self.start)):
            if value is None or lower <= value <= upper:
                continue
            raise ValueError(f"{name} {value:g} lies outside the bounds")

    def _check_limits(self) -> None:
        """Raise ValueError where any value is beyond what the quantity can be."""
        given = [*(self.bounds or ()), self.nominal, self.start, self.fixed]
        stated = [value for value in given if value is not None]
        if not stated:
            return
        if self.quantity == "mass" and min(stated) <= 0:
            raise ValueError("a mass must be above 0 kg")
        if self.per is not None:
            # an effect of a group is added to the quantity: it may be of either sign
            return
        quantity = CHOICES[self.quantity]
        least = quantity.lowest
        most = quantity.highest
        if min(stated) < least:
            limit = f"below {least:g} {self.unit}".rstrip() if least else "negative"
            raise ValueError(f"{self.quantity} cannot be {limit}")
        if max(stated) > most:
            limit = f"above {most:g} {self.unit}".rstrip()
            raise ValueError(f"{self.quantity} cannot be {limit}")

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
    """A prior on a combination of parameters;
    without a standard deviation it is an exact constraint.

    priors:
      total mass: {of: [M1, M2, M3, M4, M5, M6], value: 42.5, sd: 0.5}   # their sum
      forearm:    {of: M5, value: 4.0, sd: 0.4}                          # a Gaussian prior
      balance:    {of: {M3: 1, M4: -2}, value: 0, sd: 0.5}               # M3 - 2 M4
      areas:      {ratio: [A_A, A_B], value: 1.333}                      # A_A / A_B
      spool:      {of: {dead_A: 1, dead_B: -1}, value: 0, sd: 5, tails: heavy}    # alike, or not at all
      curve:      {smooth: [curve_1, curve_2, curve_3, curve_4], sd: 0.3}         # no bend without a reason
    """

    of: str | tuple[str, ...] | dict[str, float] | None = None
    """a parameter, a list of parameters whose sum is meant,
    or a mapping of parameters to their factors"""
    ratio: tuple[str, str] | None = None
    """two parameters: the ratio of the first to the second is meant"""
    smooth: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """positive parameters, such as the factors of a valve's curve: the ratios of
    neighbours, and the last one, are 1 but for a scatter of their logarithms of about
    `sd`, which the logs may show to be much less or much more"""
    value: float | None = None
    """value of the combination, in the unit of the parameters; of `smooth` there is
    none"""
    sd: Positive | None = None
    """standard deviation of the value; null: the constraint is exact"""
    tails: Literal["normal", "heavy"] = "normal"
    """heavy: the value may also be many standard deviations off, if the logs say so:
    Student's t with 2 degrees of freedom, of scale sd, in place of a normal
    distribution"""

    @model_validator(mode="after")
    def _names_parameters(self) -> "PriorSettings":
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
    def names(self) -> tuple[str, ...]:
        """The parameters that it is about."""
        return self.smooth or tuple(self.factors)

    @property
    def factors(self) -> dict[str, float]:
        """Parameters with their factors; of a ratio those of a - value b,
        which is 0 where it holds. Of `smooth` there are none."""
        if self.ratio is not None:
            first, second = self.ratio
            return {first: 1.0, second: -(self.value or 0.0)}
        if isinstance(self.of, dict):
            return self.of
        names = (self.of,) if isinstance(self.of, str) else self.of
        return dict.fromkeys(names or (), 1.0)


def _name_infinity(value: Any) -> Any:
    """Accept YAML's own infinity, `.inf`; refuse true, which equals 1."""
    if isinstance(value, bool):
        raise ValueError("must be 1, 2 or 'inf'")
    is_infinity = isinstance(value, float) and value == math.inf
    return "inf" if is_infinity else value


class ObjectiveSettings(Settings):
    """Norm of the output error, equations (18) and (19), and the segments of equation
    (21)."""

    norm: Annotated[Literal[1, 2, "inf"], BeforeValidator(_name_infinity)] = "inf"
    """p of the norm: 1, 2 or inf (the article's choice, table 5)"""
    relative: bool = False
    """divide by the norm of the measured output of the same segment, equation (19)"""
    segments: Annotated[int, Field(ge=1, le=10_000)] = 8
    """number of segments of equal length, one objective each"""
    weights: ByJoint[Positive] = {}
    """factor on the error of a joint's angle, by joint, in the searches and in stage 1;
    1 for joints that are not listed. The refinement of stage 2 weighs each joint by its
    own error (docs/uncertainty.md)"""
    pressure_weight: NotNegative = 0.0
    """stage 2: factor that turns a chamber pressure's error into an angle's in the
    searches [deg/bar]; 0: angles only. Above 0 the refinement compares pressures, too,
    and weighs them by their own errors"""
    noise_deg: Positive | ByJoint[Positive] | None = None
    """standard deviation of the sensor's noise of measured angles, for all joints or by
    joint [deg]; null: it is estimated from the residuals. The other parts of an error,
    such as drift, are always estimated"""

    def noise_of(self, joint: int) -> float | None:
        """Return the stated noise of a joint's angle [deg]."""
        if isinstance(self.noise_deg, dict):
            return self.noise_deg.get(joint)
        return self.noise_deg


OtherJoints = Literal["locked", "passive", "measured"]


class SimulationSettings(Settings):
    """How logs are simulated."""

    model: Climb = "dynamic"
    """of stage 2. dynamic: oil stiffness, inertia and stops; quasi-static: speed
    follows valve and load at once, one step a sample; ladder: a fit searches and
    refines the quasi-static model, then refines the dynamic one from there, and keeps
    it where it is clearly nearer to the logs"""
    other_joints: OtherJoints = "locked"
    """how to treat joints that have no command in the log and are not compared. locked:
    they stand still, which is the fastest; passive: they move on their own spring and
    damper, as in the article; measured: they follow their logged motion"""
    steps_per_sample: Annotated[int, Field(ge=1, le=100)] = 1
    """MuJoCo steps per sample of the log; in the quasi-static model only the valves
    have so many"""
    threads: Annotated[int, Field(ge=0, le=1024)] = 0
    """number of threads. 0 means one per core; with --dask it means one per worker"""
    measured_cutoff_hz: Annotated[float, Field(gt=0, le=50)] = 4.0
    """cutoff of the low-pass filter on motion that joints follow [Hz]; its second
    derivative becomes a torque"""
