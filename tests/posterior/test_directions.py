"""The directions that the article's protocol leaves open are found and named, and pins
close them."""

import numpy as np
import pytest
from made_logs import COILS, HYDRAULIC, TRUTH as MECH, noisy, stepped

from hydroid import load_settings
from hydroid.posterior.identifiability import Identifiability, identifiability
from hydroid.posterior.uncertainty import (
    WEAK_ABOVE,
    Flag,
    Source,
    Uncertainty,
    uncertainty,
)
from hydroid.problem.problem import Problem

NOISE_DEG = {"article-mech": 0.1, "article-hyd": 0.01}
"""so little that ten seconds determine what is not exactly open"""
OPEN = {f"parameters.{name}.fixed": None for name in ("F1", "x1", "x2")}
LEVELS = [60.0, -80.0, 30.0, 0.0, -40.0, 70.0, -60.0, 20.0]


def look(
    config: str, truth: dict[str, float], **changes
) -> tuple[Problem, Uncertainty, Identifiability]:
    """The article's protocol, ten seconds of it: joint 2 driven and measured with some
    noise."""
    settings = load_settings(config, changes)
    levels = LEVELS if config == "article-mech" else [0.4 * level for level in LEVELS]
    problem = Problem(
        settings, [noisy(stepped(settings, truth, levels, 1.25), NOISE_DEG[config])]
    )
    told = uncertainty(problem, problem.parameters.vector(truth, "truth"))
    return problem, told, identifiability(problem, told)


def flags_of(problem: Problem, told: Uncertainty) -> dict[str, Flag]:
    return {
        n: s.flag for n, s in zip(problem.parameters.names, told.status, strict=True)
    }


@pytest.fixture(scope="module")
def mech():
    return look("article-mech", MECH)


def test_m1_has_no_effect_and_one_scale_of_all_is_open(mech):
    problem, told, found = mech
    assert "M1" in found.alone
    # but for the known jaws K, D, S and the masses scale by one factor
    scale = max(found.combinations, key=lambda one: len({"K", "D", "S"} & one.keys()))
    assert {"K", "D", "S"} <= scale.keys()
    np.testing.assert_allclose(
        [scale["D"] / scale["K"], scale["S"] / scale["K"]], 1.0, atol=0.05
    )
    assert flags_of(problem, told)["M1"] is Flag.NO_EFFECT
    assert flags_of(problem, told)["K"] is Flag.UNIDENTIFIABLE
    assert np.isinf(told.interval[problem.parameters.names.index("K")]).all()
    assert 3 <= found.rank <= 5


def test_pins_close_directions_one_by_one(mech):
    _, _, free = mech
    held = {f"parameters.{name}.fixed": MECH[name] for name in MECH if name[0] == "M"}
    problem, told, found = look("article-mech", MECH, **held)
    assert found.rank == 3
    assert (found.alone, found.combinations) == ((), ())
    assert set(flags_of(problem, told).values()) == {Flag.IDENTIFIABLE, Flag.FIXED}
    inside = told.interval[:3] / np.array([0.2, 231.8, 53.4])[:, None]
    assert (np.abs(inside - 1) < WEAK_ABOVE * 2.1).all()
    # a plausible value of each mass instead, to 5 %: K, D, S are known about as well as
    # the masses
    masses = {name: value for name, value in MECH.items() if name[0] == "M"}
    priors = {
        name: {"of": name, "value": value, "sd": 0.05 * value}
        for name, value in masses.items()
    }
    problem, told, found = look("article-mech", MECH, priors=priors)
    assert found.rank == 9 > free.rank
    sources = {
        n: s.source for n, s in zip(problem.parameters.names, told.status, strict=True)
    }
    assert flags_of(problem, told)["M1"] is Flag.NO_EFFECT
    assert sources["M1"] is sources["M4"] is Source.PRIOR
    assert sources["K"] is Source.DATA  # it has no prior of its own
    deviation = dict(zip(problem.parameters.names, told.relative, strict=True))
    # its prior, and nothing else
    assert deviation["M1"] == pytest.approx(0.05, rel=0.02)
    assert deviation["K"] < 0.05
    assert deviation["M3"] < 0.05


@pytest.mark.parametrize(
    ("pins", "open_", "directions"),
    [
        (OPEN, {"I_max", "I_min", *COILS}, 3),
        ({"parameters.F1.fixed": None}, {"I_max", "I_min", "F1", "F2"}, 1),
        ({}, set(), 0),
        (OPEN | {"parameters.I_max.fixed": 0.9}, {*COILS}, 2),
        (
            OPEN | {"priors": {"rated": {"of": "I_max", "value": 0.9, "sd": 0.009}}},
            {*COILS},
            2,
        ),
    ],
)
def test_pins_close_the_null_directions_of_the_solenoids(pins, open_, directions):
    problem, told, found = look("article-hyd", HYDRAULIC, **pins)
    known = zip(problem.parameters.names, told.status, strict=True)
    assert {
        n
        for n, s in known
        if s.flag is Flag.UNIDENTIFIABLE and s.source is not Source.PRIOR
    } == open_
    assert np.sum(np.linalg.svd(told.posterior.root)[1] < 1) == directions
    assert told.linear.box.varied.sum() - found.rank >= directions


def test_a_parameter_that_drowns_in_the_noise_by_itself_is_named_so():
    held = {
        f"parameters.{name}.fixed": value
        for name, value in MECH.items()
        if name not in ("K", "M4")
    }
    _, told, found = look(
        "article-mech", MECH, **held, **{"objective.noise_deg": 300.0}
    )
    assert found.alone == ("K", "M4")
    assert told.errors.given.all()
