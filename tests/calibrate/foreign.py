"""A bench that is not in the project: its own plant, drive and sensors, for calibration's tests.

It shares no code and no modelling choice with the package: a sampled speed controller, a current
loop with a lag, Borello's friction, backlash as an operator or between two masses, integrated by a
small C
program (`foreign.c`) that is compiled on the fly. What its files look like is in `foreign_files`.
"""

import ctypes
import functools
import math
import os
import re
import subprocess
import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).with_name("foreign.c")
RPM = math.pi / 30
COUNT = 2 * math.pi / 80_000
STEP = 25e-6
LOG = 2.5e-3
DURATION = 20.0
COLUMNS = ("output", "motor", "speed_ref", "speed", "current_ref", "current", "voltage", "reaction")


@dataclass(frozen=True)
class Bench:
    """The actuator and the drive, SI; torques and inertia on the motor shaft, currents as peak."""

    torque_constant: float = 1.35
    inertia: float = 2.7e-3
    dry: float = 0.3
    stick: float = 0.4
    stribeck: float = 0.0
    falling: float = 1.0
    bristle: float = 0.0
    bristle_damping: float = 0.5
    load_share: float = 0.0
    viscous: float = 3e-3
    cogging: float = 0.0
    cogging_teeth: float = 48.0
    backlash: float = math.radians(0.5)
    elastic: bool = False
    stiffness: float = 625.0
    damping: float = 0.67
    output_inertia: float = 2e-3
    output_dry: float = 0.3
    ratio: float = 124.0
    speed_gain: float = 0.2
    integral_time: float = 0.3
    derivative_time: float = 0.005
    derivative_filter: float = 10.0
    sample_time: float = 125e-6
    position_sample_time: float = 0.0  # 0: that of the speed controller
    current_limit: float = 20.0
    current_lag: float = 0.8e-3
    position_gain: float = 124_000 / 60
    speed_limit: float = 500 * RPM
    speed_by_counts: bool = True
    quantised_loop: bool = True
    resistance: float = 2.75
    inductance: float = 0.0305
    wheel: float = 0.0
    wheel_phase: float = 0.0
    pinion: float = 0.0
    pinion_phase: float = 0.0
    phase_offset: float = 0.0
    pole_pairs: float = 4.0
    warming: float = 0.0
    pull: float = 0.0


@dataclass(frozen=True)
class Sensors:
    """What the logs add: offsets, filters, noise, counts, clocks; SI, currents as peak."""

    encoder_gain: float = 1.0
    encoder_offset: float = 0.02
    encoder_error: float = 0.0
    encoder_turns: float = 1.0
    encoder_phase: float = 0.0
    encoder_delay: float = 0.0
    motor_zero: float = 3.0
    motor_rounding: float = 0.0  # deg in the file; 0: none
    speed_noise: float = 0.05
    speed_offset: float = 0.05
    speed_cutoff: float = 0.0
    cutoff: float = 120.0
    current_noise: float = 0.02
    current_offset: float = 0.03
    current_step: float = 0.01
    voltage_noise: float = 0.5
    cell: str = "signed"  # signed, positive, none
    cell_rate: float = 80.0
    cell_clock: float = 4e-4
    cell_offset: float = 1.0
    cell_noise: float = 0.3
    arm: float = 0.1
    chain: float = 4.5


@dataclass(frozen=True)
class Trial:
    """One log: what is commanded (degrees at the output, Hz), and whether the brake acts."""

    waveform: str
    values: dict
    brake: tuple = ()  # N m at the trigger, N m after DURATION
    wobble: float = 0.0
    keys: dict = field(default_factory=dict)

    def command(self, time):
        """Return the command [rad] at seconds since it began."""
        v = self.values
        if self.waveform == "sine":
            angle = 2 * math.pi * v["frequency"] * time
        else:
            rate = (v["end_frequency"] - v["start_frequency"]) / v["sweep_time"]
            angle = 2 * math.pi * (v["start_frequency"] + 0.5 * rate * time) * time
        return np.radians(v["bias"] + v["amplitude"] * np.sin(angle))


