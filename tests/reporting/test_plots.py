"""Figures: they hold what they claim, and stand whatever a fit looks like."""

import json
from dataclasses import replace

import numpy as np
import pytest
from report_fits import make_fit, make_problem

from hydroid.fitting.validation import fitted
from hydroid.prediction import OilTrace
from hydroid.reporting.chart import Chart, Mark, Panel
from hydroid.reporting.figure import figure, saved, style
from hydroid.reporting.page_file import plain
from hydroid.reporting.response_report import draw_joints, draw_response
from hydroid.reporting.search_report import learning, pareto

# a warning of matplotlib's is a figure gone wrong
pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(autouse=True)
def _styled():
    with style():
        yield


def drawn_front(problem, fit) -> Chart:
    segments = {
        name: fit.estimates[name].segments for name in (fit.final, *fit.estimates)
    }
    return pareto(fit.front[1], segments, problem.settings.objective)


def draw_all(problem, fit) -> list[Chart]:
    objective = problem.settings.objective
    return [
        *(
            draw_response("one", joint, [p], 1000)
            for p in fitted(fit)
            for joint in p.joints
        ),
        learning(fit.history, objective),
        drawn_front(problem, fit),
    ]


def check(chart: Chart) -> None:
    json.dumps(chart, default=plain, allow_nan=False)
    drawn = figure(chart)
    drawn.draw_without_rendering()
    for axes in drawn.axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def labelled(panel: Panel, start: str = "") -> dict[str, Mark]:
    return {mark.label: mark for mark in panel.marks if mark.label.startswith(start)}


