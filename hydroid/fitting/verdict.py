"""The verdict on a fit, joint by joint: what it predicts, beside what anybody would try
first.

Errors are rms over the logs that drive the joint. The tolerance is `tolerance_deg` of
the settings, or 2 % of the joint's travel in the unseen logs. With each simple model
the fit is compared in pairs at JUDGED times ahead (`fitting.comparison`). It is ahead
of one if it is better at one of these times. The first of these that is true is the
verdict:

- predicts: the error on the unseen logs is within the tolerance, whatever the simple
  models do;
- does not fit: on the fitted logs the error is outside the tolerance and a simple
  model's is smaller; where there are unseen logs, the fit is not ahead of each simple
  model there either;
- not tested: no unseen log drives the joint;
- predicts no better than a simple model: the fit is not ahead of that one, and at one
  of these times it is worse; the simplest such model is named;
- predicts worse than it fits: the error on the unseen logs is more than twice that on
  the fitted ones and the fit is not ahead of each simple model, or the simulation
  diverges;
- predicts little: the error on the unseen logs is more than half of what standing still
  errs by there;
- cannot be told from a simple model: the fit is not ahead of that one, and at none of
  these times worse; of several such models the one with the smallest error is named;
- predicts roughly: none of these. The fit is ahead of every simple model, and its error
  is outside the tolerance.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from hydroid.arrays import Array, record, rms
from hydroid.estimate import finite
from hydroid.findings import Finding
from hydroid.fitting.baselines import CLEARLY, NAMES, Baseline, fit_baselines
from hydroid.fitting.comparison import compare, in_blocks
from hydroid.fitting.validation import HORIZONS, SETTLING, Prediction, errors_ahead
from hydroid.joint_verdict import Comparison, JointVerdict, Outcome, Verdict
from hydroid.log import Log
from hydroid.settings.fit import FitSettings

JUDGED = (1.0, 5.0, 10.0)
"""of HORIZONS, what a controller needs: over these a fit must be ahead of simple models
[s]"""
SHARE = 0.02
"""of a joint's travel that its error may be where no tolerance is stated"""
LEAST_TOLERANCE = 0.001
"""the least that a tolerance can be [deg]; none follows from a joint that is never
driven, or never moves"""
WORSE = 2.0
"""times the error on fitted logs, beyond which a fit predicts worse than it fits"""
LITTLE = 0.5
"""part of the error of standing still, above which a fit predicts little of the
motion"""
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
    return {
        joint: fit_baselines(logs, joint, ranges[joint - 1])
        for joint in settings.outputs
    }


def judge(
    settings: FitSettings,
    fitted: Sequence[Prediction],
    baselines: Baselines,
    unseen: Sequence[Prediction] = (),
) -> tuple[JointVerdict, ...]:
    """Return the verdict on each compared joint.

    `fitted` is what the fit makes of its own logs; none of values that are no fit's.
    `baselines` are fitted to the same logs; none: a joint is compared with standing
    still. Of the predictions `unseen`, those of logs that the fit has seen test
    nothing, and those that are `apart` do not count.
    """
    verdicts = list[JointVerdict]()
    for joint in settings.outputs:
        models = baselines.get(joint) or {NAMES[0]: Baseline(joint, ANYWHERE)}
        fitted_there = [p for p in fitted if p.log.drives(joint)]
        tests = _tests(unseen, joint)
        verdicts.append(_judged(settings, models, fitted_there, tests, joint))
    return tuple(verdicts)


def _tests(unseen: Sequence[Prediction], joint: int) -> list[Prediction]:
    """Return the predictions that test a joint."""
    tests = list[Prediction]()
    for prediction in unseen:
        # None: nobody knows whether the fit has seen it, so it counts as a test
        may_test = prediction.unseen is not False and not prediction.apart
        if may_test and prediction.log.drives(joint):
            tests.append(prediction)
    return tests


@record
class _Errors:
    """Rms errors of one joint over some logs [deg]: of the fit, None without logs,
    and of simple models."""

    fit: float | None
    simple: Mapping[str, float]


