"""A linear actuator that is not in the project: its own plant, drive and logger, for calibration.

It shares no code and no modelling choice with the package. What its logger writes: time in ms,
demand and position in mm, speed in mm/s, current in A, one row every 10 ms; each column with a
delay, a resolution and noise of its own.
"""

import ctypes
import functools
import os
import re
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).with_name("linear.c")
STEP, TICK, LOG = 2e-5, 1e-3, 1e-2


@dataclass(frozen=True)
class Linear:
    """Motor, gearbox, screw and drive, SI; torques and inertia on the motor's shaft."""

    per_metre: float = 2 * np.pi * 5.0 / 0.005  # gearbox 5 : 1, lead 5 mm
    torque_constant: float = 0.05
    inertia: float = 2.4e-5
    mass: float = 8.0
    weight: float = 0.0
    dry: float = 0.03
    stick: float = 0.3
    reverse: float = 1.0
    stribeck: float = 8.0
    viscous: float = 6e-5
    bending: float = 0.0
    per_load: float = 0.08
    bristle: float = 20.0
    bristle_damping: float = 2e-3
    ripple: float = 0.05
    ripple_pitch: float = 0.005
    resistance: float = 0.6
    inductance: float = 6e-4
    supply: float = 24.0
    current_gain: float = 1.5
    current_limit: float = 6.0
    cascade: float = 0.0
    gain: float = 9000.0
    integral: float = 30_000.0
    derivative: float = 700.0
    filter: float = 3e-3
    speed_limit: float = 450.0
    count: float = 5e-7
    delay: float = 1.0
    start: float = 0.0
    stiffness: float = 0.0
    joint_damping: float = 0.0


@dataclass(frozen=True)
class Logger:
    """Delays in s, resolutions and noise in the units of the columns."""

    position_delay: float = 0.004
    speed_delay: float = 0.012
    current_delay: float = 0.007
    position_step: float = 0.01  # mm
    speed_step: float = 0.1  # mm/s
    current_step: float = 0.01  # A
    speed_noise: float = 0.3
    current_noise: float = 0.08
    current_offset: float = 0.05
    speed_lag: float = 0.015
    magnitude: bool = False  # the current without its sign


def square(time, level=0.03, period=4.0):
    """A square wave about half its height, after a second of rest, as m."""
    return np.where(time < 1.0, 0.0, np.where((time - 1.0) % period < 0.5 * period, level, 0.0))


def sweep(time, amplitude=0.012, first=0.05, last=1.6, duration=40.0):
    """A sine whose frequency rises, after a second of rest, as m."""
    since = np.maximum(time - 1.0, 0.0)
    angle = 2 * np.pi * (first + 0.5 * (last - first) * since / duration) * since
    return amplitude * np.sin(angle)


@functools.cache
def library():
    """Compile the plant, once a process."""
    folder = tempfile.TemporaryDirectory()
    built = Path(folder.name) / "linear.so"
    compiler = os.environ.get("CC", "cc").split()
    options = ["-O2", "-std=c99", "-shared", "-fPIC", "-o", str(built), str(SOURCE), "-lm"]
    subprocess.run([*compiler, *options], check=True, capture_output=True, timeout=60)
    program = ctypes.CDLL(str(built))
    program.keep = folder
    text = SOURCE.read_text()
    block = text[text.index("struct linear {") : text.index("};")]
    return program, tuple(re.findall(r"^\s+double (\w+);", block, re.MULTILINE))


def run(bench, demand, duration):
    """Carry a demand out; fine rows of position, speed, current, voltage every millisecond."""
    program, names = library()
    tick = np.arange(round(duration / TICK) + 1) * TICK
    command = np.ascontiguousarray(demand(tick), dtype=float)
    shared = {"steps": round(duration / STEP), "dt": STEP, "control_every": round(TICK / STEP),
              "log_every": round(TICK / STEP)}  # fmt: skip
    values = {**vars(bench), **shared}
    packed = (ctypes.c_double * len(names))(*(float(values[name]) for name in names))
    rows = np.zeros((round(duration / TICK), 4))
    arrays = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (command, rows)]
    if program.run(packed, *arrays):
        raise RuntimeError(f"the bench runs away: {bench}")
    return tick[:-1] + TICK, command[1:], rows


def log(bench, demand, duration=40.0, logger=None, seed=0):
    """Return the columns of a log: time [ms], demand, position [mm], speed [mm/s], current [A]."""
    logger = logger or Logger()
    rng = np.random.default_rng([seed, 7])
    fine, _, rows = run(bench, demand, duration)
    at = np.arange(1, int(duration / LOG)) * LOG

    def late(values, delay, lag=0.0):
        if lag > 0.0:
            from scipy.signal import lfilter

            share = TICK / (lag + TICK)
            values = lfilter([share], [1.0, share - 1.0], values)
        return np.interp(at - delay, fine, values)

    def rounded(values, step):
        return np.round(values / step) * step

    n = len(at)
    current = late(rows[:, 2], logger.current_delay) + logger.current_noise * rng.normal(size=n)
    current = current + logger.current_offset
    speed = 1e3 * late(rows[:, 1], logger.speed_delay, logger.speed_lag)
    speed = speed + logger.speed_noise * rng.normal(size=n)
    return {
        "time": np.round(1e3 * at),
        "demand": 1e3 * demand(at),
        "position": rounded(1e3 * late(rows[:, 0], logger.position_delay), logger.position_step),
        "speed": rounded(speed, logger.speed_step),
        "current": rounded(np.abs(current) if logger.magnitude else current, logger.current_step),
    }


def draw(seed, **changes):
    """A bench of its own: every number drawn about the first one."""
    rng = np.random.default_rng([seed, 3])
    spread = {"mass": 0.5, "inertia": 0.2, "dry": 0.4, "stick": 0.3, "viscous": 0.5, "gain": 0.25}
    spread |= {"integral": 0.4, "derivative": 0.15, "current_limit": 0.15, "per_load": 0.5}
    base = Linear()
    values = {k: getattr(base, k) * np.exp(s * rng.normal()) for k, s in spread.items()}
    values["reverse"] = float(np.exp(0.2 * rng.normal()))
    values["weight"] = float(60.0 * rng.normal())
    return replace(base, **{**values, **changes})
