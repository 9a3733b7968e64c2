"""Every waveform against its formula written another way, sampled off and on its corners."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import signal

from elevon import _core
from elevon.errors import InputError
from elevon.units import parse_quantity
from elevon.waveforms import evaluate, unit_of, wave_records
from tests.physics.rig import FREE_SHAFT, run, term

DURATION, RATE = 2.0, 1000.0
Formula = Callable[[np.ndarray], np.ndarray]


def between(start: float, end: float, formula: Formula) -> Formula:
    """The formula on [start, end], its end values held outside."""
    return lambda t: formula(np.clip(t, start, end))


def triangle(
    amplitude: float, frequency: float, phase: float, bias: float, start: float
) -> Formula:
    """By scipy's sawtooth, a quarter period ahead: rising through the bias at start."""

    def formula(t: np.ndarray) -> np.ndarray:
        angle = 2 * math.pi * frequency * (t - start) + phase + math.pi / 2
        return bias + amplitude * signal.sawtooth(angle, width=0.5)

    return formula


def chirp(amplitude: float, first: float, last: float, sweep: float, phase: float) -> Formula:
    """By scipy's chirp (a cosine: 90 deg behind gives the sine)."""

    def formula(t: np.ndarray) -> np.ndarray:
        return amplitude * signal.chirp(t, first, sweep, last, phi=math.degrees(phase) - 90.0)

    return formula


def period_sweep(
    amplitude: float, first: float, last: float, sweep: float, bias: float, start: float
) -> Formula:
    """Cycle by cycle: the k-th lasts until its linear chirp from 1/T_k to 1/T_(k+1), with T on the
    straight line from `first` to `last`, has turned once; T_(k+1) found by bisection."""
    slope = (last - first) / sweep
    begins, periods = [0.0], [first]
    while begins[-1] < sweep:
        now = periods[-1]
        low, high = 0.2 * now, 5.0 * now
        for _ in range(200):
            length = 0.5 * (low + high)
            following = now + slope * length
            turned = 0.5 * length * (1.0 / now + 1.0 / following) if following > 0.0 else np.inf
            low, high = (length, high) if turned < 1.0 else (low, length)
        begins.append(begins[-1] + length)
        periods.append(now + slope * length)

    def formula(t: np.ndarray) -> np.ndarray:
        k = np.clip(np.searchsorted(begins, t - start, side="right") - 1, 0, len(begins) - 2)
        begin, end = np.array(begins)[k], np.array(begins)[k + 1]
        f0, f1 = 1.0 / np.array(periods)[k], 1.0 / np.array(periods)[k + 1]
        tau = t - start - begin
        return bias + amplitude * np.sin(
            2 * math.pi * (f0 * tau + 0.5 * (f1 - f0) * tau**2 / (end - begin))
        )

    return formula


def trapezoid(low: float, high: float, corners: list[float], start: float) -> Formula:
    """Interpolation through the corners of one period, repeated."""
    x = np.concatenate([[0.0], np.cumsum(corners)])
    y = np.array([low, high, high, low, low])

    def formula(t: np.ndarray) -> np.ndarray:
        inside = np.interp(np.mod(t - start, x[-1]), x, y)
        return np.where(t < start, low, inside)

    return formula


TIMES, VALUES = [0.0, 0.3, 0.5, 0.8], [0.1, 0.4, -0.2, 0.1]
CASES: dict[str, tuple[dict[str, object], Formula]] = {
    "constant": (term("constant", value=0.3), lambda t: np.full_like(t, 0.3)),
    "step": (
        term("step", initial=0.1, final=0.4, time="0.7 s"),
        lambda t: np.where(t < 0.7 - 1e-9, 0.1, 0.4),
    ),
    "ramp": (
        term("ramp", initial=0.1, slope=0.5, start="0.25 s", end="1.25 s"),
        lambda t: 0.1 + 0.5 * np.clip(t - 0.25, 0.0, 1.0),
    ),
    "sine": (
        term(
            "sine",
            amplitude=0.2,
            bias=0.1,
            frequency="3 Hz",
            phase="30 deg",
            start="0.2 s",
            end="1.45 s",
        ),
        between(0.2, 1.45, lambda t: 0.1 + 0.2 * np.sin(2 * math.pi * 3 * (t - 0.2) + math.pi / 6)),
    ),
    "chirp": (
        term(
            "chirp",
            amplitude=0.2,
            start_frequency="1 Hz",
            end_frequency="15 Hz",
            sweep_time="1.5 s",
            phase="20 deg",
        ),
        between(0.0, 1.5, chirp(0.2, 1.0, 15.0, 1.5, math.radians(20))),
    ),
    "period_sweep": (
        term(
            "period_sweep",
            amplitude=0.2,
            start_period="0.4 s",
            end_period="0.1 s",
            sweep_time="1.4 s",
            bias=0.05,
            start="0.1 s",
        ),
        between(0.1, 1.5, period_sweep(0.2, 0.4, 0.1, 1.4, 0.05, 0.1)),
    ),
    "triangle": (
        term(
            "triangle",
            amplitude=0.2,
            bias=-0.1,
            frequency="1.7 Hz",
            phase="50 deg",
            start="0.1 s",
            end="1.33 s",
        ),
        between(0.1, 1.33, triangle(0.2, 1.7, math.radians(50), -0.1, 0.1)),
    ),
    "trapezoid": (
        term(
            "trapezoid",
            low=-0.1,
            high=0.3,
            rise="0.1 s",
            hold_high="0.2 s",
            fall="0.15 s",
            hold_low="0.07 s",
            start="0.05 s",
            repeat=True,
        ),
        trapezoid(-0.1, 0.3, [0.1, 0.2, 0.15, 0.07], 0.05),
    ),
    "rectangle": (
        term("rectangle", low=-0.1, high=0.2, period="0.3 s", duty=0.25, start="0.1 s"),
        lambda t: np.where(
            (t > 0.1 - 1e-9) & (np.mod(t - 0.1 + 1e-9, 0.3) < 0.25 * 0.3), 0.2, -0.1
        ),
    ),
    "table": (
        term("table", times=TIMES, values=VALUES, repeat=False),
        lambda t: np.interp(t, TIMES, VALUES),
    ),
}


