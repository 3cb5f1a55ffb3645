"""The rulers of `make bench B=strangers`: the floor, and the exact estimator."""

import sys
from pathlib import Path

import numpy as np
import pytest

# last: its coverage.py is no package
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from exact_fit import exact_fit, moved, numbers, respond
from stranger import (
    STEP,
    Machine,
    Recording,
    errors,
    floor,
    read_recording,
    rms_deg,
    stick,
    write_machine,
)

SEED = 5


def made(number: int) -> tuple[Machine, Recording]:
    """A machine with what it does in ten seconds, without noise, at every step of its
    integration."""
    rng = np.random.default_rng([SEED, number])
    machine = Machine(rng, number)
    command, angle = stick(rng, machine, 10.0)
    return machine, Recording(np.arange(len(command)) * STEP, command, angle)


@pytest.mark.parametrize("number", [0, 3])
def test_a_machine_whose_log_lost_nothing_has_no_floor(number):
    machine, log = made(number)
    assert floor(machine, log, log.time, log.angle) == pytest.approx(0, abs=1e-9)


def test_the_floor_of_a_machine_that_stands_is_its_noise():
    machine, log = made(3)
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 0.01, log.angle.shape)
    still = Recording(log.time, np.zeros_like(log.command), log.angle[0] + noise)
    still.command[len(noise) // 2 :] = 1e-9  # below every dead band
    expected = np.full(machine.joints, np.degrees(0.01))
    assert floor(machine, still, still.time, still.angle) == pytest.approx(
        expected, rel=0.1
    )


def test_commands_between_two_samples_are_lost_to_the_floor():
    machine, log = made(3)
    slow = Recording(log.time[::50], log.command[::50], log.angle[::50])
    moves = np.ptp(log.angle, axis=0) > 0
    assert np.all(floor(machine, slow, log.time, log.angle)[moves] > 0.01)


def test_an_exact_estimator_finds_back_to_the_truth():
    truth, log = made(3)
    rng, places = np.random.default_rng(1), numbers(truth)
    away = moved(truth, places, rng.normal(0, 0.3, len(places)))
    noisy = Recording(
        log.time, log.command, log.angle + rng.normal(0, 1e-4, log.angle.shape)
    )
    before, after = (
        rms_deg(errors(respond(one, log), log.time, log.angle))
        for one in (away, exact_fit(away, [noisy]))
    )
    moves = np.ptp(log.angle, axis=0) > 0
    assert np.all(after[moves] < 0.1 * before[moves])


def test_only_what_a_machine_has_is_fitted():
    machine, _ = made(3)  # neither pump nor oil
    names = {name for name, _ in numbers(machine)}
    assert not names & {"droop", "draw", "stiff", "ratio"}
    assert {"dead", "exponent", "full", "delay", "lag", "load", "friction"} <= names
    loaded = [place for name, (*place,) in numbers(machine) if name == "load"]
    assert len(loaded) == machine.joints - sum(machine.vertical)


def test_a_written_log_is_read_as_it_was_recorded(tmp_path):
    rng = np.random.default_rng([SEED, 3])
    machine = Machine(rng, 3)
    *_, last = write_machine(tmp_path, machine, rng)
    log = read_recording(last)
    assert log.command.shape == log.angle.shape == (len(log.time), machine.joints)
    assert log.time[0] == 0
    assert log.held[0] == pytest.approx(log.command[0])
    middle = (machine.ends.mean(axis=1) - log.start) / np.ptp(machine.ends, axis=1)
    assert np.all(np.abs(middle) < 0.16)  # it starts within the middle third


def test_the_curves_of_bent_valves_are_fitted_too():
    machine = Machine(
        np.random.default_rng([44, 0]), 0, np.random.default_rng([44, 0, 2])
    )
    places = [place for place in numbers(machine) if place[0] == "rises"]
    assert len(places) == machine.joints * 2 * 4
    other = moved(machine, places, np.resize([-3.0, 3.0], len(places)))
    assert (np.diff(other.curve, axis=2) >= 0).all()
    np.testing.assert_allclose(other.curve[:, :, [0, -1]], [[[0, 1]] * 2] * 5)
    assert np.abs(other.curve - machine.curve).max() > 0.05
