"""Settings of `hydroid design`: what the next experiment may do, and what it is chosen for."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from hydroid.settings.load import JointNumber, NotNegative, Positive, Settings


class DesignSettings(Settings):
    """Settings of `hydroid design`, the search for the next experiment; a fit does not use them."""

    duration_s: Annotated[float, Field(ge=1, le=3600)] = 60.0
    """length of the experiment [s]"""
    joints: Annotated[tuple[JointNumber, ...], Field(min_length=1)] | None = None
    """joints that may be driven; null: the outputs"""
    poses: Annotated[tuple[str, ...], Field(min_length=1)] | Literal["any"] | None = None
    """names of the arm's poses to start from; any: also random ones within the ranges; null: all named
    poses"""
    command_pct: Annotated[float, Field(gt=0, le=100)] = 100.0
    """largest command [%]"""
    rest_s: NotNegative = 1.0
    """time without a command at the beginning [s]; a fit takes its start pose from it"""
    slew_pct_s: Positive | None = 500.0
    """fastest change of a command [%/s]; null: it jumps"""
    dwell_s: tuple[Positive, Positive] = (1.0, 5.0)
    """shortest and longest time between two changes of a command [s]; the shortest limits the bandwidth"""
    speed_deg_s: Positive = 30.0
    """largest joint speed in the simulated experiment [deg/s]"""
    margin_deg: NotNegative = 5.0
    """smallest distance of the simulated motion from the ends of the joints' ranges [deg]"""
    clearance_m: Positive | None = 0.05
    """smallest distance of the simulated arm from itself and from the floor; where the arm's file has a pair,
    also from the carrier and the other arm, at rest in start_pose [m]; null: collisions are not checked"""
    noise_deg: Positive = 0.1
    """standard deviation of the angles' noise [deg]"""
    noise_correlation_s: NotNegative = 0.0
    """time in which the noise's autocorrelation falls to 1/e (first order) [s]; 0: white noise"""
    effort: Annotated[int, Field(ge=2, le=1_000_000)] = 240
    """number of experiments that are tried: one in six drawn at random, the others changes of the best"""

    @model_validator(mode="after")
    def _ordered(self) -> "DesignSettings":
        if not self.dwell_s[0] <= self.dwell_s[1] <= self.duration_s:
            raise ValueError("dwell_s must be [shortest, longest], not longer than duration_s")
        if self.rest_s + self.dwell_s[0] > self.duration_s:
            raise ValueError("rest_s leaves no time for a command within duration_s")
        return self
