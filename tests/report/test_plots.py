"""Figures: they hold what they claim, and stand whatever a fit looks like."""

import itertools
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from report_fits import make_fit, make_problem, make_uncertainty

from hydroid.problem.problem import Evaluation
from hydroid.report.estimates import estimates, spread
from hydroid.report.objectives import contours, learning, pareto
from hydroid.report.responses import JointResponse, draw, joint_responses
from hydroid.report.style import MAX_BINS, decimated, rendered, style
from hydroid.report.uncertainty_report import UncertaintyStudy, draw_profiles
from hydroid.settings.problem import ObjectiveSettings
from hydroid.uncertainty.directions import identifiability
from hydroid.uncertainty.intervals import THRESHOLD, Profile
from hydroid.uncertainty.sweep import Surface

pytestmark = pytest.mark.filterwarnings("error")  # a warning of matplotlib's is a figure gone wrong


@pytest.fixture(autouse=True)
def _styled():
    with style():
        yield


def draw_all(problem, fit) -> list[Figure]:
    objective = problem.settings.objective
    return [
        *(draw(response) for response in joint_responses(problem, fit)),
        learning(fit, objective),
        pareto(fit, objective),
        estimates(problem, fit),
    ]


def draw_with(response: JointResponse, simulated: dict[str, np.ndarray]) -> Figure:
    return draw(replace(response, simulated=simulated))


def check(figure: Figure) -> None:
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