def _judged(
    settings: FitSettings,
    models: Mapping[str, Baseline],
    fitted: Sequence[Prediction],
    unseen: Sequence[Prediction],
    joint: int,
) -> JointVerdict:
    """Return the verdict on a joint by the logs that drive it."""
    tolerance = _tolerance(settings, fitted, unseen, joint)
    fitted_errors = _errors(models, fitted, joint)
    unseen_errors = _errors(models, unseen, joint)
    by_horizon = _by_horizon(models, unseen, joint)
    compared = dict[str, tuple[Comparison, ...]]()
    if by_horizon:
        for name in models:
            compared[name] = _compared(by_horizon[THE_FIT], by_horizon[name])
    compared_whole = _compared_whole(models, unseen, joint)
    outcomes = dict[str, Outcome]()
    for name, whole in compared_whole.items():
        outcomes[name] = _outcome(compared.get(name), whole)
    verdict, beside = _verdict(fitted_errors, unseen_errors, outcomes, tolerance)
    banded = [p for p in unseen if joint in p.bands]
    # one log does not say how logs differ, so its band is no expectation
    expected = None
    if len(fitted) > 1:
        expected = _expected(banded, joint)
    horizons = dict[str, tuple[float | None, ...]]()
    for name, errors in by_horizon.items():
        horizons[name] = _rms_by_horizon(np.concatenate(errors))
    return JointVerdict(
        joint=joint,
        name=settings.arm.name_of(joint),
        slides=settings.arm.joint(joint).slides,
        verdict=verdict,
        beside=beside,
        fitted_deg=finite(fitted_errors.fit),
        unseen_deg=finite(unseen_errors.fit),
        unseen_logs=len(unseen),
        tolerance_deg=tolerance,
        inside_percent=_inside(banded, joint),
        expected_deg=expected,
        baselines_deg=dict(unseen_errors.simple or fitted_errors.simple),
        horizons_deg=horizons,
        compared=compared,
        compared_whole=compared_whole,
    )


def _tolerance(
    settings: FitSettings,
    fitted: Sequence[Prediction],
    unseen: Sequence[Prediction],
    joint: int,
) -> float:
    """Return the tolerance of a joint [deg]: the stated one, or a share of its
    travel."""
    stated = settings.tolerance_deg
    if isinstance(stated, dict):
        stated = stated.get(joint)
    if stated:
        return stated
    travels = [np.ptp(p.log.angle_of(joint)) for p in unseen or fitted]
    share = SHARE * max(travels, default=0.0)
    return max(float(np.degrees(share)), LEAST_TOLERANCE)


def _errors(
    models: Mapping[str, Baseline], predictions: Sequence[Prediction], joint: int
) -> _Errors:
    if not predictions:
        return _Errors(None, {})
    simple = dict[str, float]()
    for name, model in models.items():
        simple[name] = rms_deg(model.errors([p.log]) for p in predictions)
    return _Errors(rms_deg(p.error(joint) for p in predictions), simple)


def _inside(banded: Sequence[Prediction], joint: int) -> float | None:
    """Return which part of the samples lies inside their bands [%]."""
    if not banded:
        return None
    parts = [p.bands[joint].inside for p in banded]
    return 100 * float(np.average(parts, weights=_samples(banded)))


def _expected(banded: Sequence[Prediction], joint: int) -> float | None:
    """Return the rms error over all samples that the bands lead to expect [deg]."""
    if not banded:
        return None
    errors = [p.bands[joint].expected for p in banded]
    return finite(rms_deg([np.repeat(errors, _samples(banded))]))


def _samples(predictions: Sequence[Prediction]) -> list[int]:
    """Return the number of samples of each prediction."""
    return [len(p.log.time) for p in predictions]