NOLOAD = Trial("sine", {"amplitude": 7.0, "bias": 10.0, "frequency": 0.2})
LOADED = Trial("sine", {"amplitude": 45.0, "bias": 60.0, "frequency": 0.05}, brake=(0.2, 2.0))
CHIRP = Trial(
    "chirp",
    {"amplitude": 2.0, "bias": 8.0, "start_frequency": 0.1, "end_frequency": 4.0,
     "sweep_time": 20.0},
)  # fmt: skip
CAMPAIGN = {"noload": NOLOAD, "chirp": CHIRP, "loaded": LOADED}


@functools.cache
def library():
    """Compile the plant, once a process."""
    folder = tempfile.TemporaryDirectory()
    built = Path(folder.name) / "foreign.so"
    compiler = os.environ.get("CC", "cc").split()
    options = ["-O2", "-std=c99", "-shared", "-fPIC", "-o", str(built), str(SOURCE), "-lm"]
    subprocess.run([*compiler, *options], check=True, capture_output=True, timeout=60)
    program = ctypes.CDLL(str(built))
    program.keep = folder
    text = SOURCE.read_text()
    block = text[text.index("struct bench {") : text.index("};")]
    fields = tuple(re.findall(r"^\s+double (\w+);", block, re.MULTILINE))
    return program, fields


@dataclass(frozen=True)
class Run:
    """One trial carried out: rows of the log before its sensors, and what chance decided."""

    trial: Trial
    time: np.ndarray
    rows: dict
    start: float
    trigger: float


def run(bench, sensors, trial, seed=0, duration=DURATION, start=None, log=LOG, counts=80_000.0):
    """Carry a trial out; the command starts and the trigger rises at instants drawn by the seed."""
    rng = np.random.default_rng([seed, 1])
    start = float(rng.uniform(0.3, 1.5)) if start is None else start
    trigger = float(rng.uniform(0.2, 1.2))
    output = math.radians(float(rng.uniform(-2.0, 2.0)))
    where = float(rng.uniform(-1.0, 1.0))
    outer = bench.position_sample_time or bench.sample_time
    tick = np.arange(round(duration / outer) + 1) * outer
    reading = output * sensors.encoder_gain + sensors.encoder_offset
    command = np.where(tick < start, reading, trial.command(np.maximum(tick - start, 0.0)))
    brake = np.zeros_like(tick)
    if trial.brake:
        low, high = trial.brake
        since = tick - trigger
        brake = np.maximum(low + (high - low) / DURATION * since, 0.0)
        swing = np.sin(2 * math.pi * 1.3 * since) + np.sin(2 * math.pi * 0.37 * since + 1.0)
        brake = np.where(since > 0.0, brake * (1.0 + trial.wobble * swing), 0.0)
    shared = {
        "steps": round(duration / STEP),
        "dt": STEP,
        "control_every": round(bench.sample_time / STEP),
        "position_every": round(outer / STEP),
        "log_every": round(log / STEP),
        "believed_constant": bench.torque_constant,
        "encoder_counts": counts,
        "motor_counts": 2.0**24,
        "output_start": output,
        "motor_start": where,
    }
    program, names = library()
    values = {**vars(bench), **vars(sensors), **shared}
    packed = (ctypes.c_double * len(names))(*(float(values[name]) for name in names))
    rows = np.zeros((round(duration / log), len(COLUMNS)))
    pointers = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (command, brake, rows)]
    if program.run(packed, *pointers):
        raise RuntimeError(f"the bench runs away: {bench}")
    time = np.arange(len(rows)) * log
    return Run(trial, time, dict(zip(COLUMNS, rows.T, strict=True)), start, trigger)


