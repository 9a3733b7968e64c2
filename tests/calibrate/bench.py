"""Logs of a bench with a known truth, in the drive's format: switching model, PWM drive, noise."""

import json
import math
from dataclasses import dataclass, field

import numpy as np

from elevon import Actuator, Scenario
from elevon.logs.formats.drive import write_drive_csv
from elevon.logs.formats.loadcell import write_loadcell
from elevon.simulate import Run, simulate_batch

ARM, CHAIN = 0.1, 4.5
COUNT = 2 * math.pi / 80_000
CASES = {
    "noload": ({"kind": "sine", "amplitude": "7 deg", "bias": "10 deg", "frequency": "0.2 Hz"}, ()),
    "loaded": (
        {"kind": "sine", "amplitude": "45 deg", "bias": "60 deg", "frequency": "0.05 Hz"},
        ({"kind": "ramp", "initial": "0.2 N m", "slope": 0.09, "start": "0 s", "end": "20 s"},),
    ),
    "chirp": (
        {"kind": "chirp", "amplitude": "1 deg", "bias": "3 deg", "start_frequency": "0.1 Hz",
         "end_frequency": "6 Hz", "sweep_time": "20 s"},
        (),
    ),
}  # fmt: skip

#: Far from the actuator file's values in everything that is estimated.
VALUES = {
    "drive.kind": "pwm",
    "solver.step": 2.5e-6,
    "control.sample_time": "125 us",
    "control.derivative_filter": 10,
    "control.derivative_time": 0.008,
    "control.speed_gain": 0.17,
    "control.integral_time": 0.22,
    "sensor.current.noise_deviation": 0.02,
    "sensor.current.noise_sample_time": 125e-6,
    "motor.inertia": 9e-4,
    "motor.emf_constant": 0.85,
    "control.torque_constant": 1.275,
    "pwm.emf_constant": 0.85,
    "friction.dynamic": 0.22,
    "friction.static": 0.30,
    "friction.viscous": 5e-3,
    "backlash.total": "0.6 deg",
}


@dataclass
class Truth:
    """A bench: its actuator and what its sensors add."""

    actuator: Actuator
    encoder: float = 0.0123
    motor: float = 5.0
    current: float = 0.05
    speed: float = 0.08
    recordings: dict = field(default_factory=dict)

    @property
    def values(self):
        """Return true values by the name of the estimate."""
        value = self.actuator.parameters.value
        output = value("load.inertia") / value("gear.ratio") ** 2
        known = {
            "derived.inertia": value("motor.inertia") + value("gear.inertia") + output,
            "derived.torque_constant": 1.5 * value("motor.emf_constant"),
            "derived.integral_gain": value("control.speed_gain") / value("control.integral_time"),
            "sensor.current_offset": self.current,
            "sensor.speed_offset": self.speed,
            "sensor.encoder.offset": self.encoder - self.motor / value("gear.ratio"),
        }
        paths = ("backlash.total", "friction.dynamic", "friction.viscous", "motor.emf_constant",
                 "motor.inertia", "control.speed_gain", "control.integral_time")  # fmt: skip
        return known | {path: value(path) for path in paths}


def make_truth(values=None, cases=tuple(CASES), seed=0, **sensors):
    """Run the bench."""
    actuator = Actuator.load("torino-rotary").with_values({**VALUES, **(values or {})})
    runs = []
    for name in cases:
        command, brake = CASES[name]
        document = {"duration": "20 s", "command": {"mode": "position", "terms": [command]}}
        if brake:
            document["load"] = {"brake": {"terms": list(brake)}}
        runs.append(Run(actuator, Scenario.from_dict(document), seed=seed, label=name))
    kept = simulate_batch(runs, record="drive_log,brake_torque,output_position@400 Hz")
    return Truth(actuator, recordings=dict(zip(cases, kept, strict=True)), **sensors)


def write_logs(truth, folder, *, seed=0, cell=True, encoder_gain=1.0, noted=1.0, names=None):
    """Write a truth's logs with noisy sensors; `noted` scales the amplitude the operator notes."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    paths = []
    for name in names or truth.recordings:
        recording = truth.recordings[name]
        command, brake = CASES[name]
        time = recording["speed_ref"].time
        n = len(time)
        trigger = 1.0 + 0.5 * rng.random()
        signals = {
            "time": time,
            "encoder_position": encoder_gain * recording["encoder_position"].values + truth.encoder,
            "motor_position": recording["motor_position"].values + truth.motor,
            "speed_ref": recording["speed_ref"].values,
            "motor_speed": recording["motor_speed"].values + truth.speed + rng.normal(0, 0.05, n),
            "current_ref": recording["current_ref"].values,
            "current_d_meas": recording["current_d_meas"].values,
            "current_q_meas": recording["current_q_meas"].values
            + truth.current
            + rng.normal(0, 0.03, n),
            "voltage_q_ref": recording["voltage_q_ref"].values,
            "trigger": (time >= trigger).astype(float),
        }
        paths.append(write_drive_csv(folder / f"{name}.csv", signals, force=True))
        note = {"waveform": command["kind"], "brake": "on" if brake else "off", "current": "rms"}
        note |= {k: v for k, v in command.items() if k != "kind"}
        number, unit = note["amplitude"].split()
        note["amplitude"] = f"{noted * float(number)!r} {unit}"
        if brake and cell:
            cell_time = np.arange(0.0, 20.0 - trigger, 1 / 80)
            at = trigger + 1.0008 * cell_time
            torque = np.interp(at, time, recording["brake_torque"].values)
            sign = np.sign(np.interp(at, time, recording["motor_speed"].values))
            force = sign * torque * CHAIN / ARM + rng.normal(0, 0.3, len(cell_time))
            write_loadcell(folder / f"{name}_loadcell.csv", cell_time, force, force=True)
            note |= {"load_cell_arm": ARM, "chain_ratio": CHAIN}
        (folder / f"{name}_command.json").write_text(json.dumps(note))
    return paths
