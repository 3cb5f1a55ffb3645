"""The verdict on a fit, joint by joint: what it predicts, beside what anybody would try first.

Errors are rms over the logs that drive the joint. The tolerance is `tolerance_deg` of the settings,
or 2 % of the joint's travel in the unseen logs. With each simple model the fit is compared in pairs
at JUDGED times ahead (`fitting.comparison`). It is ahead of one if it is better at one of these
times. The first of these that is true is the verdict:

1. predicts: the error on the unseen logs is within the tolerance, whatever the simple models do;
2. does not fit: on the fitted logs the error is outside the tolerance, and a simple model's is
smaller; where
   there are unseen logs, the fit is not ahead of each simple model there either;
3. not tested: no unseen log drives the joint;
4. predicts no better than a simple model: it is not ahead of that one, and at one of these times it
is worse;
   the simplest such is named;
5. predicts worse than it fits: the error on the unseen logs is more than twice that on the fitted
ones, or
   it diverges;
6. predicts little: the error on the unseen logs is more than half of what standing still errs by
there;
7. cannot be told from a simple model: it is not ahead of that one, and at none of these times
worse; of
   several such that with the smallest error is named;
8. predicts roughly: none of these. It is ahead of every simple model, and outside the tolerance.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from hydroid.arrays import Array, record, rms
from hydroid.estimate import finite
from hydroid.findings import Finding
from hydroid.fitting.baselines import NAMES, Baseline, fit_baselines
from hydroid.fitting.comparison import compare, in_blocks
from hydroid.fitting.validation import HORIZONS, SETTLING, Prediction, errors_ahead
from hydroid.joint_verdict import Comparison, JointVerdict, Outcome, Verdict
from hydroid.log import Log
from hydroid.settings.fit import FitSettings

JUDGED = (1.0, 5.0, 10.0)
"""of HORIZONS, what a controller needs: over these a fit must be ahead of simple models [s]"""
SHARE = 0.02
"""of a joint's travel that its error may be where no tolerance is stated"""
CLEARLY = 0.9
"""part of another model's error on the fitted logs that a better one stays below"""
LEAST_TOLERANCE = 0.001
"""the least that a tolerance can be [deg]; none follows from a joint that is never driven,
or never moves"""
WORSE = 2.0
"""times the error on fitted logs, beyond which a fit predicts worse than it fits"""
LITTLE = 0.5
"""part of the error of standing still, above which a fit predicts little of the motion"""
STANDING_OUT = 3.0
"""times the median error of the other unseen logs, beyond which a log is named"""
THE_FIT = "the fit"
"""its name beside those of the simple models"""
ANYWHERE = np.array([-np.inf, np.inf])

Baselines = Mapping[int, Mapping[str, Baseline]]
"""by joint, numbered from 1, and by name, the simplest first"""


def baselines_of(settings: FitSettings, logs: Sequence[Log]) -> Baselines:
    """Fit the baselines of all compared joints to logs."""
    ranges = [*settings.arm.ranges.values()]
    return {joint: fit_baselines(logs, joint, ranges[joint - 1]) for joint in settings.outputs}


def judge(
    settings: FitSettings,
    fitted: Sequence[Prediction],
    baselines: Baselines,
    unseen: Sequence[Prediction] = (),
) -> tuple[JointVerdict, ...]:
    """Return the verdict on each compared joint.

    `fitted` is what the fit makes of its own logs; none of values that are no fit's. `baselines`
    are fitted to the same logs; none: a joint is compared with standing still. Of the predictions
    `unseen`, those of logs that the fit has seen test nothing,
    and those that are `apart` do not count.
    """
    verdicts = list[JointVerdict]()
    for joint in settings.outputs:
        models = baselines.get(joint) or {NAMES[0]: Baseline(joint, ANYWHERE)}
        own = [p for p in fitted if p.log.driven[joint - 1]]
        verdicts.append(_judged(settings, models, own, _tests(unseen, joint), joint))
    return tuple(verdicts)


def _tests(unseen: Sequence[Prediction], joint: int) -> list[Prediction]:
    """Return the predictions that test a joint."""
    return [p for p in unseen if p.log.driven[joint - 1] and p.unseen is not False and not p.apart]


