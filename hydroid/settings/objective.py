"""Settings of the objectives: which norm of the error, over which segments of the record."""

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from hydroid.settings.load import Settings


def _name_infinity(value: Any) -> Any:
    """YAML's own infinity, `.inf`, is as good as the word."""
    return "inf" if isinstance(value, float) and value == math.inf else value


Positive = Annotated[float, Field(gt=0)]
Order = Annotated[Literal[1, 2, "inf"], BeforeValidator(_name_infinity)]


class SegmentSettings(Settings):
    """How the record is cut into segments, one objective each: exactly one of the first three is given."""

    equal: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Number of segments of equal length."""
    turning_points: Annotated[int, Field(ge=1, le=10_000)] | None = None
    """Number of segments, cut at the most prominent peaks and troughs of the measured output."""
    times: tuple[Annotated[float, Field(gt=0)], ...] | None = None
    """Inner cuts [s from the start of the record], increasing."""
    swing: Annotated[float, Field(gt=0, lt=1)] = 0.05
    """What counts as a turn: the output moves by this fraction of its range before and after it."""

    @model_validator(mode="after")
    def _exactly_one(self) -> "SegmentSettings":
        given = [name for name in ("equal", "turning_points", "times") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"give exactly one of equal, turning_points, times, not {' and '.join(given) or 'none'}"
            )
        if self.times is not None and any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("times must increase")
        return self


class ObjectiveSettings(Settings):
    """Norm of the output error, equations (18) and (19), and the segments of equation (21)."""

    norm: Order = "inf"
    """p of the norm: 1, 2 or inf (the article's choice, table 5)."""
    relative: bool = False
    """Divide by the norm of the measured output of the same segment, equation (19)."""
    segments: SegmentSettings = SegmentSettings(equal=8)
    weights: dict[Annotated[int, Field(ge=1)], Annotated[float, Field(gt=0)]] = Field(
        default_factory=dict[int, float]
    )
    """By joint: its angle's error counts this many times; 1 where none is given."""
    pressure_weight: Annotated[float, Field(ge=0)] = 0.0
    """What a chamber pressure's error counts in stage 2 [deg/bar]; 0: pressures are not compared."""
    noise_deg: Positive | dict[Annotated[int, Field(ge=1)], Positive] | None = None
    """Standard deviation of the measured angles' (white) noise, for all joints or by joint, where known; by
    default it is estimated from what the fit leaves over, with its autocorrelation."""
    noise_bar: Positive | None = None
    """The same of chamber pressures."""
