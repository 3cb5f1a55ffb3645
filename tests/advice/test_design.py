"""The designed experiment: its limits, its information, and the search, held to
laws."""

import mujoco
import numpy as np
import pytest
from made_logs import TRUTH, simulate_log
from two_joints import PARAMETERS, TRUTH as OIL, two_joints

from hydroid import load_settings
from hydroid.advice.design import Design, design, forecast, information, typical
from hydroid.advice.experiment import violation
from hydroid.arm.model import CollisionChecker, load_machine
from hydroid.errors import SettingsError
from hydroid.posterior.uncertainty import uncertainty
from hydroid.problem.problem import Problem
from hydroid.progress import no_progress
from hydroid.settings.fit import FitSettings
from hydroid.settings.search import DesignSettings

THETA = np.array(list(TRUTH.values()))
TURNTABLE = """<mujoco model="turntable">
  <worldbody>
    <body name="base"><geom type="box" size="0.5 0.5 0.5" pos="0 0 0.5"/>
      <body name="house" pos="0 0 1.05"><joint name="swing" axis="0 0 1" range="-60 60"/>
        <geom type="box" size="0.6 0.6 0.3" pos="0 0 0.3"/>
        <body name="boom" pos="0.7 0 0.3"><joint name="lift" axis="0 1 0" range="-20 90"/>
          <geom type="capsule" fromto="0 0 0 2 0 0" size="0.05"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
"""a house that turns 5 cm above its base, with a boom in front"""
DESIGN = {"duration_s": 6, "effort": 12, "dwell_s": [0.5, 2], "poses": "any"}
TWO: dict[str, object] = {
    f"parameters.{name}.fixed": TRUTH[name] for name in ("M1", "M4", "M5")
}
TWO |= {"outputs": [2, 3], "simulation.other_joints": "locked"}


def configured(**changes: object) -> FitSettings:
    return load_settings("article-mech", TWO | {"design": DESIGN | changes})


@pytest.fixture(scope="module")
def designed() -> tuple[FitSettings, Design]:
    settings = configured()
    return settings, design(settings, THETA, [], 3, no_progress)


def keeps_limits(settings: FitSettings, result: Design) -> bool:
    """Whether `simulate` gives the predicted motion, within the limits, after a rest,
    and without jumps."""
    run, limits = simulate_log(settings, result.log, TRUTH), settings.design
    rest = round(limits.rest_s / settings.log.period_s)
    assert not run.command[:rest].any()
    assert limits.slew_pct_s is not None
    change = np.abs(np.diff(run.command, axis=0, prepend=0.0)).max()
    assert 0 < change <= limits.slew_pct_s * settings.log.period_s + 1e-9
    assert limits.clearance_m is not None
    assert clearance(settings, run.angle).min() >= limits.clearance_m
    assert np.abs(run.angle - result.best.log.angle).max() < 1e-9
    assert np.abs(run.command).max() <= settings.design.command_pct
    return violation(run.angle, settings) is None


def clearance(settings: FitSettings, angle: np.ndarray) -> np.ndarray:
    """Distance [m] of the right arm from itself, the floor, the carrier and the left
    arm, shape (T,)."""
    machine = load_machine(settings.arm, pair=True)
    motion = machine.joined({"right": angle}, settings.arm.pose(settings.start_pose))
    return machine.checker.clearance(
        np.arange(len(angle), dtype=float), motion
    ).distance


def test_experiments_keep_clear_where_others_collide():
    """Of random experiments from random poses some collide, unless they are checked."""
    smallest: list[list[float]] = []
    for margin in (0.05, None):
        settings = configured(clearance_m=margin, effort=8, duration_s=4)
        tried = design(settings, THETA, [], 1, no_progress).random
        smallest.append([clearance(settings, trial.log.angle).min() for trial in tried])
    checked, unchecked = smallest
    assert min(checked) >= 0.05
    assert min(unchecked) < 0
    assert len(checked) >= 3


def test_a_design_keeps_its_limits_when_simulate_runs_it(
    designed: tuple[FitSettings, Design],
):
    settings, result = designed
    assert keeps_limits(settings, result)
    assert result.log.duration == pytest.approx(6.0)
    for joint, signal in result.best.experiment.inputs.items():
        assert joint in (1, 2)
        assert np.diff(signal.start).min(initial=50) >= 50  # the shortest dwell, 0.5 s


@pytest.mark.parametrize(
    "tight",
    [{"speed_deg_s": 3}, {"margin_deg": 25, "poses": ["study"]}, {"command_pct": 20}],
)
def test_tight_limits_are_kept_too(tight: dict[str, object]):
    settings = configured(**{"effort": 3} | tight)
    assert keeps_limits(settings, design(settings, THETA, [], 1, no_progress))


def test_the_best_is_no_worse_than_any_random_one_and_repeats(
    designed: tuple[FitSettings, Design],
):
    settings, result = designed
    least, at_random = (
        np.array([typical(result.before.add(t.gained), result.moved) for t in trials])
        for trials in ([result.best], result.random)
    )
    assert least < np.median(at_random)
    assert (least <= at_random).all()
    again = design(settings, THETA, [], 3, no_progress)
    assert np.array_equal(again.log.command, result.log.command)
    assert np.array_equal(again.best.gained, result.best.gained)


def test_the_forecast_is_what_a_fit_to_the_same_log_knows(
    designed: tuple[FitSettings, Design],
):
    """The search's one-sided differences against the uncertainty of a fit; two logs
    have twice as much."""
    settings, result = designed
    log = simulate_log(settings, result.log, TRUTH)
    given = settings.changed({"objective.noise_deg": settings.design.noise_deg})
    fitted = forecast(uncertainty(Problem(given, [log]), THETA).posterior)
    np.testing.assert_allclose(result.after.deviations, fitted.deviations, rtol=0.02)
    two = forecast(uncertainty(Problem(given, [log, log]), THETA).posterior)
    np.testing.assert_allclose(
        result.after.add(result.best.gained).deviations, two.deviations, rtol=0.02
    )


def test_the_information_of_least_squares_has_the_closed_form():
    """White noise, and a drift beside it: by the inverse of the dense covariance."""
    samples, period = 200, 0.01
    rows = np.random.default_rng(0).normal(size=(3, samples))
    for drift in 0.0, 0.5:
        settings = DesignSettings(noise_deg=0.1, drift_deg=drift)
        gained = information(settings, [rows], period)
        at = np.arange(samples)
        grown = np.radians(drift) ** 2 / 10.0 * period * np.minimum(at[:, None], at)
        covariance = np.radians(0.1) ** 2 * np.eye(samples) + grown
        expected = rows @ np.linalg.solve(covariance, rows.T)
        np.testing.assert_allclose(gained.T @ gained, expected, rtol=1e-6)
    rows[2] = 0.0  # what a signal does not depend on stays unknown, and hides nothing
    gained = information(settings, [rows], period)
    assert np.linalg.norm(gained[:, 2]) < 1e-3 * np.linalg.norm(gained[:, 0])


def test_what_no_experiment_moves_hides_nothing_else(tmp_path):
    """The damping of oil that does not ring, and an effect of the logs of another
    day."""
    ring = {"quantity": "oil_damping", "joints": [1], "within": 3}
    day = {"quantity": "dead_band", "joints": [1], "sd": 3, "per": "other"}
    limits = {
        "duration_s": 10.0,
        "effort": 12,
        "clearance_m": None,
        "poses": "any",
        "speed_deg_s": 90.0,
    }
    settings = two_joints(
        tmp_path, parameters=PARAMETERS | {"ring": ring, "day": day}, design=limits
    )
    theta = settings.parameter_set().vector(
        OIL | {"ring": 0.3, "day": 0.0}, "the truth"
    )
    result = design(settings, theta, [], 1, no_progress)
    still = {
        name
        for name, moved in zip(result.names, result.moved, strict=True)
        if not moved
    }
    assert {"ring", "day"} <= still
    assert "open_A_lift" not in still
    place = result.names.index("ring")
    assert result.after.deviations[place] == pytest.approx(
        result.before.deviations[place]
    )


def test_a_base_and_what_turns_on_it_do_not_count_as_meeting():
    model = mujoco.MjModel.from_xml_string(TURNTABLE)
    checker = CollisionChecker(model)
    poses = np.random.default_rng(1).uniform(-1, 1, (20, 2))
    counted = checker.changing(poses)
    names = {
        frozenset(pair) for pair, one in zip(checker.names, counted, strict=True) if one
    }
    assert frozenset({"base", "house"}) not in names
    assert frozenset({"base", "boom"}) in names
    assert checker.first_below(poses, 0.2) == 0
    low = np.tile([[0.0, 0.0]], (10, 1))
    assert checker.first_below(low, 0.2, counted) is None
    low[4:, 1] = 1.5  # the boom hangs down beside the base
    first = checker.first_below(low, 0.2, counted)
    assert first == 4
    pair, share = checker.below(low, 0.2, counted)
    assert ({*pair}, share) == ({"base", "boom"}, 0.6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"joints": [9]}, "joints 1 to 7"),
        ({"poses": ["asleep"]}, "no pose 'asleep'"),
        ({"poses": ["home"]}, "no pose of home is 5 deg inside"),
        (
            {"margin_deg": 70},
            "margin_deg: none of 8 random experiments keeps the limits in simulation: .* nearer than 70 deg",
        ),
        (
            {"clearance_m": 3.0},
            r"clearance_m: none of 8 .* and .* nearer than 3 m in .* 100 % of the time",
        ),
    ],
)
def test_a_design_that_cannot_be_made_is_refused(
    changes: dict[str, object], message: str
):
    with pytest.raises(SettingsError, match=message):
        design(configured(**changes), THETA, [], 1, no_progress)