@record
class _Errors:
    """Rms errors of one joint over some logs [deg]: of the fit, None without logs,
    and of simple models."""

    fit: float | None
    simple: Mapping[str, float]


def _judged(
    settings: FitSettings,
    models: Mapping[str, Baseline],
    own: Sequence[Prediction],
    new: Sequence[Prediction],
    joint: int,
) -> JointVerdict:
    """Return the verdict on a joint by logs that drive it: `own` are fitted, `new` unseen."""
    tolerance = _tolerance(settings, own, new, joint)
    there = _errors(models, own, joint)
    here = _errors(models, new, joint)
    ahead = _ahead(models, new, joint)
    compared = {name: _compared(ahead[THE_FIT], ahead[name]) for name in models if ahead}
    whole = {
        name: compare([p.error(joint) for p in new], [model.errors([p.log]) for p in new])
        for name, model in models.items()
        if new
    }
    beside = {name: _beside(compared.get(name), whole[name]) for name in whole}
    verdict, named = _verdict(there, here, beside, tolerance)
    banded = [p for p in new if joint in p.bands]
    return JointVerdict(
        joint=joint,
        name=settings.arm.joint_names[joint - 1],
        slides=settings.arm.joints[joint - 1].slides,
        verdict=verdict,
        beside=named,
        fitted_deg=finite(there.fit),
        unseen_deg=finite(here.fit),
        unseen_logs=len(new),
        tolerance_deg=tolerance,
        inside_percent=_inside(banded, joint),
        expected_deg=_expected(banded, joint) if len(own) > 1 else None,
        baselines_deg=dict(here.simple or there.simple),
        horizons_deg={name: _rms_ahead(np.concatenate(rows)) for name, rows in ahead.items()},
        compared=compared,
        compared_whole=whole,
    )


def _tolerance(
    settings: FitSettings, own: Sequence[Prediction], new: Sequence[Prediction], joint: int
) -> float:
    stated = settings.tolerance_deg
    if isinstance(stated, dict):
        stated = stated.get(joint)
    if stated:
        return stated
    travel = max((np.ptp(p.log.angle[:, joint - 1]) for p in new or own), default=0.0)
    return max(float(np.degrees(SHARE * travel)), LEAST_TOLERANCE)


def _errors(models: Mapping[str, Baseline], predictions: Sequence[Prediction], joint: int) -> _Errors:
    if not predictions:
        return _Errors(None, {})
    simple = {name: rms_deg(model.errors([p.log]) for p in predictions) for name, model in models.items()}
    return _Errors(rms_deg(p.error(joint) for p in predictions), simple)


def _inside(banded: Sequence[Prediction], joint: int) -> float | None:
    """Return which part of the samples lies inside their bands [%]."""
    if not banded:
        return None
    parts = [p.bands[joint].inside for p in banded]
    return 100 * float(np.average(parts, weights=[len(p.log.time) for p in banded]))


def _expected(banded: Sequence[Prediction], joint: int) -> float | None:
    """Return the rms error over all samples that the bands lead to expect [deg]."""
    if not banded:
        return None
    errors = [p.bands[joint].expected for p in banded]
    return finite(rms_deg([np.repeat(errors, [len(p.log.time) for p in banded])]))


def _ahead(models: Mapping[str, Baseline], new: Sequence[Prediction], joint: int) -> dict[str, list[Array]]:
    """Return errors of predicted changes, (N, HORIZONS) of each log, by model;
    empty where no log has any.

    A log that is shorter than the shortest horizon has no starts.
    """
    long = [p for p in new if len(p.ahead)]
    if not long:
        return {}
    ahead = {THE_FIT: [p.ahead[..., p.joints.index(joint)] for p in long]}
    for name, model in models.items():
        ahead[name] = [errors_ahead(p.log, lambda part, model=model: model.errors([part])) for p in long]
    return ahead


def _compared(ours: Sequence[Array], theirs: Sequence[Array]) -> tuple[Comparison, ...]:
    """Compare the fit with a simple model at each of HORIZONS; errors are those of `_ahead`."""
    result = list[Comparison]()
    for column in range(len(HORIZONS)):
        pair = [
            [block for log in rows for block in in_blocks(log[:, column], SETTLING)]
            for rows in (ours, theirs)
        ]
        result.append(compare(*pair))
    return tuple(result)