def truth(bench, sensors):
    """Return what a calibration is to find, SI; of two masses, what one mass sees of them."""
    friction = bench.output_dry / bench.ratio if bench.elastic else 0.0
    swung = bench.output_inertia / bench.ratio**2 if bench.elastic else 0.0
    wound = 2 * bench.output_dry / bench.stiffness if bench.elastic else 0.0
    zero = sensors.encoder_gain * sensors.motor_zero / bench.ratio
    return {
        "motor.emf_constant": bench.torque_constant / 1.5,
        "derived.inertia": bench.inertia + swung,
        "friction.dynamic": bench.dry + friction,
        "friction.static": bench.stick + friction,
        "friction.viscous": bench.viscous,
        "backlash.total": bench.backlash + wound,
        "control.speed_gain": bench.speed_gain,
        "control.integral_time": bench.integral_time,
        "control.derivative_time": bench.derivative_time,
        "control.position_gain": bench.position_gain,
        "sensor.filter_cutoff": sensors.cutoff,
        "sensor.speed_offset": sensors.speed_offset,
        "sensor.current_offset": sensors.current_offset,
        "sensor.encoder.offset": sensors.encoder_offset - zero,
        "sensor.encoder.gain": sensors.encoder_gain,
    }


def draw(seed, bench=None, sensors=None):
    """Draw a bench and its sensors far from any set's values; options as given."""
    rng = np.random.default_rng([seed, 2])

    def u(low, high):
        return float(rng.uniform(low, high))

    inertia, dry = u(1.5e-3, 4.5e-3), u(0.12, 0.5)
    stiff = u(50.0, 110.0)  # 1/s: speed gain over inertia, how fast the speed loop is
    drawn = {
        "torque_constant": u(1.1, 1.6),
        "inertia": inertia,
        "dry": dry,
        "stick": dry * u(1.0, 1.5),
        "viscous": u(1.5e-3, 8e-3),
        "backlash": math.radians(u(0.3, 1.5)),
        "speed_gain": inertia * stiff,
        "integral_time": u(0.12, 0.6),
        "derivative_time": u(0.15, 0.45) / stiff,
        "current_limit": u(14.0, 22.5),
        "position_gain": 124_000 / 60 * u(0.9, 1.1),
    }
    seen = {
        "encoder_offset": u(-0.1, 0.1),
        "motor_zero": u(-20.0, 20.0),
        "speed_offset": u(0.05, 0.3) * rng.choice([-1.0, 1.0]),
        "cutoff": u(80.0, 200.0),
        "current_offset": u(0.02, 0.1) * rng.choice([-1.0, 1.0]),
        "cell_clock": u(-1e-3, 1e-3),
        "cell_offset": u(-2.0, 2.0),
        "arm": u(0.05, 0.15),
        "chain": u(4.0, 5.0),
    }
    return (
        replace(Bench(**drawn), **(bench or {})),
        replace(Sensors(**{k: float(v) for k, v in seen.items()}), **(sensors or {})),
    )


def draw_creeping(seed, bench=None):
    """Draw a bench on LuGre's bristles, friction that grows with load, elastic backlash."""
    rng = np.random.default_rng([seed, 4])
    creeping = {
        "elastic": True,
        "falling": float(rng.choice([1.0, 2.0])),
        "stribeck": float(rng.uniform(0.2, 1.5)),
        "bristle": float(np.exp(rng.uniform(np.log(100.0), np.log(5e3)))),
        "bristle_damping": float(rng.uniform(0.1, 1.0)),
        "load_share": float(rng.uniform(0.0, 0.02)),
        "output_dry": float(rng.uniform(0.1, 2.0)),
        "sample_time": float(rng.choice([125e-6, 250e-6])),
    }
    return draw(seed, {**creeping, **(bench or {})})


def unrest(bench, sensors, seed=0):
    """Return how the bench hunts under a command that stands still: RMS speed of the motor, and
    the output's travel in counts."""
    standing = Trial("sine", {"amplitude": 0.0, "bias": 5.0, "frequency": 1.0})
    done = run(bench, sensors, standing, seed, duration=6.0, start=0.2)
    late = done.time > 3.0
    travel = np.ptp(done.rows["output"][late]) / COUNT
    return float(np.sqrt(np.mean(done.rows["speed"][late] ** 2))), float(travel)
