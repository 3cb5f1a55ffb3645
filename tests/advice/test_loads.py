"""A load that nobody has weighed is found at the tip, with an interval, and is no link's
mass."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import SMALL
from made_logs import noisy
from two_joints import FIT, TRUTH, drive, two_joints

import hydroid
from hydroid.advice.adaptation import steps
from hydroid.advice.loads import Load, asked_loads
from hydroid.identified_model import identified
from hydroid.log import Log
from hydroid.progress import no_progress
from hydroid.settings.arm import TIP_LOAD
from hydroid.settings.fit import FitSettings

MASS = 150.0
pytestmark = pytest.mark.usefixtures("no_report")


def loaded(settings: FitSettings, seed: int, mass: float = MASS) -> Log:
    """A log of the machine that carries a mass which the settings do not state."""
    carries = settings.changed({"payloads": {f"drive_{seed}.csv": mass}})
    return drive(carries, seed)


def test_a_load_at_the_tip_is_found_where_all_else_is_known(tmp_path):
    settings = two_joints(tmp_path)
    model = identified(settings, TRUTH, "a fit")
    logs = [loaded(settings, 3), drive(settings, 4)]
    (load,) = asked_loads(model, logs)
    assert load.log == "drive_3.csv"
    assert load.mass == pytest.approx(MASS, rel=1e-3)
    assert load.low < load.mass < load.high


def test_pressures_that_a_fit_compares_narrow_the_load(tmp_path):
    columns = {"column": ["pA{joint}", "pB{joint}"], "unit": "MPa"}
    found = list[Load]()
    for name, weight in (("angles", 0.0), ("pressures", 0.1)):
        (tmp_path / name).mkdir()
        settings = two_joints(
            tmp_path / name,
            log=FIT["log"] | {"pressure": columns},
            objective=FIT["objective"] | {"pressure_weight": weight},
        )
        # angles that say little
        log = noisy(loaded(settings, 3), 3.0, exact_start=False)
        if log.pressure is not None:
            noise = np.random.default_rng(1).normal(0.0, 2e4, log.pressure.shape)
            log = replace(log, pressure=log.pressure + noise)
        found += asked_loads(identified(settings, TRUTH, "a fit"), [log])
    by_angles, by_pressures = found
    for load in found:
        assert load.mass == pytest.approx(MASS, rel=0.05)
    width = by_pressures.high - by_pressures.low
    assert width < 0.5 * (by_angles.high - by_angles.low)


def test_what_settings_state_is_not_asked_for_again(tmp_path):
    settings = two_joints(tmp_path, payloads={"drive_3.csv": MASS})
    model = identified(settings, TRUTH, "a fit")
    assert asked_loads(model, [drive(settings, 3)]) == []


def test_an_adaptation_frees_the_load_before_any_link(tmp_path):
    settings = two_joints(tmp_path)
    model = identified(settings, TRUTH, "a fit")
    log = loaded(settings, 3)
    path = steps(model, [log], (), no_progress)
    # of eight such logs two free a link's mass after it, by chance
    assert [step["parameter"] for step in path[:2]] == ["", TIP_LOAD]
    result = hydroid.adapt(log, fit=model, out=tmp_path / "run")
    assert result.summary.values[TIP_LOAD] == pytest.approx(MASS, rel=0.1)
    assert "payloads={drive_3.csv: 1" in "".join(map(str, result.lines))
    # the run steps as the machine with its load does
    plant = hydroid.load_plant(tmp_path / "run")
    truth = hydroid.Plant(identified(settings, TRUTH, "truth"), payload=MASS)
    angles = [
        [one.reset([0.2, 0.2])] + [one.step([60.0, 50.0]) for _ in range(20)]
        for one in (plant, truth)
    ]
    np.testing.assert_allclose(*angles, atol=np.radians(0.3))


def test_validate_proposes_the_load_of_a_log_that_errs_with_its_interval(tmp_path):
    settings = two_joints(tmp_path)
    fitted = hydroid.fit_hyd(
        [drive(settings, 0), drive(settings, 1)],
        config=tmp_path / "fit.yaml",
        set=SMALL,
        out=tmp_path / "run",
    )
    plain = hydroid.validate(replace(drive(settings, 5), source="b.csv"), fit=fitted)
    assert plain.content["findings"] == []
    heavy = loaded(settings, 3)
    said = hydroid.validate(heavy, fit=fitted).content["findings"]
    assert [one["kind"] for one in said] == ["load asked for"]
    (load,) = asked_loads(hydroid.load_identified(tmp_path / "run"), [heavy])
    assert load.low < MASS < load.high
    # what else the fit leaves open widens the interval
    (known,) = asked_loads(identified(settings, TRUTH, "a fit"), [heavy])
    assert load.high - load.low > known.high - known.low
