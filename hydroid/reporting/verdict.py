"""The verdict on predictions: the errors of each fit on unseen and on fitted logs, and what they mean."""

from collections.abc import Mapping, Sequence
from math import degrees, isfinite

from hydroid.fitting.validation import Prediction, pooled_indices
from hydroid.reporting.page import Light, Verdict, short_name


def rms_deg(predictions: Sequence[Prediction]) -> float:
    """Return the rms error over all angles and samples of predictions [deg]; NaN where one diverged."""
    return degrees(pooled_indices([p.pair(joint) for p in predictions for joint in p.joints]).rms)


def by_fit(predictions: Sequence[Prediction]) -> dict[str, list[Prediction]]:
    """Return the predictions of each fit, the fit with the smallest error on unseen logs first.

    Of a fit without unseen logs all count; it stands behind those that have some.
    """
    fits: dict[str, list[Prediction]] = {}
    for one in predictions:
        fits.setdefault(one.fit, []).append(one)

    def order(item: tuple[str, list[Prediction]]) -> tuple[bool, bool, float]:
        unseen = [p for p in item[1] if p.unseen]
        error = rms_deg(unseen or item[1])
        return not unseen, not isfinite(error), error

    return dict(sorted(fits.items(), key=order))


def verdict(fits: Mapping[str, Sequence[Prediction]], second: str = "", *lights: Light) -> Verdict:
    """Return what to say of fits by name, the best first: their errors, and whether those are as expected."""
    said = [f"{short_name(name)} {_errors(own)}." for name, own in fits.items()]
    light = _as_expected(next(iter(fits.values())))
    return Verdict(said[0], " ".join(filter(None, [*said[1:], second])), (*lights, light))


def _errors(predictions: Sequence[Prediction]) -> str:
    """Say how far predictions of unseen and of fitted logs are off, in the words after a fit's name."""
    parts: list[str] = []
    for unseen, verb, kind in (
        (True, "predicts", "unseen "),
        (False, "reproduces", "fitted "),
        (None, "meets", ""),
    ):
        if chosen := [p for p in predictions if p.unseen is unseen]:
            count, error = len({p.log.source for p in chosen}), rms_deg(chosen)
            logs = f"{count} {kind}log{'' if count == 1 else 's'}"
            ends = f"{verb} {logs} with an error of {error:.2g}° rms"
            parts.append(ends if isfinite(error) else f"diverges on {logs}")
    return " and ".join(parts)


def _as_expected(predictions: Sequence[Prediction]) -> Light:
    question = "Validated on unseen logs"
    answers = [p.as_expected for p in predictions if p.unseen]
    if not answers:
        return Light(question, "open", "Not tested.")
    if worse := answers.count(False):
        answer = f"The error is clearly larger than expected on {worse} of {len(answers)}."
        return Light(question, "fair", answer)
    if None in answers:
        return Light(question, "open", "The fit leaves open what error to expect.")
    return Light(question, "good", "The errors are as expected.")