TWO = {"K": (0.05, 0.5), "D": (80.0, 80.0)}
SHAPES = {
    "one segment, one parameter, simple GA": (
        {"segments": 1, "parameters": {"K": (0.05, 0.5)}},
        {"names": ("best", "refined")},
    ),
    "several logs and outputs": ({"sources": ("a.csv", "b.csv"), "outputs": (1, 2)}, {"names": ("best",)}),
    "no refinement, one estimate diverged": (
        {},
        {"names": ("average", "utopia", "best"), "diverged": ("average",)},
    ),
    "nothing but diverged": (
        {},
        {
            "names": ("best", "refined"),
            "diverged": ("best", "refined"),
            "front": 0,
            "effects": (np.nan,) * 4,
        },
    ),
    "fixed without bounds, relative": ({"parameters": TWO, "fixed": {"D": 80.0}, "relative": True}, {}),
    "names that are markup": ({"sources": ("<b>&_%$a$.csv",)}, {}),
    "names without glyphs": ({"sources": ("日志🦾.csv",)}, {}),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_any_fit_can_be_drawn(shape: str):
    of_problem, of_fit = SHAPES[shape]
    problem = make_problem(**of_problem)
    fit = make_fit(problem, **of_fit)
    for figure in draw_all(problem, fit):
        if shape == "names without glyphs":
            rendered(figure)  # drawn with boxes, and without a warning
        else:
            check(figure)


def test_what_is_not_finite_is_left_out():
    problem = make_problem()
    fit = make_fit(problem)
    history = fit.history.copy()
    history[:3, 4:] = np.inf
    segments = fit.front[1].segments.copy()
    segments[0] = np.inf
    broken = replace(fit, history=history, front=(fit.front[0], Evaluation(segments, fit.front[1].overall)))
    for figure in draw_all(problem, broken):
        check(figure)
    check(learning(replace(fit, history=np.full((2, 6), np.inf)), problem.settings.objective))
    check(learning(replace(fit, history=np.empty((0, 6))), problem.settings.objective))


def test_the_response_shows_measured_angle_every_estimate_residual_and_command():
    problem = make_problem()
    fit = make_fit(problem)
    (record,) = joint_responses(problem, fit)
    upper, middle, lower = draw(record).axes
    named = {line.get_label(): line.get_ydata() for line in upper.lines}
    measured = np.degrees(record.measured)
    assert named["measured"] == pytest.approx(measured)
    for name, estimate in fit.estimates.items():
        (label,) = [label for label in named if label.startswith((f"{name} ", f"search ({name})"))]
        simulated = np.degrees(estimate.responses[0][:, 0])
        assert named[label] == pytest.approx(simulated)
        assert f"{np.degrees(estimate.rms):.3g}"[:3] in label
        assert any(
            len(line.get_ydata()) == len(measured)
            and np.allclose(line.get_ydata(), measured - simulated, atol=1e-12)
            for line in middle.lines
        )
    assert np.array_equal(lower.lines[0].get_ydata(), record.command)
    assert [text.get_text() for text in upper.texts] == ["1", "2", "3", "4"]


def test_a_response_that_runs_away_does_not_flatten_the_others():
    problem = make_problem()
    fit = make_fit(problem)
    away = replace(fit.estimates["utopia"], responses=(np.linspace(0, 1e6, 120)[:, None],))
    fit = replace(fit, estimates=fit.estimates | {"utopia": away})
    upper, middle, _ = draw(joint_responses(problem, fit)[0]).axes
    for axes, line in ((upper, upper.lines[0]), (middle, middle.lines[0])):
        low, high = axes.get_ylim()
        assert np.ptp(line.get_ydata()) > 0.1 * (high - low)


def test_the_front_is_drawn_line_by_line_and_estimates_on_top():
    problem = make_problem()
    fit = make_fit(problem, front=9)
    (axes,) = pareto(fit, problem.settings.objective).axes
    (front,) = axes.collections
    drawn = np.array([path.vertices for path in front.get_paths()])
    assert drawn[:, :, 1] == pytest.approx(np.degrees(fit.front[1].segments))
    assert len(axes.lines) == len(fit.estimates)
    assert min(line.zorder for line in axes.lines) > front.zorder


def test_the_learning_curve_shows_best_and_median_in_deg():
    problem = make_problem()
    fit = make_fit(problem)
    (axes,) = learning(fit, problem.settings.objective).axes
    values = {line.get_label(): line.get_ydata() for line in axes.lines}
    assert values["best so far"] == pytest.approx(np.degrees(fit.history[:, 4]))
    assert values["median of the population"] == pytest.approx(np.degrees(fit.history[:, 5]))


@pytest.mark.parametrize(("ratio", "scale"), [(5.0, "linear"), (20.0, "log"), (1e6, "log")])
def test_more_than_a_decade_is_drawn_on_a_logarithmic_axis(ratio: float, scale: str):
    problem = make_problem()
    fit = make_fit(problem)
    history = fit.history.copy()
    history[:, 4] = history[:, 5] = np.geomspace(0.1 * ratio, 0.1, 7)
    figure = learning(replace(fit, history=history), problem.settings.objective)
    assert figure.axes[0].get_yscale() == scale
    figure.draw_without_rendering()
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert sum(bool(label) for label in labels) >= 2


def test_estimates_stand_where_they_are_within_their_bounds():
    problem = make_problem()
    fit = make_fit(problem)
    (axes,) = estimates(problem, fit).axes
    unit = problem.parameters.to_unit(fit.best.theta[None])[0]
    big = [line for line in axes.lines if len(line.get_xdata()) and line.get_markersize() > 8]
    assert [float(np.ravel(line.get_xdata())[0]) for line in big] == pytest.approx(unit)
    assert len(axes.patches) == len(problem.parameters.names)


@pytest.mark.parametrize("count", [1, 4, 27])
def test_no_text_lies_over_another(count: int):
    bounds = {f"M{i}": (1.23456e-6 * 10 ** (i % 11), 1234.56 * 10 ** (i % 11)) for i in range(count)}
    problem = make_problem(parameters=bounds)
    fit = make_fit(problem, effects=(1.0, *(0.0,) * (count - 1)))
    figure = estimates(problem, fit)
    figure.draw_without_rendering()
    texts = [t for t in figure.axes[0].texts if t.get_text()] + figure.axes[0].get_yticklabels()
    boxes = [t.get_window_extent() for t in texts]
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))
    whole = figure.get_window_extent()
    assert all(whole.x0 <= b.x0 and b.x1 <= whole.x1 and whole.y0 <= b.y0 and b.y1 <= whole.y1 for b in boxes)


