"""Units, days and causes on a bench of another program (`tests/calibrate/foreign.c`).

It has another friction law, a sampled speed controller, a current loop with a lag, backlash that is
elastic or drags, wheels with errors that are drawn anew in each run, an encoder whose error has a
new phase each time the drive is switched on, windings that warm up, delays, counts, and files of
its own. What a day changes is stated here, apart from `engine.days`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from tests.calibrate.foreign import CHIRP, LOADED, NOLOAD, Bench, Sensors, draw, draw_creeping, run
from tests.calibrate.foreign_files import Style, write_trial

Rng = np.random.Generator
TESTS = {"noload": NOLOAD, "chirp": CHIRP, "loaded": LOADED}
RATES = (400.0, 1000.0)  # Hz of the logs; units take turns
_WHEEL, _PINION = math.radians(0.01), math.radians(0.002)  # largest errors at the output
#: Deviations from day to day, ASSUMED before any log was diagnosed: 12 K of winding, 8 K of
#: magnets (-0.1 %/K), friction by 5 %, grease by 10 %, current sensors by 0.3 % and 20 mA.
_WINDING, _MAGNETS, _DRY, _VISCOUS, _GAIN, _OFFSET = 12.0 * 0.0039, 8e-3, 0.05, 0.10, 0.003, 0.02
#: Largest error of the encoder once a turn of its wheel, rad at the output, and turns of the wheel.
_ENCODER, _ENCODER_TURNS = 2e-4, 4.0
AND = " and "
_WARMING = 1e-3  # largest growth of the resistance in a second


@dataclass(frozen=True)
class Unit:
    """A unit of the bench: its number, the plant and drive, sensors, rate of its logs."""

    number: int
    bench: Bench
    sensors: Sensors
    rate: float


@dataclass(frozen=True)
class Cause:
    """Something that is no candidate.

    Attributes
    ----------
    name : str
        What it is and how far.
    bench, sensors : mapping
        Field to a factor, or to a value where it begins with ``=``.
    counts : float
        Factor of the encoder's counts.
    """

    name: str
    bench: Mapping[str, float] | None = None
    sensors: Mapping[str, float] | None = None
    counts: float = 1.0


def units(seed: int, count: int) -> list[Unit]:
    """Draw units: by turns rigid friction and bristles, logs of 400 Hz and 1 kHz."""
    out = []
    for k in range(count):
        bench, sensors = (draw, draw_creeping)[k % 2](1000 * seed + k)
        out.append(Unit(k, bench, sensors, RATES[k // 2 % 2]))
    return out


def of_day(unit: Unit, rng: Rng) -> tuple[Bench, Sensors]:
    """Return plant and sensors of another day."""
    n = rng.standard_normal(6)
    b, s = unit.bench, unit.sensors
    dry = math.exp(_DRY * n[2])
    bench = replace(
        b,
        resistance=b.resistance * (1.0 + _WINDING * n[0]),
        torque_constant=b.torque_constant * (1.0 - _MAGNETS * n[1]),
        dry=b.dry * dry,
        stick=b.stick * dry,
        output_dry=b.output_dry * dry,
        viscous=b.viscous * math.exp(_VISCOUS * n[3]),
        wheel=float(rng.uniform(0.5, 1.0)) * _WHEEL,
        wheel_phase=float(rng.uniform(0.0, 2.0 * math.pi)),
        pinion=float(rng.uniform(0.5, 1.0)) * _PINION,
        pinion_phase=float(rng.uniform(0.0, 2.0 * math.pi)),
        warming=float(rng.uniform(0.0, _WARMING)),
    )
    sensors = replace(
        s,
        current_offset=s.current_offset + _OFFSET * n[5],
        encoder_error=float(rng.uniform(0.5, 1.0)) * _ENCODER,
        encoder_turns=_ENCODER_TURNS,
        encoder_phase=float(rng.uniform(0.0, 2.0 * math.pi)),
    )
    return bench, sensors


def changed(bench: Bench, sensors: Sensors, cause: Cause) -> tuple[Bench, Sensors]:
    """Return plant and sensors with a cause."""
    return _moved(bench, cause.bench or {}), _moved(sensors, cause.sensors or {})


def _moved(item: Any, moves: Mapping[str, float]) -> Any:
    values = {
        name.lstrip("="): value if name.startswith("=") else getattr(item, name) * value
        for name, value in moves.items()
    }
    return replace(item, **values)


def written(unit: Unit, test: str, folder: Path, seed: int, cause: Cause | None = None) -> Path:
    """Make one log of another day and write its files; return the trace's."""
    rng = np.random.default_rng([seed, 5])
    bench, sensors = of_day(unit, rng)
    counts = 80_000.0
    if cause is not None:
        bench, sensors = changed(bench, sensors, cause)
        counts *= cause.counts
    done = run(bench, sensors, TESTS[test], seed=seed, log=1.0 / unit.rate, counts=counts)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{test}.csv"
    write_trial(path, done, sensors, Style(), seed)
    return path


