"""What a fit states of its quantities, keeps in its folder, and gives back."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import SMALL
from made_logs import HYDRAULIC, noisy, stepped

import hydroid
from hydroid import load_settings
from hydroid.commands.fit import FitResult
from hydroid.errors import RunError
from hydroid.estimate import FitSummary
from hydroid.posterior.posterior import stored_posterior
from hydroid.run.record import load_record
from hydroid.settings.load import load

HELD = ("I_max", "I_min", "A", "C")


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> FitResult:
    held = {f"parameters.{name}.fixed": HYDRAULIC[name] for name in HELD}
    settings = load_settings("article-hyd", SMALL | held)
    truth = {name: HYDRAULIC[name] for name in settings.parameters if name in HYDRAULIC}
    log = noisy(
        stepped(settings, truth, [0.0, 60.0, -40.0, 90.0, -80.0, 30.0]),
        0.05,
        exact_start=False,
    )
    return hydroid.fit(settings, log, tmp_path_factory.mktemp("fit") / "run")


def test_the_summary_holds_quantities_curves_and_covariance_as_the_file_does(fitted):
    summary = fitted.summary
    assert load(fitted.folder / "estimate.yaml", FitSummary) == summary
    assert summary.plain()["schema"] == 1
    json.dumps(summary.plain(), allow_nan=False)
    # all masses are fixed: what no free parameter changes is not stated
    assert not any("gravity" in name for name in summary.quantities)
    ratio = summary.quantities["shoulder_area_ratio"]
    values = summary.values
    assert ratio.value == pytest.approx(values["A_A"] / values["A_B"])
    assert ratio.interval[0] < ratio.value < ratio.interval[1]
    speed = summary.curves["shoulder_speed"]
    assert len(speed.at) == len(speed.value) == len(speed.interval)
    at_50 = dict(zip(speed.at, speed.value, strict=True))[50.0]
    assert summary.quantities["shoulder_speed_50_positive"].value == pytest.approx(
        at_50, rel=1e-5
    )


def test_the_record_in_memory_is_that_of_the_run_folder(fitted):
    ours = fitted.record
    stored = load_record(fitted.folder).result
    for predicted, read in zip(ours.fitted, stored.fitted, strict=True):
        np.testing.assert_array_equal(predicted.response, read.response)
        np.testing.assert_array_equal(predicted.log.angle, read.log.angle)
    np.testing.assert_array_equal(ours.history, stored.history)
    for array, read in zip(ours.front, stored.front, strict=True):
        np.testing.assert_array_equal(array, read)
    assert [vars(effort) for effort in ours.refinements] == [
        vars(e) for e in stored.refinements
    ]
    assert ours.segments.keys() == stored.segments.keys()
    assert {j: [*models] for j, models in ours.baselines.items()} == {
        j: [*models] for j, models in stored.baselines.items()
    }


def test_the_kept_precision_gives_the_intervals_of_the_fit(fitted):
    model = hydroid.load_identified(fitted.folder)
    kept = stored_posterior(model)
    i, j = (model.settings.parameter_set().names.index(name) for name in ("A_A", "A_B"))
    found = kept.propagate(lambda theta: theta[:, [i]] / theta[:, [j]], positive=True)
    stated = fitted.summary.quantities["shoulder_area_ratio"].interval
    np.testing.assert_allclose(found.interval[0], stated, rtol=1e-5)


def test_other_values_or_free_parameters_are_not_the_fits(fitted):
    changed = hydroid.load_identified(
        fitted.folder,
        overrides={"parameters.A_A.fixed": fitted.summary.values["A_A"]},
    )
    assert stored_posterior(changed) is None
    with pytest.raises(RunError, match="holds no covariance of these parameters"):
        hydroid.quantity(changed, lambda plant: plant.time)
    moved = replace(fitted.model, theta=1.01 * fitted.model.theta)
    assert stored_posterior(moved) is None


def test_a_quantity_of_ones_own_has_the_shape_of_its_function(fitted, tmp_path):
    def speeds(plant: hydroid.Plant) -> np.ndarray:
        plant.reset("study")
        angle = np.array([plant.step([0, 50, 0, 0, 0, 0, 0]) for _ in range(40)])
        return np.degrees(np.diff(angle[[0, 20, 39], 1])).reshape(2, 1)

    found = hydroid.quantity(fitted.folder, speeds, unit="deg")
    assert found.value.shape == found.sd.shape == (2, 1)
    assert found.interval.shape == (2, 1, 2)
    assert np.all(
        (found.interval[..., 0] < found.value) & (found.value < found.interval[..., 1])
    )
    hydroid.load_plant(fitted.folder).save(tmp_path / "plant")
    saved = hydroid.quantity(tmp_path / "plant", speeds)
    np.testing.assert_array_equal(saved.interval, found.interval)
