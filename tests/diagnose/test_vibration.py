"""Spalls by the accelerometer: passes in the envelope over the angle, chance, place, length."""

from __future__ import annotations

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.bench.acquisition import acquired_signals
from elevon.bench.loaded import loaded_setups, run_loaded
from elevon.bench.procedure import load_procedure
from elevon.bench.stand import stand_of
from elevon.diagnose.by_model import diagnose
from elevon.diagnose.vibration import answer
from elevon.diagnose.vibration.answer import PassReading, shows_passes
from elevon.features.envelope import ball_passes, envelope_orders
from elevon.logs.log import Log

RATE, FREQUENCY = 8000.0, 1200.0
ORDERS = {"groove": 8.55, "nut": 6.45, "ball": 4.94}


def shaft(seconds=2.0, turns=3.0):
    """A triangle with rounded corners: one way and back."""
    time = np.arange(0.0, seconds, 1.0 / RATE)
    return time, 2.0 * np.pi * turns * (0.5 - np.abs(time / seconds - 0.5)) * seconds


def knocks(angle, order, size, rng, noise=0.05):
    """Rings of the structure whenever a ball passes, in the noise of the sensor."""
    passes = np.diff(np.floor(order * angle / (2.0 * np.pi)), prepend=0.0) != 0.0
    ring = np.arange(200) / RATE
    ring = np.exp(-0.05 * 2.0 * np.pi * FREQUENCY * ring) * np.sin(2.0 * np.pi * FREQUENCY * ring)
    sound = np.convolve(passes.astype(float), size * ring)[: len(angle)]
    return sound + noise * rng.standard_normal(len(angle))


def read(angle, values):
    return envelope_orders(angle, values, RATE, ORDERS, band=(700.0, 1900.0))


@pytest.mark.parametrize("place", ORDERS)
def test_passes_are_named_by_their_order(place):
    _, angle = shaft()
    orders = read(angle, knocks(angle, ORDERS[place], 0.2, np.random.default_rng(1)))
    evidence = answer.evidence_of([orders])
    assert evidence.best == place
    assert evidence.chance < 1e-6
    assert evidence.probabilities[place] > 0.99


def test_noise_alone_is_called_a_spall_as_often_as_asked():
    """40 draws at 0.2: 8 expected; a third of the draws would be a wrong level."""
    _, angle = shaft()
    rng = np.random.default_rng(2)
    noise = 0.05 * rng.standard_normal((40, len(angle)))
    chances = [answer.evidence_of([read(angle, row)]).chance for row in noise]
    assert 1 <= np.sum(np.array(chances) < 0.2) <= 14
    assert np.sum(np.array(chances) < 0.01) <= 3


def test_a_shaft_that_does_not_turn_on_is_refused():
    _, angle = shaft(turns=0.2)
    with pytest.raises(ValueError, match="two turns"):
        read(angle, np.zeros(len(angle)))


def test_the_orders_are_those_of_the_simulated_screw():
    """docs/explanation/theory/ballscrew.md: 8.552, 6.448, 4.940."""
    passes = ball_passes(15.0, 6.35e-3, 32e-3, np.pi / 4.0, 1.0)
    assert [round(order, 3) for order in passes.values()] == [8.552, 6.448, 4.940]


def test_the_procedure_fits_the_accelerometer_and_others_have_no_channel_of_noise():
    screw = Actuator.load("nasa-ballscrew")
    stand = stand_of(screw.wiring)
    (setup,) = loaded_setups(load_procedure("ballscrew-vibration"), screw, stand)
    assert "vibration" in acquired_signals(setup.actuator, "high", stand)
    assert "vibration" not in acquired_signals(screw, "high", stand)


def log_of(fault, seed):
    screw = Actuator.load("nasa-ballscrew")
    faults = [fault] if fault else []
    procedure = load_procedure("ballscrew-vibration")
    (setup,) = loaded_setups(procedure, screw, stand_of(screw.wiring), faults=faults, seed=seed)
    return Log.of(run_loaded(setup, "high")[0], "vibration"), screw


@pytest.mark.long
@pytest.mark.parametrize(("place", "size"), [("nut", 1e-3), ("ball", 5e-4), ("groove", 2e-3)])
def test_a_spall_on_the_bench_is_named_with_its_length(place, size):
    log, screw = log_of(f"spall@screw.{place}={size}", seed=11)
    result = diagnose([log], screw, unit_known=True)
    assert result.best == (f"spall@screw.{place}",)
    (cause,) = result.faults
    assert cause.interval[0] < size < cause.interval[1]
    assert cause.interval[1] < 2.0 * cause.interval[0]


@pytest.mark.long
def test_a_healthy_screw_is_none():
    log, screw = log_of(None, seed=12)
    assert shows_passes(log, screw)
    assert PassReading(log, screw).measured().turns[0] > 2.0
    result = diagnose([log], screw, unit_known=True)
    assert (result.status, result.best) == ("healthy", ())
