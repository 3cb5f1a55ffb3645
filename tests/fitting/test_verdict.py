"""The verdict: one of few words for every joint, and bad ones where a fit is bad."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from hydroid import load_settings
from hydroid.estimate import FitSummary
from hydroid.files import yaml_text
from hydroid.fitting.baselines import NAMES
from hydroid.fitting.validation import HORIZONS, Prediction, errors_ahead
from hydroid.fitting.verdict import behind, judge, standing_out
from hydroid.joint_verdict import Outcome, Verdict
from hydroid.log import Log
from hydroid.posterior.band import Band
from hydroid.reporting.verdict_table import next_step, outside

ROOT = Path(__file__).parents[2]
SETTINGS = load_settings("fit-mech")
TIME = np.arange(0, 120, 0.02)
COMMAND = np.tile(np.sign(np.sin(TIME))[:, None] * 50, 7)
ANGLE = np.radians(50) * np.tile(np.sin(TIME)[:, None], 7)
ANGLE[:, 6] = TIME  # parts of the log then know when they are
LOG = Log("a.csv", TIME, COMMAND, ANGLE, 0.02)
"""each joint turns by 100 deg: within 2 deg it is predicted; two minutes are ten blocks
of starts"""
FREQUENCIES = np.array([27, 37, 49]) / 120
"""of an error [Hz]: whole periods in LOG"""
PHASES = {"alike": np.zeros(3), "other": np.array([1.0, 2.0, 4.0])}


def wave(log: Log, kind: str) -> np.ndarray:
    """An error of 1 deg rms over LOG [rad], at the times of a part of it."""
    time = log.angle[:, [6]]
    waves = np.sin(2 * np.pi * FREQUENCIES * time + PHASES[kind])
    return np.radians(1.0) * np.sqrt(2 / 3) * waves.sum(axis=1)


@dataclass
class Off:
    """A simple model with an error [deg] on the log that it has seen, and one on all
    others."""

    seen: float
    unseen: float
    kind: str = "alike"

    def errors(self, logs) -> np.ndarray:
        pairs = (
            (log, self.seen if log.source == LOG.source else self.unseen)
            for log in logs
        )
        return np.concatenate([error * wave(log, self.kind) for log, error in pairs])


def predicted(error: float, log: Log) -> Prediction:
    """What a fit with an error [deg] makes of a log."""
    ahead = errors_ahead(log, lambda part: error * wave(part, "alike")[:, None])
    response = log.angle[:, [1]] - error * wave(log, "alike")[:, None]
    return Prediction("fit", log, (2,), response, {}, None, ahead)


def other(source: str = "b.csv") -> Log:
    return replace(LOG, source=source)


def verdict(
    fitted=None,
    unseen=None,
    nine=(5, 5),
    tolerance=None,
    log=None,
    still=40,
    kind="alike",
):
    settings = SETTINGS.model_copy(update={"tolerance_deg": tolerance})
    table = Off(8, 8) if nine[1] < 8 else Off(*nine)
    rivals = {
        2: dict(zip(NAMES, (Off(still, still), table, Off(*nine, kind)), strict=True))
    }
    own = [] if fitted is None else [predicted(fitted, LOG)]
    others = [] if unseen is None else [predicted(unseen, log or other())]
    (one,) = judge(settings, own, rivals, others)
    return one


ROWS = {
    "nothing unseen": ((1.0, None), {}, "not tested"),
    "nothing unseen, worse than nine numbers": ((6.0, None), {}, "does not fit"),
    "small error": ((1.0, 1.9), {}, "predicts"),
    "small error, smaller from nine numbers": (
        (1.0, 1.9),
        {"nine": (0.1, 0.1)},
        "predicts",
    ),
    "better than anything, not good": ((2.5, 4.4), {}, "predicts roughly"),
    "as bad as the user allows": ((2.5, 4.5), {"tolerance": 5}, "predicts"),
    "worse than the user allows": ((0.4, 0.7), {"tolerance": 0.5}, "predicts roughly"),
    "much worse than on its own logs": (
        (1.0, 4.9),
        {"kind": "other"},
        "predicts 4.9 times worse than it fits",
    ),
    "much worse than on its own logs, better than anything": (
        (1.0, 4.4),
        {},
        "predicts roughly",
    ),
    "most of the motion is missed": (
        (12.0, 12.0),
        {"still": 15, "nine": (14, 14)},
        "predicts little",
    ),
    "half of the motion is missed": (
        (12.0, 12.0),
        {"still": 24.1, "nine": (14, 14)},
        "predicts roughly",
    ),
    "a little better than nine numbers, all along": (
        (2.5, 4.6),
        {},
        "predicts roughly",
    ),
    "now better, now worse": (
        (2.5, 4.9),
        {"kind": "other"},
        "cannot be told from nine numbers",
    ),
    "too short to tell": (
        (2.5, 3.0),
        {"log": other().part(0, 1500)},
        "cannot be told from nine numbers",
    ),
    "worse than nine numbers": ((1.0, 5.5), {}, "predicts no better than nine numbers"),
    "worse than a table: the simplest is named": (
        (1.0, 9.0),
        {},
        "predicts no better than speed tables",
    ),
    "worse than nine numbers everywhere": ((6.0, 6.0), {}, "does not fit"),
    "worse on its logs, better on others": ((6.0, 4.0), {}, "predicts roughly"),
    "diverged on others": ((1.0, np.nan), {}, "predicts worse than it fits"),
    "no fit's, and diverged": (
        (None, np.nan),
        {},
        "predicts no better than standing still",
    ),
    "diverged": ((np.nan, np.nan), {}, "does not fit"),
    "no fit's": ((None, 1.0), {}, "predicts"),
    "no fit's, and bad": ((None, 9.0), {}, "predicts no better than speed tables"),
}


@pytest.mark.parametrize("row", ROWS)
def test_every_joint_has_one_verdict(row: str):
    (fitted, unseen), how, expected = ROWS[row]
    assert verdict(fitted, unseen, **how).text == expected


@pytest.mark.parametrize("word", Verdict)
def test_the_page_of_results_has_the_words_and_the_sign_of_every_verdict(word: Verdict):
    page = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    assert f"| {word.sign} {word.beside('…')} |" in page


def test_a_fit_that_is_better_at_one_time_ahead_is_not_called_no_better():
    """Its error comes back every 5 s: it is worse after 1 s, and has no error after 5
    or 10 s."""
    log = other()

    def quick(part: Log) -> np.ndarray:
        return np.radians(12.0) * np.sin(2 * np.pi / 5 * part.angle[:, [6]])

    fit = replace(
        predicted(0, log),
        ahead=errors_ahead(log, quick),
        response=log.angle[:, [1]] - quick(log),
    )
    (one,) = judge(
        SETTINGS, [], {2: {NAMES[0]: Off(40, 40), NAMES[-1]: Off(5, 5)}}, [fit]
    )
    outcomes = {
        s: c.outcome for s, c in zip(HORIZONS, one.compared[NAMES[-1]], strict=True)
    }
    assert outcomes[1.0] is Outcome.WORSE
    assert outcomes[5.0] is outcomes[10.0] is Outcome.BETTER
    assert one.verdict is Verdict.ROUGHLY


def test_a_file_holds_a_verdict_with_every_comparison():
    summary = FitSummary(
        stage="hyd", estimate={}, verdict=(verdict(2.5, 4.9, kind="other"),)
    )
    again = FitSummary.model_validate(yaml.safe_load(yaml_text(summary.plain())))
    assert again.verdict == summary.verdict
    assert again.verdict[0].verdict is Verdict.UNTOLD


def test_logs_that_are_too_short_for_any_time_ahead_are_compared_whole():
    logs = [replace(LOG.part(0, 100), source=f"{i}.csv") for i in range(4)]
    (one,) = judge(
        SETTINGS, [], {2: {NAMES[0]: Off(1, 1)}}, [predicted(3.0, log) for log in logs]
    )
    assert (one.horizons_deg, one.compared) == ({}, {})
    assert one.compared_whole[NAMES[0]].blocks == 4
    assert one.text == "predicts no better than standing still"


def test_a_log_that_does_not_drive_the_joint_tests_nothing():
    still = replace(other(), command=0 * LOG.command)
    assert verdict(1.0, 0.01, log=still).verdict is Verdict.UNTESTED


def test_the_errors_are_those_of_the_joint_by_name():
    one = verdict(1.0, 3.0)
    assert (one.joint, one.name, one.tolerance_deg) == (
        2,
        "shoulder",
        pytest.approx(2.0, rel=1e-3),
    )
    assert (one.fitted_deg, one.unseen_deg) == (pytest.approx(1.0), pytest.approx(3.0))
    assert one.baselines_deg["nine numbers"] == pytest.approx(5.0)


def test_what_nine_numbers_fit_better_is_named_and_what_bands_miss():
    (finding,) = behind(
        load_settings("fit-hyd"),
        [verdict(6.0), verdict(5.2).changed({"name": "elbow"})],
    )
    assert finding.subjects == ("shoulder",)
    (line,) = outside([verdict(1, 1).changed({"inside_percent": 7.0})])
    said = "they hold only 7 % of the shoulder's unseen samples."
    assert line == f"The 95 % bands are too narrow: {said}"


@pytest.mark.parametrize(
    ("fitted_logs", "unseen", "expected", "kind"),
    [
        (2, 4.5, 2.0, "machine changed"),
        (2, 4.5, 2.5, "look for terms"),  # bands that wide say so themselves
        # one log does not tell what unseen ones err by
        (1, 4.5, 0.2, "look for terms"),
        (2, 1.9, 0.2, "use the machine"),
    ],
)
def test_errors_far_beyond_the_expected_say_that_the_machine_has_changed(
    fitted_logs, unseen, expected, kind
):
    own = [predicted(1.5, LOG)] * fitted_logs
    band = Band(0.0, np.zeros(len(TIME)), 0.0, 0.0, np.radians(expected))
    new = replace(predicted(unseen, other()), bands={2: band})
    rivals = {2: dict(zip(NAMES, (Off(40, 40), Off(8, 8), Off(8, 8)), strict=True))}
    step = next_step(
        FitSummary(stage="hyd", estimate={}),
        judge(SETTINGS, own, rivals, [new]),
        "run",
        own,
    )
    assert step.kind == kind
    assert ("shoulder" in str(step)) == (kind == "machine changed")


def test_a_log_that_a_user_sets_apart_counts_in_no_verdict_and_one_that_stands_out_is_named():
    rivals = {2: dict(zip(NAMES, (Off(40, 40), Off(8, 8), Off(8, 8)), strict=True))}
    own = [predicted(1.0, LOG)]
    good = [predicted(1.0, other(name)) for name in ("b.csv", "c.csv")]
    heavy = predicted(30.0, other("heavy.csv"))

    def judged(*unseen: Prediction):
        return judge(SETTINGS, own, rivals, unseen)

    (bad,) = judged(*good, heavy)
    assert (bad.text, bad.unseen_logs) == ("predicts no better than speed tables", 3)
    (finding,) = standing_out([*good, heavy], [bad], "runs/a")
    assert finding.subjects == ("heavy.csv",)
    assert "hydroid validate LOG --fit runs/a --apart" in str(finding)
    apart = replace(heavy, apart=True)
    assert judged(*good, apart) == judged(*good)
    assert standing_out([*good, apart], judged(*good, apart)) == []
    # of two that differ nobody can say which is the odd one
    assert standing_out([good[0], heavy], judged(good[0], heavy)) == []


def test_an_error_ahead_begins_anew_at_every_start():
    """A model that is 10 % too slow errs by what the joint has turned since a start,
    however late that is."""
    late = other().part(0, 600)

    def slow(part: Log) -> np.ndarray:
        return 0.1 * (part.angle[:, [1]] - part.angle[0, 1])

    ahead = errors_ahead(late, slow)
    turned = [
        late.angle[200 + round(s / 0.02), 1] - late.angle[200, 1] for s in HORIZONS[:4]
    ]
    assert ahead[1, :4, 0] == pytest.approx(0.1 * np.array(turned))
    assert np.isnan(ahead[1, 4, 0])  # the log ends before
    one = replace(predicted(0, late), unseen=True, ahead=ahead)
    (judged,) = judge(SETTINGS, [], {}, [one])
    assert judged.horizons_deg["the fit"][4] is None
    rms = np.degrees(np.sqrt(np.nanmean(ahead[:, :4, 0] ** 2, axis=0)))
    assert judged.horizons_deg["the fit"][:4] == pytest.approx(rms)
