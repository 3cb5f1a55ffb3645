"""An estimate with its settings is resolved in one way, and `estimate.yaml` comes back
as it was written."""

import pkgutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from made_logs import TRUTH

import hydroid
from hydroid import load_settings
from hydroid.errors import RunError, SettingsError
from hydroid.estimate import FitSummary, ParameterEstimate, write_estimate
from hydroid.identified_model import load_identified, write_settings
from hydroid.problem.bindings import Bindings
from hydroid.settings.arm import Arm


def nominal(source: Path | None = None, **overrides: object):
    model = load_identified(source, None, overrides, nominal=True)
    return model, Bindings(model.settings).candidates(model.theta[None])


def run_folder(folder: Path, final: str) -> Path:
    fixed = {
        f"parameters.{name}.fixed": value
        for name, value in TRUTH.items()
        if name != "K"
    }
    settings = load_identified(None, "fit-hyd", fixed, nominal=True).settings
    write_settings(folder, settings)
    estimate = {
        n: ParameterEstimate(value=v, unit="?") for n, v in TRUTH.items() if n != "K"
    }
    write_estimate(folder, FitSummary(stage="hyd", estimate=estimate, final=final))
    return folder


def test_values_are_taken_and_what_is_not_named_is_nominal(tmp_path: Path, arm: Arm):
    file = tmp_path / "p.yaml"
    file.write_text("A_A: 900\nM3: 20\n")
    model, found = nominal(file)
    _, plain = nominal()
    assert found.joints.area_a[0] == pytest.approx(
        [8e-4, 9e-4, 1e-3, 1e-5, 5e-4, 8e-6, 3e-4]
    )
    assert (found.joints.area_b == plain.joints.area_b).all()
    assert found.mass[0] == pytest.approx(np.where(np.arange(8) == 2, 20.0, arm.masses))
    assert (plain.mass[0] == arm.masses).all()
    assert "A_B" in model.nominal
    assert "A_A" not in model.nominal
    fixed = nominal(None, **{"parameters.A_A.fixed": 700})[1].joints
    assert fixed.area_a[0, 1] == 7e-4


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("AA: 900\n", "unknown parameter 'AA'"),
        ("K: 1\n", "'D' is missing"),
        ("K: -1\n", "a number from 0"),
        ("parameters: 3\n", "is no estimate"),
        ("estimate: {K: 3}\nstage: mech\n", "estimate.K: must be a mapping"),
    ],
)
def test_values_that_cannot_be_used_are_refused(tmp_path: Path, text: str, says: str):
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(SettingsError, match=says):
        load_identified(tmp_path / "p.yaml")


@pytest.mark.parametrize("given", ["parameters.D.fixed", "parameters.D", "parameters"])
def test_an_override_cannot_give_a_parameter_another_value_than_the_estimate(
    tmp_path: Path, given: str
):
    """It was the estimate's that counted, in silence."""
    folder = run_folder(tmp_path / "run", "refined")
    value = load_identified(folder).values["D"]
    parameters = yaml.safe_load((folder / "config.yaml").read_text())["parameters"]
    for wrong in (value, value + 1.0):
        parameters["D"]["fixed"] = wrong
        whole = {"parameters": parameters, "parameters.D": parameters["D"]}
        changes = {given: whole.get(given, wrong)}
        if wrong == value:
            assert load_identified(folder, overrides=changes).values["D"] == value
            continue
        with pytest.raises(SettingsError, match=r"D is fixed at .*estimate's value is"):
            load_identified(folder, overrides=changes)


def test_an_override_of_what_the_estimate_sets_is_said_to_change_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    values = {"dead": 10.0, "one": 2.0}
    quantities = {
        "dead": {"quantity": "dead_band", "bounds": [0, 50]},
        "one": {"quantity": "overlap", "joints": [2], "bounds": [0, 50]},
    }
    settings = load_settings("fit-hyd", {"parameters": quantities})
    write_settings(tmp_path, settings)
    (tmp_path / "values.yaml").write_text(yaml.safe_dump(values))
    caplog.set_level("INFO", "hydroid")
    for name, says in (("dead_band", True), ("dead_band_a", True), ("overlap", False)):
        caplog.clear()
        load_identified(tmp_path / "values.yaml", None, {f"hydraulics.{name}": 1.0})
        text = f"--set hydraulics.{name} changes nothing: the estimate has dead"
        assert (text in caplog.text) == says


def test_a_folder_without_an_estimate_is_refused(tmp_path: Path):
    with pytest.raises(RunError, match="holds no estimate"):
        load_identified(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(RunError, match="holds no estimate yet"):
        load_identified(tmp_path)


@pytest.mark.parametrize(("final", "free"), [("refined", False), ("joint", True)])
def test_a_joint_refinement_frees_what_was_fixed(
    tmp_path: Path, final: str, free: bool
):
    folder = run_folder(tmp_path / "run", final)
    for source in (folder, folder / "estimate.yaml"):
        model = load_identified(source)
        parameters = model.settings.parameter_set()
        assert parameters.free[parameters.names.index("M3")] == free
        assert model.values["M3"] == 22.5
        assert model.name == "run"


def test_no_public_name_is_a_module_too():
    """Importing the module would put it in the place of the name."""
    modules = {module.name for module in pkgutil.iter_modules(hydroid.__path__)}
    assert not modules & set(hydroid.__all__)
