"""The verdict on one joint as `estimate.yaml` and `--json` hold it,
and the words that it has everywhere."""

from enum import StrEnum

from pydantic import Field

from hydroid.settings.load import Settings
from hydroid.units import Display, display
from hydroid.words import two_digits


class Verdict(StrEnum):
    """What a fit is worth for one joint; `fitting.verdict` has the rules. Files hold
    the value."""

    PREDICTS = "predicts"
    ROUGHLY = "predicts roughly"
    UNTOLD = "cannot be told"
    LITTLE = "predicts little"
    WORSE_THAN_FITTED = "predicts worse than it fits"
    NO_BETTER = "predicts no better"
    MISFIT = "does not fit"
    UNTESTED = "not tested"

    @property
    def sign(self) -> str:
        """The sign before its words: ✓ good, ! usable with care, ? the logs do not
        tell, ✗ bad."""
        return _SIGNS.get(self, "✗")

    @property
    def fails(self) -> bool:
        """Whether the fit errs by more than is good, on unseen or on fitted logs."""
        return self.sign == "✗"

    def beside(self, model: str | None) -> str:
        """Return its words with the simple model that it names, if it names one."""
        return f"{self}{_BESIDE.get(self, '')}".format(model)


_SIGNS = {
    Verdict.PREDICTS: "✓",
    Verdict.ROUGHLY: "!",
    Verdict.UNTOLD: "?",
    Verdict.UNTESTED: "?",
}
_BESIDE = {Verdict.NO_BETTER: " than {}", Verdict.UNTOLD: " from {}"}


class Outcome(StrEnum):
    """How a fit predicts beside a simple model."""

    BETTER = "better"
    WORSE = "worse"
    UNTOLD = "cannot be told"


class Comparison(Settings):
    """A fit and a simple model, compared over the same starts or logs
    (`fitting.comparison`)."""

    outcome: Outcome = Field(strict=False)
    """whether the fit is better or worse, or the logs do not tell"""
    difference_deg2: float | None = None
    """the fit's mean squared error minus the simple model's [deg²]; null: none,
    or the fit diverged"""
    sd_deg2: float | None = None
    """standard error of that difference [deg²]; null: it is not known"""
    blocks: int = 0
    """independent parts of the logs that it rests on"""


class JointVerdict(Settings):
    """What a fit is worth for one joint; rms errors over the logs that drive it [deg],
    null if diverged."""

    joint: int
    """numbered from 1"""
    name: str
    slides: bool = False
    """whether it slides: 1 deg then stands for 17.5 mm"""
    verdict: Verdict = Field(strict=False)  # files hold its value
    beside: str | None = None
    """the simple model that the fit predicts no better than, or cannot be told from"""
    fitted_deg: float | None = None
    """on the logs that it was fitted to"""
    unseen_deg: float | None = None
    """on logs that it was not fitted to; null: there are none"""
    unseen_logs: int = 0
    """how many of them drive the joint; if their error is null, its simulation
    diverged"""
    tolerance_deg: float
    """error up to which it predicts"""
    inside_percent: float | None = None
    """part of the samples of the unseen logs inside the 95 % bands; null: there are
    none"""
    expected_deg: float | None = None
    """what a fit of several logs expects of the unseen ones; null: of one log, or there
    are none"""
    baselines_deg: dict[str, float] = Field(default_factory=dict[str, float])
    """of the simple models on the unseen logs, or on the fitted logs where there are no
    others"""
    horizons_deg: dict[str, tuple[float | None, ...]] = Field(
        default_factory=dict[str, tuple[float | None, ...]]
    )
    """rms error of the angle's change over 0.5, 1, 2, 5 and 10 s from starts all along
    the unseen logs, of the fit and of the simple models; empty where there are none"""
    compared: dict[str, tuple[Comparison, ...]] = Field(
        default_factory=dict[str, tuple[Comparison, ...]]
    )
    """the fit with each simple model over these times"""
    compared_whole: dict[str, Comparison] = Field(default_factory=dict[str, Comparison])
    """the fit with each simple model over whole unseen logs; empty where there are
    none"""

    @property
    def shown(self) -> Display:
        """How a reader is shown the joint's errors."""
        return display(slides=self.slides)

    @property
    def text(self) -> str:
        """The verdict in words."""
        is_worse = self.verdict is Verdict.WORSE_THAN_FITTED
        if is_worse and self.unseen_deg and self.fitted_deg:
            times = two_digits(self.unseen_deg / self.fitted_deg)
            return f"predicts {times} times worse than it fits"
        return self.verdict.beside(self.beside)