TWO = {"K": (0.05, 0.5), "D": (80.0, 80.0)}
SHAPES = {
    "one segment, one parameter, simple GA": (
        {"segments": 1, "parameters": TWO, "fixed": {"D": 80.0}},
        {"names": ("best", "refined")},
    ),
    "several logs and outputs": (
        {"sources": ("a.csv", "b.csv"), "outputs": (1, 2)},
        {"names": ("best",)},
    ),
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
    "fixed without bounds, relative": (
        {"parameters": TWO, "fixed": {"D": 80.0}, "relative": True},
        {},
    ),
    "names that are markup": ({"sources": ("<b>&_%$a$.csv",)}, {}),
    "names without glyphs": ({"sources": ("日志🦾.csv",)}, {}),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_any_fit_can_be_drawn(shape: str):
    of_problem, of_fit = SHAPES[shape]
    problem = make_problem(**of_problem)
    fit = make_fit(problem, **of_fit)
    for drawn in draw_all(problem, fit):
        if shape == "names without glyphs":
            saved(figure(drawn))  # with boxes, without a warning
        else:
            check(drawn)


def test_what_is_not_finite_is_left_out():
    problem = make_problem()
    fit = make_fit(problem)
    fit.history[:3, 4:] = fit.front[1][0, :-1] = np.inf
    for drawn in draw_all(problem, fit):
        check(drawn)
    for history in (np.full((2, 6), np.inf), np.empty((0, 6))):
        check(learning(history, problem.settings.objective))


def test_a_response_shows_measured_and_simulated_angle_residual_pressures_and_command():
    problem = make_problem()
    fit = make_fit(problem)
    (one,) = fitted(fit)
    log = one.log
    pressed = replace(log, pressure=np.tile([5e6, 2e6], (*log.angle.shape, 1)))
    upper, middle, pressure, lower = draw_response(
        "one", 2, [replace(one, log=pressed)], 1000
    ).panels
    assert labelled(pressure)["chamber A, measured"].y == pytest.approx(
        np.full(len(log.time), 50.0)
    )
    assert len(draw_response("one", 2, [one], 1000).panels) == 3  # there are none
    simulated = replace(one, oil=steady_oil(len(log.time)))
    *_, drawn, flows, _ = draw_response("one", 2, [simulated], 1000).panels
    assert [mark.label for mark in drawn.marks] == [
        "chamber A, simulated",
        "chamber B, simulated",
        "pump's line",
    ]
    assert drawn.marks[0].y == pytest.approx(50.0)
    assert drawn.marks[2].y == pytest.approx(120.0)
    into_a, out_of_b = flows.marks[1:]
    assert into_a.y == pytest.approx(60.0)
    assert out_of_b.y == pytest.approx(-30.0)
    measured = np.degrees(log.angle[:, 1])
    assert labelled(upper)["measured"].y == pytest.approx(measured)
    simulated = np.degrees(fit.best.responses[0][:, 0])
    ((label, mark),) = labelled(upper, "refined (").items()
    assert mark.y == pytest.approx(simulated)
    assert f"{np.degrees(fit.best.rms):.3g}"[:3] in label
    assert labelled(middle)[label].y == pytest.approx(measured - simulated)
    band = labelled(middle)["refined, 95 % band"]
    assert np.all(band.end > 0)
    assert np.array_equal(band.y, -band.end)
    assert np.array_equal(lower.marks[0].y, log.command[:, 1])


def steady_oil(samples: int) -> OilTrace:
    """One joint that takes 60 L/min into A and gives 30 L/min out of B, on a pump."""
    pressure = np.full((samples, 1, 2), 50e5)
    flow = np.tile([1e-3, -0.5e-3], (samples, 1, 1))
    return OilTrace(pressure, flow, np.full(samples, 120e5))


def test_all_joints_of_a_log_show_what_they_take_from_the_pump():
    problem = make_problem()
    fit = make_fit(problem)
    (one,) = fitted(fit)
    with_oil = replace(one, oil=steady_oil(len(one.log.time)))
    arm = problem.settings.arm
    _, flows, pump, commands = draw_joints("all", arm, [with_oil], 1000).panels
    # one label for flow and command of a joint: both are hidden together
    name = arm.joint_names[1]
    assert flows.marks[0].label == commands.marks[0].label == name
    assert flows.marks[0].y == pytest.approx(60.0)
    assert pump.marks[0].y == pytest.approx(120.0)
    assert len(draw_joints("all", arm, [one], 1000).panels) == 2


def test_every_kind_of_mark_can_be_drawn():
    x = np.arange(1.0, 4.0)
    marks = (
        Mark("step", x, x),
        Mark("points", x, x, label="p"),
        Mark("band", x, x, x + 1, alpha=0.3),
        Mark("spans", x[:1], end=x[1:2]),
        Mark("rule", y=x[:1]),
    )
    check(Chart((Panel("x", "y", marks), Panel("x", "", marks[1:4]))))


@pytest.mark.parametrize("samples", [1, 7, 2000, 2001, 100_003])
def test_a_thinned_curve_keeps_its_ends_extremes_and_gaps(samples: int):
    rng = np.random.default_rng(0)
    time, curve = np.arange(samples) * 0.01, rng.normal(size=samples).cumsum()
    thin = Mark("line", time, curve).thinned(1000)
    kept = thin.y
    assert len(kept) <= 2002
    assert np.array_equal(curve[np.searchsorted(time, thin.x)], kept)
    assert (kept[0], kept[-1], kept.min(), kept.max()) == (
        curve[0],
        curve[-1],
        curve.min(),
        curve.max(),
    )
    band = Mark("band", time, -np.abs(curve), np.abs(curve)).thinned(1000)
    assert (band.y.min(), band.end.min()) == (-np.abs(curve).max(), np.abs(curve).min())
    gap = np.where(np.arange(samples) > samples // 2, np.nan, curve)
    if samples > 1:
        assert np.isnan(Mark("line", time, gap).thinned(1000).y).any()


def test_all_joints_of_a_log_share_one_axis_of_time():
    problem = make_problem(outputs=(2, 3))
    (one,) = fitted(make_fit(problem))
    chart = draw_joints("all", problem.settings.arm, [one], 300)
    assert chart.linked
    assert [panel.y for panel in chart.panels] == [
        "shoulder [deg]",
        "elbow [deg]",
        "command [%]",
    ]
    labels = {mark.label for mark in chart.panels[-1].marks}
    assert labels == {"shoulder", "elbow"}
    measured, simulated = chart.panels[0].marks
    assert measured.y - simulated.y == pytest.approx(np.degrees(one.error(2)))
    check(chart)