def test_segment_numbers_keep_apart():
    problem = make_problem(segments=60)
    upper = draw(joint_responses(problem, make_fit(problem))[0]).axes[0]
    upper.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in upper.texts]
    assert len(boxes) > 8
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def test_validation_overlays_every_fit():
    problem = make_problem()
    record = replace(joint_responses(problem, make_fit(problem))[0], segments=())
    simulated = {f"fit {i} $x$": record.measured + 0.01 * i for i in range(9)} | {
        "gone": record.measured * np.nan
    }
    figure = draw_with(record, simulated)
    check(figure)
    labels = [line.get_label() for line in figure.axes[0].lines]
    assert len(labels) == 11
    assert labels[-1] == "gone (diverged)"
    looks = {(line.get_color(), line.get_linewidth()) for line in figure.axes[0].lines[1:]}
    assert len(looks) == 10


def test_responses_that_coincide_are_all_seen():
    problem = make_problem()
    record = joint_responses(problem, make_fit(problem))[0]
    shown = record.measured + 0.01
    figure = draw_with(record, {"ga": shown, "nsga2": shown, "again": shown})
    middle = figure.axes[1]
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[::-1, :, :3].astype(float)
    frame = middle.get_window_extent()
    pixels = image[int(frame.y0) : int(frame.y1), int(frame.x0) : int(frame.x1)].reshape(-1, 3)
    for line in middle.lines[:3]:
        color = 255 * np.array(to_rgb(line.get_color()))
        assert np.sum(np.abs(pixels - color).max(axis=1) < 40) > 50


@pytest.mark.parametrize("worst", [1e-8, 1e-3, 1.0, 40.0])
def test_panels_hold_every_response_that_does_not_run_away(worst: float):
    problem = make_problem()
    record = joint_responses(problem, make_fit(problem))[0]
    wave = np.sin(record.time * 5)
    simulated = {
        "good": record.measured + np.radians(1e-9) * wave,
        "bad": record.measured + np.radians(worst) * wave,
    }
    upper, middle, _ = draw_with(record, simulated).axes
    for axes in (upper, middle):
        low, high = axes.get_ylim()
        drawn = np.concatenate([line.get_ydata() for line in axes.lines if len(line.get_ydata()) > 2])
        assert low < drawn.min()
        assert drawn.max() < high
        assert high - low < 1.3 * max(np.ptp(drawn), 1e-6)


def test_a_joint_at_rest_is_drawn_without_its_rounding():
    problem = make_problem()
    record = joint_responses(problem, make_fit(problem))[0]
    rest = replace(record, measured=0.5 + 1e-16 * np.sin(record.time))
    figure = draw_with(rest, {"rests": rest.measured, "moves": rest.measured + 0.01 * record.time})
    check(figure)
    assert all(np.ptp(axes.get_ylim()) > 0.5 for axes in figure.axes[:2])
    alone = draw_with(rest, {"rests": rest.measured})
    check(alone)
    assert np.ptp(alone.axes[0].get_ylim()) > 0.01


@pytest.mark.parametrize("names", [("search",), ("search", "refined")])
@pytest.mark.parametrize("count", [1, 10])
def test_runs_show_one_dot_per_seed(names: tuple[str, ...], count: int):
    problem = make_problem(fixed={"D": 80.0})
    rng = np.random.default_rng(0)
    theta = problem.parameters.from_unit(rng.uniform(0, 1, (count, 3)))
    figure = spread(problem.parameters, {n: (theta, rng.uniform(0.01, 0.02, count)) for n in names})
    check(figure)
    upper, lower = figure.axes
    for axes, rows in ((upper, 4), (lower, 1)):
        dots = [line for line in axes.lines if line.get_marker() in ("o", "D") and len(line.get_xdata())]
        assert len(dots) == rows * len(names)
        assert all(len(line.get_xdata()) == count for line in dots)


def test_runs_say_what_lies_at_a_bound_or_has_no_effect_and_may_have_diverged():
    problem = make_problem()
    theta = problem.parameters.from_unit(np.array([[1.0, 0.5, 0.3, 0.0], [1.0, 0.6, 0.3, 0.4]]))
    figure = spread(problem.parameters, {"search": (theta, np.full(2, np.nan))}, ["M1"])
    check(figure)
    texts = [text.get_text() for text in figure.axes[0].texts]
    for words in ("at upper bound in 2 of 2 runs", "no effect", "at lower bound in 1 of 2 runs"):
        assert texts.count(words) == 1


