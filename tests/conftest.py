"""What several tests share: the shipped arm, and small logs made by simulation."""

# ruff: noqa: E402  # MuJoCo asks for OpenGL, and NumPy for threads, when it is imported

import os

from hydroid.commands.app import ONE_THREAD
from hydroid.viewer import choose_platform

# as the command line has it: threads of linear algebra that wait for each other take
# several times the processor's time, and more where other tests run beside
for variable in ONE_THREAD:
    os.environ.setdefault(variable, "1")
choose_platform()

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import settings
from made_logs import step_log
from scipy.optimize import least_squares

from hydroid.arm.model import load_model
from hydroid.hydraulics.records import nominal_joints
from hydroid.log import Log
from hydroid.rungs import rungs_of
from hydroid.settings.arm import Arm, load_arm
from hydroid.settings.hydraulics import HydraulicSettings
from hydroid.settings.problem import SimulationSettings
from hydroid.simulation import Candidates, Simulation
from hydroid.simulation.scenario import Scenario

SMALL = {"search.algorithm": "ga", "search.ga": {"population": 6, "generations": 2}}
"""settings of a search of a second"""

# an example's time says nothing on a machine that is busy with something else
settings.register_profile("hydroid", deadline=None)
settings.load_profile("hydroid")


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures take longest."""
    monkeypatch.setattr("hydroid.reporting.page_file.write_page", lambda *_: [])


@pytest.fixture
def no_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """The picture of an arm takes `init` half of its time."""
    monkeypatch.setattr("hydroid.project.project.arm_picture", lambda *_: b"")


@pytest.fixture
def short_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search for valves takes `init` most of the rest.

    It runs as ever but ends at once: for tests of all but the numbers it ends at.
    """

    def short(*problem: object, max_nfev: int, **how: object):
        return least_squares(*problem, max_nfev=1, **how)

    monkeypatch.setattr("hydroid.fitting.valve_start.least_squares", short)


@pytest.fixture(scope="session")
def arm() -> Arm:
    return load_arm("hydrolek")


@pytest.fixture(scope="session")
def spec(arm: Arm):
    return load_model(arm)


@pytest.fixture(scope="session")
def study_log(arm: Arm) -> Log:
    """Five seconds of steps on the shoulder from the study pose; the angles are the
    start pose throughout."""
    return step_log(arm.pose("study"), [60.0, -80.0, 30.0, 0.0, -40.0])


def candidates(
    arm: Arm, n: int, seed: int = 0, hydraulics: HydraulicSettings | None = None
) -> Candidates:
    """Random candidates around the article's true values; every joint shares gain,
    damping and stiffness."""
    rng = np.random.default_rng(seed)
    joints = np.ones((1, len(arm.joint_names)))
    values = np.tile(
        nominal_joints(arm, hydraulics or HydraulicSettings()), (n, 1)
    ).view(np.recarray)
    for name, value in (("gain", 0.2), ("damping", 231.8), ("stiffness", 53.4)):
        values[name] = rng.uniform(0.5, 2.0, (n, 1)) * value * joints
    return Candidates(values, rng.uniform(0.5, 2.0, (n, len(arm.masses))) * arm.masses)


def scattered(arm: Arm, n: int, **hydraulics: float) -> Candidates:
    rng, everyone = (
        np.random.default_rng(0),
        candidates(arm, n, hydraulics=HydraulicSettings(**hydraulics)),
    )
    for name in ("area_a", "area_b", "current_max", "onset_a", "onset_b", "force_1"):
        everyone.joints[name] *= rng.uniform(0.7, 1.4, (n, 1))
    return everyone


def simulation(
    spec,
    arm: Arm,
    log: Log,
    outputs: Sequence[int] = (1,),
    kind: str = "mech",
    **settings,
) -> Simulation:
    """Of some joints, from 0, in the stage `kind`."""
    how = SimulationSettings(**settings)
    (rung, *_) = rungs_of(kind, how.model)
    stepping = rung.stepping(how.steps_per_sample, HydraulicSettings().substeps)
    return Simulation(Scenario(spec, arm, log, list(outputs), how, stepping))


def replaced(candidates: Candidates, **joints: np.ndarray | float) -> Candidates:
    """The candidates with some quantities of their joints replaced, in SI."""
    values = candidates.joints.copy()
    for name, value in joints.items():
        values[name] = value
    return Candidates(values, candidates.mass)