def _by_horizon(
    models: Mapping[str, Baseline], unseen: Sequence[Prediction], joint: int
) -> dict[str, list[Array]]:
    """Return errors of predicted changes, (N, HORIZONS) of each log, by model: of THE_FIT
    and of each simple one; empty where no log has any.

    A log that is shorter than the shortest horizon has no starts.
    """
    with_starts = [p for p in unseen if len(p.ahead)]
    if not with_starts:
        return {}
    by_horizon = {THE_FIT: [p.ahead[..., p.joints.index(joint)] for p in with_starts]}
    for name, model in models.items():
        by_horizon[name] = [_simple_by_horizon(model, p.log) for p in with_starts]
    return by_horizon


def _simple_by_horizon(model: Baseline, log: Log) -> Array:
    """Return a simple model's errors of predicted changes of a log, shape (N,
    HORIZONS)."""
    return errors_ahead(log, lambda part: model.errors([part]))


def _compared(ours: Sequence[Array], theirs: Sequence[Array]) -> tuple[Comparison, ...]:
    """Compare the fit with a simple model at each of HORIZONS; errors are those of
    `_by_horizon`."""
    comparisons = list[Comparison]()
    for column in range(len(HORIZONS)):
        our_blocks = _blocks(ours, column)
        their_blocks = _blocks(theirs, column)
        comparisons.append(compare(our_blocks, their_blocks))
    return tuple(comparisons)


def _blocks(errors: Sequence[Array], column: int) -> list[Array]:
    """Return the errors of all logs at one of HORIZONS, in blocks that are independent
    enough."""
    blocks = list[Array]()
    for of_log in errors:
        blocks += in_blocks(of_log[:, column], SETTLING)
    return blocks


def _compared_whole(
    models: Mapping[str, Baseline], unseen: Sequence[Prediction], joint: int
) -> dict[str, Comparison]:
    """Compare the fit with each simple model over whole logs."""
    if not unseen:
        return {}
    ours = [p.error(joint) for p in unseen]
    compared = dict[str, Comparison]()
    for name, model in models.items():
        theirs = [model.errors([p.log]) for p in unseen]
        compared[name] = compare(ours, theirs)
    return compared


def _outcome(compared: Sequence[Comparison] | None, whole: Comparison) -> Outcome:
    """Return whether the fit is ahead of a simple model at all, by JUDGED times;
    without starts by whole logs."""
    if compared is None:
        return whole.outcome
    judged = set[Outcome]()
    for seconds, comparison in zip(HORIZONS, compared, strict=True):
        if seconds in JUDGED:
            judged.add(comparison.outcome)
    # better at one time outweighs worse at another
    if Outcome.BETTER in judged:
        return Outcome.BETTER
    if Outcome.WORSE in judged:
        return Outcome.WORSE
    return Outcome.UNTOLD


def _verdict(
    fitted: _Errors, unseen: _Errors, outcomes: Mapping[str, Outcome], tolerance: float
) -> tuple[Verdict, str | None]:
    """Return the verdict, and the simple model that it names.

    Errors are those on the fitted and on the unseen logs; `outcomes` are those of
    `_outcome` by simple model, the simplest first.
    """
    if _is_within(unseen.fit, tolerance):
        return Verdict.PREDICTS, None
    not_ahead = list[str]()
    for name, outcome in outcomes.items():
        if outcome is not Outcome.BETTER:
            not_ahead.append(name)
    # a fit that is ahead of all simple models on unseen logs is worth more than that
    ahead_of_all = unseen.fit is not None and not not_ahead
    if _misfits(fitted, tolerance) and not ahead_of_all:
        return Verdict.MISFIT, None
    if unseen.fit is None:
        return Verdict.UNTESTED, None
    # the news of a fit that fits, and diverges elsewhere, is that it diverges
    diverged_unseen = fitted.fit is not None and not np.isfinite(unseen.fit)
    if not diverged_unseen:
        for name in not_ahead:
            if outcomes[name] is Outcome.WORSE:
                return Verdict.NO_BETTER, name
    return _rough_verdict(fitted.fit, unseen.fit, unseen.simple, not_ahead)