def test_matplotlib_is_left_as_it_was_and_its_settings_do_not_matter():
    fit = make_fit(make_problem())

    def drawn() -> tuple[bytes, bytes]:
        with style():
            return rendered(pareto(fit, ObjectiveSettings()))

    plain = drawn()
    with mpl.rc_context({"font.size": 30.0, "svg.fonttype": "none", "axes.grid": False}):
        before = dict(mpl.rcParams)
        assert drawn() == plain
        assert dict(mpl.rcParams) == before


def test_a_dollar_in_a_name_is_a_dollar():
    problem = make_problem(("a$x^2$.csv",))
    figure = draw(joint_responses(problem, make_fit(problem))[0])
    named = [text for text in figure.findobj(Text) if "$" in text.get_text()]
    assert named
    assert not any(text.get_parse_math() for text in named)


@pytest.mark.parametrize("samples", [1, 7, 2 * MAX_BINS, 2 * MAX_BINS + 1, 100_003])
def test_a_decimated_curve_keeps_its_ends_extremes_and_gaps(samples: int):
    rng = np.random.default_rng(0)
    time, curve = np.arange(samples) * 0.01, rng.normal(size=samples).cumsum()
    at, kept = decimated(time, curve)
    assert len(kept) <= max(2 * MAX_BINS + 2, 3)
    assert np.array_equal(curve[np.searchsorted(time, at)], kept)
    assert (kept[0], kept[-1], kept.min(), kept.max()) == (curve[0], curve[-1], curve.min(), curve.max())
    gap = np.where(np.arange(samples) > samples // 2, np.nan, curve)
    if samples > 1:
        assert np.isnan(decimated(time, gap)[1]).any()


def make_surface(estimate: tuple[float, float]) -> Surface:
    parameters = make_problem().parameters.parameters[:2]
    values = np.union1d(np.linspace(0.05, 0.5, 9), estimate[0]), np.linspace(50.0, 500.0, 7)
    error = np.abs(values[0][:, None] - estimate[0]) + np.abs(values[1] - 200.0) / 1e3
    return Surface(parameters, values, error, estimate, abs(estimate[1] - 200.0) / 1e3)


def test_a_surface_marks_the_estimate_and_the_lowest_point_where_they_are():
    for estimate in ((0.2, 200.0), (0.21, 260.0)):
        surface = make_surface(estimate)
        figure = contours(surface, ObjectiveSettings())
        check(figure)
        marks = {line.get_label().split(" (")[0]: line for line in figure.axes[0].lines}
        for label, (x, y, *_) in (("estimate", estimate), ("lowest point drawn", surface.lowest)):
            assert (marks[label].get_xdata()[0], marks[label].get_ydata()[0]) == pytest.approx((x, y))
        assert surface.lowest[2] <= surface.estimate_error


def test_a_profile_is_drawn_over_its_interval_and_crosses_the_threshold_at_its_ends():
    uncertainty = make_uncertainty(problem := make_problem(), make_fit(problem).best.theta)
    centre, deviation = uncertainty.theta[0], uncertainty.standard_deviation[0]
    values = centre + deviation * np.linspace(-40, 40, 13)
    deviance = ((values - centre) / deviation) ** 2
    half = deviation * np.sqrt(THRESHOLD)
    profile = Profile("K", values, deviance, (centre - half, centre + half), uncertainty.theta)
    shown = identifiability(problem, uncertainty)
    figure = draw_profiles(UncertaintyStudy(problem, "test", uncertainty, shown, (profile,)))
    check(figure)
    (axes,) = figure.axes
    assert np.ptp(axes.get_xlim()) < 4 * half
    (curve,) = [line for line in axes.lines if line.get_label() == "profile"]
    assert np.interp(centre + half, curve.get_xdata(), curve.get_ydata()) == pytest.approx(
        THRESHOLD, rel=0.02
    )
