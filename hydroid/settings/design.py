"""Settings of `hydroid design`: what an experiment may do, and what it is chosen for."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from hydroid.settings.load import Settings

Positive = Annotated[float, Field(gt=0)]


class DesignSettings(Settings):
    """The next experiment: its length, its limits, its noise, and how hard it is looked for."""

    duration_s: Annotated[float, Field(ge=1, le=3600)] = 60.0
    joints: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(min_length=1)] | None = None
    """joints that may be driven; null: the outputs"""
    poses: Annotated[tuple[str, ...], Field(min_length=1)] | Literal["any"] | None = None
    """poses of the arm's file to start from; any: within the ranges too; null: all of the file's"""
    command_pct: Annotated[float, Field(gt=0, le=100)] = 100.0
    """largest command"""
    dwell_s: tuple[Positive, Positive] = (1.0, 5.0)
    """shortest and longest time between two switches of a command; the shortest limits its bandwidth"""
    speed_deg_s: Positive = 30.0
    """fastest that a joint may move in the simulation"""
    margin_deg: Annotated[float, Field(ge=0)] = 5.0
    """distance that the simulated motion keeps from the ends of the joints' ranges"""
    criterion: Literal["D", "E"] = "E"
    """E: the least known direction of the parameters as precise as possible; D: all of them on average"""
    noise_deg: Positive = 0.1
    """standard deviation of the angles' noise"""
    noise_correlation_s: Annotated[float, Field(ge=0)] = 0.0
    """time in which the noise's autocorrelation falls to 1/e (first order); 0: white"""
    candidates: Annotated[int, Field(ge=2, le=100_000)] = 40
    """random experiments to begin with"""
    improvements: Annotated[int, Field(ge=0, le=1_000_000)] = 200
    """changed experiments that are then tried"""
    time_limit_s: Positive = 600.0
    """the search ends here at the latest; where this ends it the result depends on the machine's speed"""

    @model_validator(mode="after")
    def _ordered(self) -> "DesignSettings":
        if not self.dwell_s[0] <= self.dwell_s[1] <= self.duration_s:
            raise ValueError("dwell_s must be [shortest, longest], not longer than duration_s")
        if self.joints is not None and len(set(self.joints)) < len(self.joints):
            raise ValueError("joints: a joint stands there twice")
        return self
