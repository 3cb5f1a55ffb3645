"""A refinement that goes on where it was killed: the journal answers what was simulated, and nothing else."""

import resource
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import step_log

from hydroid.fitting import journal as room
from hydroid.fitting.journal import Journal
from hydroid.fitting.multistart import Multistart
from hydroid.fitting.refinement import refine
from hydroid.jobs import load_settings
from hydroid.problem.problem import Memo, Problem
from hydroid.search.least_squares import Ending, Refinement
from hydroid.settings.search import RefinementSettings
from hydroid.simulating import simulate_log

TRUTH = {"K": 0.2, "D": 231.8, "S": 53.4, "M1": 4.6, "M2": 5.1, "M3": 22.5, "M4": 1.6, "M5": 4.0, "M6": 4.7}
HOW = RefinementSettings(iterations=4)


class Counted(Problem):
    """Counts what it simulates."""

    simulated = 0

    def residuals(self, theta):
        self.simulated += len(theta)
        return super().residuals(theta)


def stub(size: int = 50):
    """Residuals of a formula, with the candidates that were asked for."""
    asked: list[bytes] = []

    def residuals(theta):
        asked.append(theta.tobytes())
        return np.cos(np.outer(theta.sum(axis=1), np.arange(size)))

    return SimpleNamespace(measured=np.arange(float(size)), residuals=residuals, asked=asked)


@pytest.fixture(scope="module", params=["plain", "with what is known"])
def problem(request, arm):
    known = {} if request.param == "plain" else {"priors": {"link 3": {"of": "M3", "value": 22.0, "sd": 0.5}}}
    settings = load_settings("article-mech", known)
    log = simulate_log(settings, step_log(arm.pose("study"), [60.0, -80.0]), TRUTH, "truth")
    noise = np.random.default_rng(0).normal(0, 1e-3, log.angle.shape)
    return Counted(settings, [replace(log, angle=log.angle + noise)])


def start(problem) -> np.ndarray:
    return 0.8 * problem.parameters.vector(TRUTH, "truth")


def equal(one: Refinement, other: Refinement) -> bool:
    fields = ("cost_before", "cost_after", "evaluations", "iterations", "ending")
    return np.array_equal(one.point, other.point) and all(
        getattr(one, f) == getattr(other, f) for f in fields
    )


@pytest.mark.parametrize("stop", [1, 2, 30])
def test_an_interrupted_refinement_goes_on_without_loss(problem, tmp_path, stop):
    problem.simulated, told = 0, []
    whole = refine(problem, start(problem), HOW, told.append, Journal(tmp_path / "whole"))
    needed = problem.simulated

    def interrupt(simulated: int) -> None:
        if simulated >= stop:
            raise KeyboardInterrupt

    problem.simulated = 0
    with pytest.raises(KeyboardInterrupt):
        refine(problem, start(problem), HOW, interrupt, Journal(tmp_path / "j"))
    again = []
    parts = refine(problem, start(problem), HOW, again.append, Journal(tmp_path / "j"))
    assert equal(parts, whole)
    assert again == told
    assert problem.simulated == needed  # in both together
    assert (tmp_path / "j").stat().st_size < 1000  # the residuals are gone
    assert (tmp_path / "j").read_bytes() == (tmp_path / "whole").read_bytes()
    third = []
    assert equal(refine(problem, start(problem), HOW, third.append, Journal(tmp_path / "j")), whole)
    assert third == told[-1:]
    assert problem.simulated == needed


def test_another_refinement_is_another_question(problem, tmp_path):
    journal = Journal(tmp_path / "j")
    first = refine(problem, start(problem), HOW, lambda n: None, journal)
    elsewhere = refine(problem, 0.9 * start(problem), HOW, lambda n: None, journal)
    longer = HOW.model_copy(update={"iterations": 5})
    more = refine(problem, start(problem), longer, lambda n: None, journal)
    assert equal(first, refine(problem, start(problem), HOW, lambda n: None))
    assert not np.array_equal(first.point, elsewhere.point)
    assert more.iterations == 5 or more.ending is not Ending.ITERATIONS
    assert equal(first, refine(problem, start(problem), HOW, lambda n: None, Journal(tmp_path / "j")))