#: Causes that are no candidates, each at the severity a maintainer would look for.
CAUSES = (
    Cause("inertia +50 %", {"inertia": 1.5}),
    Cause("inertia doubled", {"inertia": 2.0}),
    Cause("inertia -40 %", {"inertia": 0.6}),
    Cause("integral time a third", {"integral_time": 1.0 / 3.0}),
    Cause("integral time times 5", {"integral_time": 5.0}),
    Cause("no derivative", {"=derivative_time": 0.0}),
    Cause("derivative doubled", {"derivative_time": 2.0}),
    Cause("current loop 4 times slower", {"current_lag": 4.0}),
    Cause("current loop 8 times slower", {"current_lag": 8.0}),
    Cause("speed controller at 1 ms", {"=sample_time": 1e-3}),
    Cause("position controller at 10 ms", {"=position_sample_time": 10e-3}),
    Cause("position controller at 20 ms", {"=position_sample_time": 20e-3}),
    Cause("speed limit 40 %", {"speed_limit": 0.4}),
    Cause("cogging 0.15 N m", {"=cogging": 0.15}),
    Cause("cogging 0.4 N m", {"=cogging": 0.4}),
    Cause("12 cogs of 0.3 N m", {"=cogging": 0.3, "=cogging_teeth": 12.0}),
    Cause("static friction doubled", {"stick": 2.0, "=stribeck": 5.0}),
    Cause("friction that falls with speed", {"stick": 2.5, "=stribeck": 20.0}),
    Cause("friction grows with load by 0.3", {"=load_share": 0.3}),
    Cause("wheel error 0.15 deg", {"=wheel": math.radians(0.15)}),
    Cause("wheel error 0.4 deg", {"=wheel": math.radians(0.4)}),
    Cause("pinion error 0.05 deg", {"=pinion": math.radians(0.05)}),
    Cause("pinion error 0.15 deg", {"=pinion": math.radians(0.15)}),
    Cause("current sensor offset 0.3 A", {"=phase_offset": 0.3}),
    Cause("current sensor offset 1 A", {"=phase_offset": 1.0}),
    Cause("pull of 0.3 N m one way", {"=pull": 0.3}),
    Cause("pull of 0.6 N m one way", {"=pull": 0.6}),
    Cause("contact of 1.5 ohm", {"resistance": 1.55}),
    Cause("contact of 4 ohm", {"resistance": 2.45}),
    Cause("winding warms by 1 % a second", {"=warming": 1e-2}),
    Cause("inductance times 4", {"inductance": 4.0}),
    Cause("soft shaft, a quarter", {"=elastic": 1.0, "=stiffness": 150.0, "=output_dry": 2.0}),
    Cause("output inertia 30 times", {"=elastic": 1.0, "=output_inertia": 6e-2}),
    Cause("friction at the output 8 N m", {"=elastic": 1.0, "=output_dry": 8.0}),
    Cause("encoder 10 ms late", None, {"=encoder_delay": 10e-3}),
    Cause("encoder 40 ms late", None, {"=encoder_delay": 40e-3}),
    Cause("encoder of 1/40 of the counts", counts=1.0 / 40.0),
    Cause("speed signal behind 15 Hz", None, {"=speed_cutoff": 15.0}),
    Cause("current signal behind 8 Hz", None, {"=cutoff": 8.0}),
    Cause("noise of the current 0.5 A", None, {"=current_noise": 0.5}),
    Cause("noise of the speed 2 rad/s", None, {"=speed_noise": 2.0}),
    Cause("noise of the voltage 20 V", None, {"=voltage_noise": 20.0}),
    Cause("current read 0.6 A off", None, {"=current_offset": 0.6}),
    Cause("speed read 1.5 rad/s off", None, {"=speed_offset": 1.5}),
)


@dataclass(frozen=True)
class Injected:
    """A candidate and what it does to this bench.

    Attributes
    ----------
    key : str
        ``KIND@PLACE``.
    severity : float
        In its unit.
    cause : Cause
        The change.
    """

    key: str
    severity: float
    cause: Cause


def injected(unit: Unit) -> list[Injected]:
    """Return the faults that this program can have, each at a clear severity."""
    growth, b = math.radians(0.13), unit.bench
    return [
        Injected("backlash@transmission", growth,
                 Cause("backlash", {"=backlash": b.backlash + growth})),
        Injected("friction@transmission", 0.5, Cause("friction", {"dry": 1.5, "stick": 1.5})),
        Injected("lubrication@transmission", 1.5, Cause("lubrication", {"viscous": 2.5})),
        Injected("gain_drift@control.position", -0.03, Cause("gain", {"position_gain": 0.97})),
        Injected("gain@sensor.encoder", 0.01, Cause("encoder", None, {"encoder_gain": 1.01})),
        Injected("gain_drift@control.speed", 0.4, Cause("speed gain", {"speed_gain": 1.4})),
    ]  # fmt: skip


def singles(unit: Unit) -> list[tuple[Injected, ...]]:
    """Return each fault by itself."""
    return [(fault,) for fault in injected(unit)]


def pairs(unit: Unit) -> list[tuple[Injected, ...]]:
    """Return all pairs of faults."""
    return list(combinations(injected(unit), 2))


def together(faults: Sequence[Injected]) -> Cause:
    """Return what faults do to the bench at once; no two of them move the same field."""
    bench, sensors = ({k: v for f in faults for k, v in (getattr(f.cause, of) or {}).items()}
                      for of in ("bench", "sensors"))  # fmt: skip
    return Cause(AND.join(f.key for f in faults), bench, sensors)
