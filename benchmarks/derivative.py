"""Where the speed controller's derivative action becomes unstable, beside the law that checks it.

    python benchmarks/derivative.py         # docs/explanation/theory/derivative.md: seconds

Speed mode, 30 rad/s against a brake of 1 N m, 0.1 s. Unstable: the torque reference of the last
40 ms scatters by more than 2 N m. The limit is found by bisection on K_p, with the core's check set
aside.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

import elevon
from elevon.errors import ElevonWarning

R, L, K = 2.75, 30.5e-3, 1.1 / 1.5
INERTIA = 2.675e-3
SCATTER = 2.0
HIGHEST = 50.0


class Unchecked(elevon.Actuator):
    """An actuator whose findings do not stop it."""

    def findings(self, fidelity: str = "high") -> list[dict[str, Any]]:  # noqa: ARG002
        """Nothing is found."""
        return []


def settings(case: dict[str, float | str], ratio: float) -> dict[str, Any]:
    """Values of a case at K_p T_d / J = `ratio`."""
    inertia, time = float(case.get("inertia", INERTIA)), float(case.get("time", 0.01))
    band = 2 * math.pi * float(case.get("bandwidth", 200.0))
    values: dict[str, Any] = {
        "motor.winding_resistance": R,
        "motor.winding_inductance": L,
        "motor.emf_constant": K,
        "motor.inertia": 0.5 * inertia,
        "gear.inertia": 0.5 * inertia,
        "motor.temperature_coefficient": 0.0,
        "control.torque_constant": 1.5 * K,
        "control.current_limit": 13.3,
        "control.speed_limit": 1e4,
        "control.speed_gain": ratio * inertia / time,
        "control.derivative_time": time,
        "control.derivative_filter": float(case.get("filter", 1000.0)),
        "control.sample_time": float(case.get("tick", 0.0)),
        "control.anti_windup_back_calculation": 0.0,
        "control.noise_deviation": 0.0,
        "sensor.current.noise_deviation": 0.0,
        "drive.kind": case["drive"],
        "inverter.hysteresis_band": float(case.get("band", 0.5)),
        "inverter.supply_voltage": float(case.get("supply", 380.0)),
        "pwm.proportional_gain": L * band,
        "pwm.integral_gain": R * band,
        "pwm.inductance": L,
        "pwm.emf_constant": K,
        "pwm.computation_delay": float(case.get("delay", 1.0)),
        "load.stiffness": 0.0,
    }
    if "load" in case:
        values |= {
            "backlash.model": "elastic",
            "backlash.stiffness": 1e4,
            "backlash.damping": 20.0,
            "load.inertia": float(case["load"]),
        }
    return values


def scatter(case: dict[str, float | str], ratio: float) -> float:
    """Standard deviation of the torque reference, N m; infinite where the run ends early."""
    actuator = elevon.Actuator.load("torino-rotary")
    free = Unchecked(**{f: getattr(actuator, f) for f in actuator.__dataclass_fields__})
    low = case.get("fidelity", "high") == "low"
    scenario = elevon.Scenario.from_dict(
        {
            "duration": 0.1,
            "command": {"mode": "speed", "terms": [{"kind": "constant", "value": 30.0}]},
            "load": {"brake": {"terms": [{"kind": "constant", "value": 1.0}]}},
        }
    )
    rec = elevon.simulate(
        free.with_values(settings(case, ratio)),
        scenario,
        fidelity="low" if low else "high",
        record=f"torque_ref@{2 if low else 20} kHz",
    )
    if rec.meta["status"] != "ok":
        return math.inf
    torque = rec["torque_ref"]
    return float(np.std(torque.values[torque.time > 0.06]))


def measured(case: dict[str, float | str], bisections: int = 8) -> float:
    """K_p T_d / J at which the case becomes unstable; infinite: not up to HIGHEST."""
    low, high = 0.1, HIGHEST
    if scatter(case, high) < SCATTER:
        return math.inf
    for _ in range(bisections):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if scatter(case, middle) > SCATTER else (middle, high)
    return math.sqrt(low * high)


def law(case: dict[str, float | str]) -> float:
    """K_p T_d / J that the core's check gives as the limit; infinite: it refuses nothing."""
    actuator = elevon.Actuator.load("torino-rotary")
    found = actuator.with_values(settings(case, HIGHEST)).findings(
        str(case.get("fidelity", "high"))
    )
    refused = [f for f in found if f["path"] == "control.speed_gain" and f["severity"] == "error"]
    if not refused:
        return math.inf
    inertia = float(case.get("inertia", INERTIA))
    return float(refused[0]["limit"]) * float(case.get("time", 0.01)) / inertia


CASES: list[dict[str, float | str]] = [
    {"drive": "pwm"},
    {"drive": "pwm", "bandwidth": 100.0},
    {"drive": "pwm", "bandwidth": 400.0},
    {"drive": "pwm", "delay": 0.0},
    {"drive": "pwm", "delay": 0.5},
    {"drive": "pwm", "filter": 100.0},
    {"drive": "pwm", "filter": 10.0},
    {"drive": "pwm", "time": 0.003},
    {"drive": "pwm", "time": 0.03},
    {"drive": "pwm", "inertia": 0.01},
    {"drive": "pwm", "load": 0.5},
    {"drive": "pwm", "tick": 125e-6},
    {"drive": "pwm", "tick": 500e-6},
    {"drive": "pwm", "tick": 1e-3},
    {"drive": "hysteresis"},
    {"drive": "hysteresis", "filter": 10.0},
    {"drive": "hysteresis", "time": 0.03},
    {"drive": "hysteresis", "inertia": 0.01},
    {"drive": "hysteresis", "load": 0.5},
    {"drive": "hysteresis", "band": 0.1},
    {"drive": "hysteresis", "tick": 60e-6},
    {"drive": "hysteresis", "tick": 250e-6},
    {"drive": "hysteresis", "tick": 1e-3},
    {"drive": "hysteresis", "tick": 2e-3},
    {"drive": "hysteresis", "tick": 2e-3, "filter": 5.0},
    {"drive": "pwm", "fidelity": "low"},
    {"drive": "hysteresis", "fidelity": "low"},
]


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore", ElevonWarning)
    print(f"{'case':58} {'measured':>9} {'law':>7}")
    for case in CASES:
        text = ", ".join(f"{k} {v:g}" if isinstance(v, float) else f"{v}" for k, v in case.items())
        print(f"{text:58} {measured(case):9.3g} {law(case):7.3g}", flush=True)


if __name__ == "__main__":
    main()