def command_of(terms: list[dict[str, object]]) -> tuple[np.ndarray, np.ndarray]:
    """Time and command signal of a run whose motor is off."""
    rec = run(FREE_SHAFT, duration=DURATION, command=terms, record=f"command@{RATE:g} Hz")
    return rec["command"].time, rec["command"].values


def test_every_kind_of_waveform_has_a_case() -> None:
    """A waveform added to the core without a formula here is an untested one."""
    assert {record["kind"] for record in _core.waveforms()} == set(CASES)


@pytest.mark.parametrize("kind", CASES)
def test_waveform_follows_its_formula(kind: str) -> None:
    """1e-9 of a radian: rounding of a 2 s time base, and corners fall on steps."""
    given, formula = CASES[kind]
    time, command = command_of([given])
    assert command == pytest.approx(formula(time), abs=1e-9)


@pytest.mark.parametrize("kind", sorted(set(CASES) - {"table"}))
def test_evaluated_waveform_follows_its_formula(kind: str) -> None:
    """What the bench fits is the core's own; a jump belongs to what follows it."""
    given, formula = CASES[kind]
    time = np.arange(int(DURATION * RATE)) / RATE
    units = {p.name: unit_of(p, "rad") for p in wave_records()[kind].parameters}
    known = {
        name: float(value) if isinstance(value, bool) else parse_quantity(value, units[name] or "1")
        for name, value in given.items()
        if name in units
    }
    assert evaluate(kind, known, time + 1e-12) == pytest.approx(formula(time), abs=1e-9)


def test_repeating_table_starts_again() -> None:
    """Period = last time - first time."""
    time, command = command_of([term("table", times=TIMES, values=VALUES, repeat=True)])
    assert command == pytest.approx(np.interp(np.mod(time, 0.8), TIMES, VALUES), abs=1e-9)


def test_terms_add_and_disabled_terms_do_not() -> None:
    """The sum of every kind, one of them switched off."""
    chosen = ["constant", "ramp", "sine", "chirp", "triangle", "trapezoid"]
    terms = [CASES[kind][0] for kind in chosen] + [{**CASES["sine"][0], "enabled": False}]
    time, command = command_of(terms)
    expected = sum(CASES[kind][1](time) for kind in chosen)
    assert command == pytest.approx(expected, abs=1e-9)


ROUNDED = {
    "triangle": (
        {"amplitude": 0.05, "frequency": 1.0, "phase": "30 deg"},
        triangle(0.05, 1.0, math.radians(30), 0.0, 0.0),
    ),
    "trapezoid": (
        {"low": -0.1, "high": 0.1, "rise": "0.5 s", "fall": "0.4 s", "hold_high": "0.2 s",
         "start": "-0.2 s"},
        trapezoid(-0.1, 0.1, [0.5, 0.2, 0.4, 0.0], -0.2),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", ROUNDED)
def test_rounded_corners_keep_the_acceleration_and_the_lines(kind: str) -> None:
    """From rest, within the limit, elsewhere the sharp figure later by half a parabola."""
    arguments, sharp = ROUNDED[kind]
    limit = 4.0
    time, command = command_of([term(kind, **arguments, acceleration=limit)])
    second = np.diff(command, 2) * RATE**2
    assert np.max(np.abs(second)) == pytest.approx(limit, rel=1e-6)
    assert abs(command[1] - command[0]) < limit / RATE**2
    rate = (sharp(np.array([1e-3])) - sharp(np.array([0.0])))[0] / 1e-3
    later = time - 0.5 * abs(rate) / limit
    straight = np.abs(second) < 1e-3
    lines = np.flatnonzero(straight[1:] & straight[:-1] & (later[2:-1] > 0.3)) + 2
    assert lines.size > 0.3 * time.size
    assert command[lines] == pytest.approx(sharp(later[lines]), abs=1e-9)


@pytest.mark.parametrize(
    ("kind", "more", "words"),
    [
        ("triangle", {"acceleration": 1.0}, "at least"),
        ("triangle", {"acceleration": -1.0}, "negative"),
        ("triangle", {"acceleration": 9.0, "end": "1 s"}, "end"),
        ("trapezoid", {"acceleration": 9.0, "rise": "0 s"}, "rise"),
        ("trapezoid", {"acceleration": 1.0}, "at least"),
    ],
)
def test_corners_that_cannot_be_rounded_are_refused(
    kind: str, more: dict[str, object], words: str
) -> None:
    """Too little room, a negative limit, a sharp end, a jump."""
    with pytest.raises(InputError, match=words):
        command_of([term(kind, **{**ROUNDED[kind][0], **more})])


def test_a_table_that_repeats_within_the_rounding_of_its_time_is_refused() -> None:
    """The cycle of 0.8 s has no phase at 1e12 s; once, or alone, a table may start there."""
    late = {"times": TIMES, "values": VALUES, "start": "1e12 s"}
    with pytest.raises(InputError, match=r"0\.8 s, at least 1 s"):
        command_of([term("table", **late, repeat=True)])
    command_of([term("table", **late, repeat=False)])
    command_of([term("table", times=[0.0], values=[0.1], start="1e12 s", repeat=True)])
