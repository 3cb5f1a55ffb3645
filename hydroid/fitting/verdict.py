"""The verdict on a fit, joint by joint: what it predicts, beside what anybody would try first.

Errors are rms over the logs that drive the joint. The tolerance is `tolerance_deg` of the settings, or 2 % of
the joint's travel in the unseen logs. A baseline is as good on these unless the fit's error is below 90 % of
its. The first of these that is true is the verdict:

1. predicts: the error on the unseen logs is within the tolerance, whatever the baselines do;
2. does not fit: on the fitted logs the error is outside the tolerance, and a baseline's is smaller; where
   there are unseen logs, one must be as good there too;
3. not tested: no unseen log drives the joint;
4. predicts no better than a baseline: one is as good on the unseen logs; the simplest such is named;
5. predicts worse than it fits: the error on the unseen logs is more than twice that on the fitted ones, or
   it diverges;
6. predicts little: the error on the unseen logs is more than half of what standing still errs by there;
7. predicts roughly: none of these. It is better than every baseline, and outside the tolerance.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from hydroid.arrays import Array, rms
from hydroid.estimate import JointVerdict, finite
from hydroid.findings import Finding
from hydroid.fitting.baselines import NAMES, Baseline, fit_baselines
from hydroid.fitting.validation import Prediction, errors_ahead
from hydroid.log import Log
from hydroid.settings.fit import FitSettings

SHARE = 0.02
"""of a joint's travel that its error may be where no tolerance is stated"""
CLEARLY = 0.9
"""part of another model's error that a better one stays below"""
LEAST_TOLERANCE = 0.001
"""the least that a tolerance can be [deg]; none follows from a joint that is never driven, or never moves"""
WORSE = 2.0
"""times the error on fitted logs, beyond which a fit predicts worse than it fits"""
LITTLE = 0.5
"""part of the error of standing still, above which a fit predicts little of the motion"""
STANDING_OUT = 3.0
"""times the median error of the other unseen logs, beyond which a log is named"""
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

    `fitted` is what the fit makes of its own logs; none of values that are no fit's. `baselines` are fitted
    to the same logs; none: a joint is compared with standing still. Of the predictions `unseen`, those of
    logs that the fit has seen test nothing, and those that are `apart` do not count.
    """
    verdicts = list[JointVerdict]()
    for joint in settings.outputs:
        rivals = baselines.get(joint) or {NAMES[0]: Baseline(joint, ANYWHERE)}
        new = [p for p in unseen if p.log.driven[joint - 1] and p.unseen is not False and not p.apart]
        own = [p for p in fitted if p.log.driven[joint - 1]]
        stated = settings.tolerance_deg
        stated = stated.get(joint) if isinstance(stated, dict) else stated
        travel = max((np.ptp(p.log.angle[:, joint - 1]) for p in new or own), default=0.0)
        tolerance = stated or max(float(np.degrees(SHARE * travel)), LEAST_TOLERANCE)
        errors = [rms_deg(p.error(joint) for p in some) if some else None for some in (own, new)]
        by_rival = [
            {name: rms_deg(one.errors([p.log]) for p in some) for name, one in rivals.items()} if some else {}
            for some in (own, new)
        ]
        banded = [p for p in new if joint in p.bands]
        sizes = np.array([len(p.log.time) for p in banded], int)
        inside, expected = (
            np.repeat([getattr(p.bands[joint], what) for p in banded], sizes)
            for what in ("inside", "expected")
        )
        ahead: dict[str, list[Array]] = {}
        if new and all(len(p.ahead) for p in new):
            ahead["the fit"] = [p.ahead[..., p.joints.index(joint)] for p in new]
            for name, one in rivals.items():
                ahead[name] = [errors_ahead(p.log, lambda part, one=one: one.errors([part])) for p in new]
        verdicts.append(
            JointVerdict(
                joint=joint,
                name=settings.arm.joint_names[joint - 1],
                slides=settings.arm.joints[joint - 1].slides,
                verdict=_word(errors, by_rival, tolerance),
                fitted_deg=finite(errors[0]),
                unseen_deg=finite(errors[1]),
                unseen_logs=len(new),
                tolerance_deg=tolerance,
                inside_percent=100 * float(np.mean(inside)) if banded else None,
                expected_deg=finite(rms_deg([expected])) if banded and len(own) > 1 else None,
                baselines_deg=by_rival[1] or by_rival[0],
                horizons_deg={name: _rms_ahead(np.concatenate(rows)) for name, rows in ahead.items()},
            )
        )
    return tuple(verdicts)


def _word(errors: Sequence[float | None], rivals: Sequence[Mapping[str, float]], tolerance: float) -> str:
    """Return the verdict from errors [deg] on the fitted and on the unseen logs, and the baselines' there."""
    (fitted, unseen), (there, here) = errors, rivals
    if unseen is not None and unseen <= tolerance:
        return "predicts"
    as_good = [n for n, e in here.items() if unseen is not None and not unseen < CLEARLY * e]
    misfit = fitted is not None and not fitted <= tolerance and not fitted < min(there.values())
    if misfit and (unseen is None or as_good):
        return "does not fit"
    if unseen is None:
        return "not tested"
    if as_good and (fitted is None or np.isfinite(unseen)):
        return f"predicts no better than {as_good[0]}"
    if fitted is not None and not unseen <= WORSE * fitted:
        return "predicts worse than it fits"
    if not unseen <= LITTLE * here[NAMES[0]]:
        return "predicts little"
    return "predicts roughly"


def standing_out(
    unseen: Sequence[Prediction], verdicts: Sequence[JointVerdict], where: str = "RUN"
) -> list[Finding]:
    """Return which unseen logs err by more than STANDING_OUT times what the other ones do, in any joint.

    Three logs at least, and beyond the tolerance. Whether such a log counts is for its user to say: the
    hint has the command, with the run's folder `where`.
    """
    names = list[str]()
    for one in verdicts:
        new = [p for p in unseen if p.log.driven[one.joint - 1] and p.unseen is not False and not p.apart]
        errors = np.nan_to_num([rms_deg([p.error(one.joint)]) for p in new], nan=np.inf)
        for i, own in enumerate(new if len(new) > 2 else ()):
            usual = max(float(np.median(np.delete(errors, i))), one.tolerance_deg)
            if errors[i] > STANDING_OUT * usual:
                names.append(own.log.source)
    logs = tuple(dict.fromkeys(names))
    return [Finding("log stands out", "note", logs, {"run": where})] if logs else []


def behind(settings: FitSettings, verdicts: Sequence[JointVerdict]) -> list[Finding]:
    """Return that a fit of the hydraulics errs more on its own logs than nine numbers do, which it holds."""
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
    """Return the rms of errors of predicted changes [rad], shape (N, HORIZONS), over the starts [deg]."""
    there = ~np.isnan(errors)
    with np.errstate(all="ignore"):
        mean = np.sum(errors**2, axis=0, where=there) / there.sum(axis=0)
    return tuple(map(finite, np.degrees(np.sqrt(mean)).tolist()))