def filled(file) -> tuple[list[np.ndarray], list[int]]:
    """A journal of four answers; the questions, and the file's size after each."""
    questions = [np.random.default_rng(i).random((i + 1, 3)) for i in range(4)]
    sizes, recall = [], Journal(file).residuals(stub())
    for theta in questions:
        recall(theta)
        sizes.append(file.stat().st_size)
    return questions, sizes


def answers(file, questions) -> list[bool]:
    """Which questions the journal answers without simulating; every answer is compared with the truth."""
    problem = stub()
    recall = Journal(file).residuals(problem)
    for theta in questions:
        np.testing.assert_array_equal(recall(theta), stub().residuals(theta))
    return [theta.tobytes() not in problem.asked for theta in questions]


def test_a_torn_tail_costs_no_more_than_itself(tmp_path):
    file = tmp_path / "j"
    questions, sizes = filled(file)
    whole = file.read_bytes()
    for length in [0, 1, 40, 41, *np.random.default_rng(0).integers(0, len(whole), 60).tolist(), len(whole)]:
        file.write_bytes(whole[:length])
        assert answers(file, questions) == [size <= length for size in sizes]
        assert answers(file, questions) == [True] * 4  # what was missing has been added
        assert file.read_bytes() == whole


def test_a_flipped_bit_never_answers(tmp_path):
    file = tmp_path / "j"
    questions, sizes = filled(file)
    whole, rng = file.read_bytes(), np.random.default_rng(0)
    for place in rng.integers(0, len(whole), 200):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(damaged)
        assert answers(file, questions) == [size <= place for size in sizes]


@pytest.mark.parametrize("fault", ["disk", "limit"])
def test_a_journal_that_cannot_grow_ends_no_refine(tmp_path, fault, monkeypatch, caplog):
    file, limits = tmp_path / "j", resource.getrlimit(resource.RLIMIT_FSIZE)
    questions, sizes = filled(tmp_path / "whole")
    if fault == "limit":
        monkeypatch.setattr(room, "LARGEST", sizes[1] + 100)
    else:
        resource.setrlimit(resource.RLIMIT_FSIZE, (sizes[1] + 100, limits[1]))
    try:
        recall = Journal(file).residuals(stub())
        for theta in questions:
            np.testing.assert_array_equal(recall(theta), stub().residuals(theta))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "no more is kept" in caplog.text
    assert len(caplog.records) == 1
    assert answers(file, questions) == [True, True, False, False]


def test_results_survive_with_all_their_bits(tmp_path):
    found = Refinement(np.array([0.1, 1 / 3]), np.inf, 1e-300, 7, 3, Ending.JACOBIAN_FAILED)
    journal = Journal(tmp_path / "j")
    journal.end(b"q" * 16, found, 11)
    journal.residuals(stub())(np.ones((1, 3)))
    journal.end(b"r" * 16, found, 12)
    again = Journal(tmp_path / "j")
    for question, simulated in ((b"q" * 16, 11), (b"r" * 16, 12)):
        known = again.refined(question)
        assert known is not None
        assert known[1] == simulated
        assert equal(known[0], found)
    assert again.refined(b"s" * 16) is None


def test_an_interrupted_start_of_a_multistart_goes_on_without_loss(arm, tmp_path):
    changes = {
        "search.algorithm": "multistart",
        "search.multistart.starts": 2,
        "search.multistart.iterations": 4,
        "search.multistart.horizons": [1.0],
    }
    settings = load_settings("article-mech", changes)
    log = simulate_log(settings, step_log(arm.pose("study"), [60.0, -80.0]), TRUTH, "truth")
    problem, saved = Problem(settings, [log]), []

    def search(told, journal):
        found = Multistart(problem, settings.search, Memo(problem), told, journal)
        return found.run(None, lambda state, memo: saved.append(state), lambda row: None)

    whole = search(lambda n: None, None)
    simulated = whole.history[-1, 1]

    def interrupt(n: int) -> None:
        if n > simulated / 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(interrupt, Journal(tmp_path / "j"))
    parts = search(lambda n: None, Journal(tmp_path / "j"))
    np.testing.assert_array_equal(parts.history, whole.history)
    np.testing.assert_array_equal(parts.population.chromosomes, whole.population.chromosomes)
