"""The data of a study: simulated at the truth, or logs; and logs that are only predicted."""

from typing import Annotated, Any

from pydantic import Field, model_validator

from hydroid.settings.load import NotNegative, Positive, Settings

Changes = dict[str, Any]
"""settings to replace, by dotted key, as `--set` has them"""


class SimulatedData(Settings):
    """Data simulated at the true parameters under pseudo-random commands, as in the article's figure 17."""

    pose: str = "study"
    """name of the arm's pose at the start"""
    joints: Annotated[tuple[int, ...], Field(min_length=1)] = (2,)
    """joints that are driven, numbered from 1"""
    duration_s: Positive = 75.0
    """length [s]"""
    seed: Annotated[int, Field(ge=0)] = 0
    """of the commands and of the noise"""
    range_deg: tuple[float, float] | None = None
    """a level that would move a compared joint out of this range is turned round or reduced [deg]"""
    noise_deg: NotNegative = 0.0
    """standard deviation of white noise on the simulated angles [deg]"""


class CheckLog(Settings):
    """A log that is only predicted."""

    log: str
    """CSV file, relative to the study's file"""
    set: Changes = Field(default_factory=dict[str, Any])
    """settings of its own, by dotted key, such as columns that it is read with"""


class DataSettings(Settings):
    """What the runs are fitted to: simulated data or logs; and what is known of the truth."""

    truth: dict[str, float] = Field(default_factory=dict[str, float])
    """true parameters by name: needed by simulated data and by errors of parameters"""
    simulated: SimulatedData | None = None
    """simulate the data"""
    logs: tuple[str, ...] = ()
    """CSV files, relative to the study's file"""
    checks: dict[str, CheckLog] = Field(default_factory=dict[str, CheckLog])
    """further logs, by name, that every estimate predicts"""
    determined_at_deg: Positive = 0.1
    """noise of the angle for which a direction counts as identifiable (docs/studies.md) [deg]"""

    @model_validator(mode="after")
    def _one(self) -> "DataSettings":
        if (self.simulated is None) == (not self.logs):
            raise ValueError("give either simulated: {...} or logs: [...]")
        if self.simulated is not None and not self.truth:
            raise ValueError("simulated data need a truth: {parameter: value}")
        return self
