import pytest
from scipy.optimize import least_squares


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