def _rough_verdict(
    fitted: float | None,
    unseen: float,
    simple: Mapping[str, float],
    not_ahead: Sequence[str],
) -> tuple[Verdict, str | None]:
    """Return the verdict on a fit that is outside the tolerance, and no worse than a
    simple model.

    Errors are the fit's, and those of simple models on unseen logs; `not_ahead` are the
    simple models that the fit cannot be told from.
    """
    # one that is ahead of all simple models is of use, however well it fits its own logs
    ahead_of_all = not not_ahead and np.isfinite(unseen)
    is_worse = fitted is not None and _is_beyond(unseen, WORSE * fitted)
    if is_worse and not ahead_of_all:
        return Verdict.WORSE_THAN_FITTED, None
    if _is_beyond(unseen, LITTLE * simple[NAMES[0]]):
        return Verdict.LITTLE, None
    if not_ahead:
        return Verdict.UNTOLD, min(not_ahead, key=simple.__getitem__)
    return Verdict.ROUGHLY, None


def _is_within(error: float | None, limit: float) -> bool:
    """Return whether there is an error, and it is at most a limit."""
    return error is not None and error <= limit


def _is_beyond(error: float, limit: float) -> bool:
    """Return whether an error is above a limit, or NaN: that of a simulation that
    diverged."""
    return not error <= limit


def _misfits(fitted: _Errors, tolerance: float) -> bool:
    """Return whether the fit errs beyond the tolerance, and more than a simple model,
    on fitted logs."""
    if fitted.fit is None or _is_within(fitted.fit, tolerance):
        return False
    return not fitted.fit < min(fitted.simple.values())


def standing_out(
    unseen: Sequence[Prediction], verdicts: Sequence[JointVerdict], where: str = "RUN"
) -> list[Finding]:
    """Return which unseen logs err by more than STANDING_OUT times what the other ones
    do, in any joint.

    Three logs at least, and beyond the tolerance. Whether such a log counts is for its
    user to say: the hint has the command, with the run's folder `where`.
    """
    names = list[str]()
    for verdict in verdicts:
        tests = _tests(unseen, verdict.joint)
        if len(tests) < 3:
            continue
        errors = np.array([rms_deg([p.error(verdict.joint)]) for p in tests])
        # a simulation that diverged errs most
        errors[np.isnan(errors)] = np.inf
        for i, test in enumerate(tests):
            of_others = float(np.median(np.delete(errors, i)))
            usual = max(of_others, verdict.tolerance_deg)
            if errors[i] > STANDING_OUT * usual:
                names.append(test.log.source)
    if not names:
        return []
    logs = tuple(dict.fromkeys(names))
    return [Finding("log stands out", "note", logs, {"run": where})]


def behind(settings: FitSettings, verdicts: Sequence[JointVerdict]) -> list[Finding]:
    """Return a finding where a fit of the hydraulics errs more on its own logs than the
    simple model of nine numbers, which it contains as a special case.

    The verdicts are those without unseen logs: their baselines are of the fitted ones.
    """
    if settings.stage != "hyd":
        return []
    joints = list[str]()
    for verdict in verdicts:
        nine_numbers = verdict.baselines_deg.get(NAMES[-1], np.inf)
        if nine_numbers < CLEARLY * (verdict.fitted_deg or 0.0):
            joints.append(verdict.name)
    if not joints:
        return []
    kind = "behind nine numbers"
    # another seed would lead it nowhere else
    if not settings.seeded:
        kind = "behind nine numbers from its start"
    return [Finding(kind, "warning", tuple(joints))]


def rms_deg(errors: Iterable[Array]) -> float:
    """Return the rms of errors [rad] over all samples [deg]; NaN where one diverged."""
    return float(np.degrees(rms(np.concatenate([*errors]))))


def _rms_by_horizon(errors: Array) -> tuple[float | None, ...]:
    """Return the rms of errors of predicted changes [rad], shape (N, HORIZONS),
    over the starts [deg]."""
    there = ~np.isnan(errors)
    # a horizon without starts divides by 0
    with np.errstate(all="ignore"):
        mean = np.sum(errors**2, axis=0, where=there) / there.sum(axis=0)
    by_horizon = np.degrees(np.sqrt(mean))
    return tuple(map(finite, by_horizon.tolist()))