def _beside(compared: Sequence[Comparison] | None, whole: Comparison) -> Outcome:
    """Return whether the fit is ahead of a simple model at all, by JUDGED times;
    without starts by logs."""
    if compared is None:
        return whole.outcome
    outcomes = [one.outcome for seconds, one in zip(HORIZONS, compared, strict=True) if seconds in JUDGED]
    for decided in (Outcome.BETTER, Outcome.WORSE):
        if decided in outcomes:
            return decided
    return Outcome.UNTOLD


def _verdict(
    there: _Errors, here: _Errors, beside: Mapping[str, Outcome], tolerance: float
) -> tuple[Verdict, str | None]:
    """Return the verdict, and the simple model that it names.

    Errors are those on the fitted logs, `there`, and on the unseen ones, `here`;
    `beside` are `_beside`.
    """
    fitted, unseen = there.fit, here.fit
    if unseen is not None and unseen <= tolerance:
        return Verdict.PREDICTS, None
    not_ahead = [name for name, outcome in beside.items() if outcome is not Outcome.BETTER]
    misfit = fitted is not None and not fitted <= tolerance and not fitted < min(there.simple.values())
    if misfit and (unseen is None or not_ahead):
        return Verdict.MISFIT, None
    if unseen is None:
        return Verdict.UNTESTED, None
    worse = [name for name in not_ahead if beside[name] is Outcome.WORSE]
    # of a fit that fits, and diverges elsewhere, that is the news
    if worse and (fitted is None or np.isfinite(unseen)):
        return Verdict.NO_BETTER, worse[0]
    if fitted is not None and not unseen <= WORSE * fitted:
        return Verdict.WORSE_THAN_FITTED, None
    if not unseen <= LITTLE * here.simple[NAMES[0]]:
        return Verdict.LITTLE, None
    if not_ahead:
        return Verdict.UNTOLD, min(not_ahead, key=here.simple.__getitem__)
    return Verdict.ROUGHLY, None


def standing_out(
    unseen: Sequence[Prediction], verdicts: Sequence[JointVerdict], where: str = "RUN"
) -> list[Finding]:
    """Return which unseen logs err by more than STANDING_OUT times what the other ones do,
    in any joint.

    Three logs at least, and beyond the tolerance. Whether such a log counts is for its user to say:
    the hint has the command, with the run's folder `where`.
    """
    names = list[str]()
    for one in verdicts:
        new = _tests(unseen, one.joint)
        errors = np.nan_to_num([rms_deg([p.error(one.joint)]) for p in new], nan=np.inf)
        for i, own in enumerate(new if len(new) > 2 else ()):
            usual = max(float(np.median(np.delete(errors, i))), one.tolerance_deg)
            if errors[i] > STANDING_OUT * usual:
                names.append(own.log.source)
    logs = tuple(dict.fromkeys(names))
    return [Finding("log stands out", "note", logs, {"run": where})] if logs else []


def behind(settings: FitSettings, verdicts: Sequence[JointVerdict]) -> list[Finding]:
    """Return that a fit of the hydraulics errs more on its own logs than nine numbers do,
    which it holds."""
    joints = tuple(
        one.name
        for one in verdicts
        if one.baselines_deg.get(NAMES[-1], np.inf) < CLEARLY * (one.fitted_deg or 0.0)
    )
    kind = "behind nine numbers" if settings.seeded else "behind nine numbers from its start"
    return [Finding(kind, "warning", joints)] if joints and settings.stage == "hyd" else []


def rms_deg(errors: Iterable[Array]) -> float:
    """Return the rms of errors [rad] over all samples [deg]; NaN where one diverged."""
    return float(np.degrees(rms(np.concatenate([*errors]))))


def _rms_ahead(errors: Array) -> tuple[float | None, ...]:
    """Return the rms of errors of predicted changes [rad], shape (N, HORIZONS),
    over the starts [deg]."""
    there = ~np.isnan(errors)
    with np.errstate(all="ignore"):
        mean = np.sum(errors**2, axis=0, where=there) / there.sum(axis=0)
    return tuple(map(finite, np.degrees(np.sqrt(mean)).tolist()))
