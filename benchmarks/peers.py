"""Other simulators on the common job, or on as much of it as they can express, when installed.

Every entry says what part of the job it ran: none of them but scipy's has the relays, the
stick-slip friction and the backlash, so their figures flatter them.
"""

from __future__ import annotations

import importlib.util
import math
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

R, L, K, P, INERTIA, SUPPLY = 2.75, 30.5e-3, 1.1 / 1.5, 4, 7.7e-4 + 1.9e-3, 380.0
AMPLITUDE, OMEGA = math.radians(7.0), 2 * math.pi * 0.2


def with_scipy() -> dict[str, Any]:
    """The tests' event-located oracle (scipy's DOP853 between relay switchings): the whole job, 50
    ms.
    """
    from tests.oracle.rotary import Numbers, simulate

    numbers = Numbers(
        resistance=R,
        inductance=L,
        k=K,
        pole_pairs=P,
        electrical_offset=math.pi / 2,
        inertia=INERTIA,
        viscous=1e-3,
        friction_static=0.12,
        friction_dynamic=0.06,
        torque_maximum=1e9,
        ratio=124.0,
        half_backlash=math.radians(0.1),
        supply=SUPPLY,
        half_band=0.5,
        gain_position=20 * 124.0,
        speed_limit=1e9,
        kp=0.3,
        ki=6.0,
        kt=1.5 * K,
        current_limit=20.0,
        conditional=True,
    )
    start = time.perf_counter()
    trace = simulate(numbers, lambda t: AMPLITUDE * math.sin(OMEGA * t), 0.05)
    wall = time.perf_counter() - start
    return {
        "s_per_simulated_s": wall / 0.05,
        "ran": "whole job, event-located DOP853, 50 ms",
        "output_deg": math.degrees(trace.output[-1]),
    }


def with_motulator() -> dict[str, Any]:
    """Motor, two-level bridge with a 4 kHz carrier, current and speed loops; no relays, friction,
    gear or backlash.
    """
    from motulator.drive import model
    from motulator.drive.control import sm
    from motulator.drive.utils import SynchronousMachinePars

    pars = SynchronousMachinePars(n_p=P, R_s=R, L_d=L, L_q=L, psi_f=K / P)
    drive = model.Drive(
        model.VoltageSourceConverter(u_dc=SUPPLY),
        model.SynchronousMachine(pars),
        model.StiffMechanicalSystem(J=INERTIA, B_L=1e-3),
    )
    drive.pwm = model.CarrierComparison()
    control = sm.CurrentVectorControl(
        pars,
        sm.CurrentReferenceCfg(pars, nom_w_m=800.0, max_i_s=20.0),
        T_s=125e-6,
        J=INERTIA,
        sensorless=False,
    )
    control.ref.w_m = lambda t: P * 124.0 * AMPLITUDE * OMEGA * np.cos(OMEGA * t)
    start = time.perf_counter()
    model.Simulation(drive, control).simulate(t_stop=0.1)
    return {
        "s_per_simulated_s": (time.perf_counter() - start) / 0.1,
        "ran": "motulator: motor, carrier bridge, current and speed loops, 0.1 s",
    }


def with_gym_electric_motor() -> dict[str, Any]:
    """Motor and switched bridge at 1e-6 s with three relays written in Python; no friction, gear
    or backlash.
    """
    import gym_electric_motor as gem

    warnings.simplefilter("ignore")
    motor = {
        "motor_parameter": {
            "p": P,
            "r_s": R,
            "l_d": L,
            "l_q": L,
            "psi_p": K / P,
            "j_rotor": INERTIA,
        }
    }
    env = gem.make(
        "Finite-CC-PMSM-v0", tau=1e-6, motor=motor, supply={"u_nominal": SUPPLY}
    ).unwrapped
    env.reset()
    physical = env.physical_system
    names = list(physical.state_names)
    phase, angle = [names.index(f"i_{j}") for j in "abc"], names.index("epsilon")
    legs, steps = [0, 0, 0], 2000
    shifts = np.array([0.0, -2 * math.pi / 3, 2 * math.pi / 3])
    state = physical.reset()
    start = time.perf_counter()
    for _ in range(steps):
        values = state * physical.limits
        error = 2.0 * np.cos(values[angle] + shifts) - values[phase]
        legs = [
            1 if e > 0.5 else 0 if e < -0.5 else leg for e, leg in zip(error, legs, strict=True)
        ]
        state = physical.simulate(4 * legs[0] + 2 * legs[1] + legs[2])
    return {
        "s_per_simulated_s": (time.perf_counter() - start) / (steps * 1e-6),
        "ran": "gym-electric-motor: motor, bridge, Python relays, 2000 steps of 1e-6 s, scaled",
    }


PEERS: dict[str, tuple[str, Callable[[], dict[str, Any]]]] = {
    "scipy": ("scipy", with_scipy),
    "motulator": ("motulator", with_motulator),
    "gym_electric_motor": ("gym_electric_motor", with_gym_electric_motor),
}


def measure() -> dict[str, dict[str, Any]]:
    """Every peer that is installed; the others are named as missing."""
    found: dict[str, dict[str, Any]] = {}
    for name, (module, call) in PEERS.items():
        if importlib.util.find_spec(module) is None:
            found[name] = {"ran": "not installed"}
            continue
        try:
            found[name] = call()
        # A peer that breaks must not take our own figures with it: its error is its result.
        except Exception as error:  # noqa: BLE001
            found[name] = {"ran": f"failed: {type(error).__name__}: {error}"}
    return found


if __name__ == "__main__":
    import json

    print(json.dumps(measure(), indent=2))
