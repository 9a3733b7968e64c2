"""Frequencies of sets of failures: against closed forms and a Markov chain written apart."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from elevon.safety import Exposure, Occurrence, frequency
from elevon.safety.probability import unavailability

A, B, C = 2e-7, 3e-7, 5e-7
T, FLIGHT = 1000.0, 2.0


def hidden(name, rate, interval=T, check="check", **more):
    return Occurrence(name, rate, evident=False, interval=interval, check=check, **more)


def seen(name, rate, **more):
    return Occurrence(name, rate, evident=True, interval=FLIGHT, **more)


def found(*failures, **exposure):
    return frequency(failures, Exposure(FLIGHT, **exposure))


@pytest.mark.parametrize(
    ("failures", "last", "mean", "worst"),
    [
        ([seen("a", A)], None, A, A),
        ([hidden("a", A)], None, A, A),
        ([hidden("a", A), seen("b", B)], {"b"}, A * B * T / 2, A * B * T),
        ([hidden("a", A), seen("b", B)], None, A * B * (T + FLIGHT) / 2, A * B * T),
        ([hidden("a", A), seen("b", B)], {"a"}, A * B * FLIGHT / 2, A * B * FLIGHT / 2),
        ([hidden("a", A), hidden("b", B)], None, A * B * T, 2 * A * B * T),
        ([hidden("a", A), hidden("b", B)], {"b"}, A * B * T / 2, A * B * T),
        ([hidden("a", A), hidden("b", B, check="other")], None, A * B * T, 2 * A * B * T),
        ([seen("a", A), seen("b", B)], None, A * B * FLIGHT, A * B * FLIGHT),
        ([seen("a", A), seen("b", B)], {"a"}, A * B * FLIGHT / 2, A * B * FLIGHT / 2),
        ([hidden("a", A), hidden("b", B), seen("c", C)], {"c"}, A * B * C * T**2 / 3,
         A * B * C * T**2),
        ([hidden("a", A), hidden("b", B, 300.0, "other"), seen("c", C)], {"c"},
         A * B * C * T * 300.0 / 4, A * B * C * T * 300.0),
    ],
)  # fmt: skip
def test_closed_forms(failures, last, mean, worst) -> None:
    """One dormant and one evident in both orders, both dormant, both evident, two and one."""
    result = found(*failures, last=last)
    assert result.mean == pytest.approx(mean, rel=1e-12)
    assert result.worst == pytest.approx(worst, rel=1e-12)
    assert result.common == 0.0


def test_mean_unavailability() -> None:
    """Of two under one check T^2 / 3, of two independent checks T1 T2 / 4."""
    both = [hidden("a", A), hidden("b", B)]
    assert unavailability(both, FLIGHT) == pytest.approx(A * B * T**2 / 3)
    apart = [hidden("a", A), hidden("b", B, 300.0, "other")]
    assert unavailability(apart, FLIGHT) == pytest.approx(A * B * T * 300.0 / 4)


def chain(failures, last, offsets=None):
    """Expected completions an hour of flight: exact exponentials, flight by flight.

    States are the sets of failures that are there; one more component counts the entries into the
    full set by a failure of `last`. Evident ones are repaired after each flight, a dormant one
    after each interval, the first time after its offset. Returns mean and that of the worst flight.
    """
    count, names = len(failures), [item.name for item in failures]
    full, size = 2**count - 1, 2**count + 1
    rates = np.zeros((size, size))
    for state, number in itertools.product(range(2**count), range(count)):
        if not state & 1 << number:
            to = state | 1 << number
            rates[to, state] += failures[number].rate
            rates[state, state] -= failures[number].rate
            if to == full and (last is None or names[number] in last):
                rates[-1, state] += failures[number].rate
    step = sum(
        np.linalg.matrix_power(rates * FLIGHT, power) / math.factorial(power) for power in range(12)
    )
    offsets = offsets or [0.0] * count
    hours = math.lcm(*(round(item.interval) for item in failures if not item.evident), 1000)
    probability = np.zeros(size)
    probability[0] = 1.0
    flights = []
    for flight in range(2 * round(hours / FLIGHT)):  # the first half forgets the beginning
        before = probability[-1]
        probability = step @ probability
        flights.append(probability[-1] - before)
        end = (flight + 1) * FLIGHT
        for number, item in enumerate(failures):
            due = (end - offsets[number]) % item.interval < FLIGHT / 2
            if item.evident or due:
                for state in range(2**count):
                    if state & 1 << number:
                        probability[state & ~(1 << number)] += probability[state]
                        probability[state] = 0.0
    half = np.array(flights[len(flights) // 2 :]) / FLIGHT
    return half.mean(), half.max()


@pytest.mark.parametrize(
    ("failures", "last"),
    [
        ([hidden("a", A), seen("b", B)], None),
        ([hidden("a", A), seen("b", B)], {"b"}),
        ([hidden("a", A), seen("b", B)], {"a"}),
        ([hidden("a", A), hidden("b", B)], None),
        ([hidden("a", A), hidden("b", B)], {"b"}),
        ([seen("a", A), seen("b", B)], None),
        ([hidden("a", A), hidden("b", B), seen("c", C)], {"c"}),
        ([hidden("a", A), hidden("b", B), hidden("c", C)], None),
        ([hidden("a", A), seen("b", B), seen("c", C)], {"b", "c"}),
    ],
)
def test_against_a_markov_chain(failures, last) -> None:
    """The mean to 0.3 %: rates times intervals are below a thousandth; the worst is no less."""
    mean, worst = chain(failures, last)
    result = found(*failures, last=last)
    assert result.mean == pytest.approx(mean, rel=3e-3)
    assert result.worst == pytest.approx(worst, rel=5e-3)
    assert result.worst >= worst * (1.0 - 1e-3)


def test_staggered_and_independent_checks() -> None:
    """Checks half an interval apart: the same frequency; two intervals: the mean over offsets."""
    pair = [hidden("a", A), hidden("b", B, check="other")]
    assert found(*pair).mean == pytest.approx(chain(pair, None, [0.0, T / 2])[0], rel=3e-3)
    triple = [hidden("a", A), hidden("b", B, 500.0, "other"), seen("c", C)]
    every = [chain(triple, {"c"}, [0.0, offset, 0.0])[0] for offset in np.arange(10.0, 500.0, 20.0)]
    assert found(*triple, last={"c"}).mean == pytest.approx(np.mean(every), rel=5e-3)


def test_common_causes() -> None:
    """Beta of like components adds a single event; others of the set stay."""
    like = {"family": "switches", "beta": 0.1}
    pair = [hidden("a", A, **like), hidden("b", A, **like)]
    result = found(*pair)
    assert result.common == pytest.approx(0.1 * A)
    assert result.mean == pytest.approx(0.1 * A + (0.9 * A) ** 2 * T)
    three = found(*pair, seen("c", C), last={"c"})
    assert three.common == pytest.approx(0.1 * A * C * (T + FLIGHT) / 2)
    unlike = found(pair[0], hidden("b", A, family="sensors", beta=0.1))
    assert unlike.common == 0.0
    # Alone, a failure has its whole rate, whatever causes it.
    assert found(pair[0]).mean == A
    assert found(pair[0], seen("c", C), last={"c"}).mean == pytest.approx(A * C * T / 2)


def test_share_of_the_flight_and_demand() -> None:
    """A failure that must come in a phase; a situation that seldom arises."""
    pair = [hidden("a", A), seen("b", B)]
    assert found(*pair, share=0.01).mean == pytest.approx(0.01 * found(*pair).mean)
    rare = found(hidden("a", A), demand=1e-6)
    assert rare.mean == pytest.approx(1e-6 / FLIGHT * A * T / 2)
    assert rare.worst == pytest.approx(1e-6 / FLIGHT * A * T)
    assert found(hidden("a", A), demand=0.5).mean == A
    assert found(seen("a", A), demand=0.5).mean == pytest.approx(0.5 * A)
