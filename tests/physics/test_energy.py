"""Energy: what the supply gives is what is lost, stored or delivered."""

from __future__ import annotations

import numpy as np
import pytest

from tests.physics.rig import HYSTERESIS, INERTIA, MOTOR, PWM, L, R, constant, run, term, values

SINKS = (
    "energy_copper",
    "energy_inverter",
    "energy_friction",
    "energy_brake",
    "energy_load",
    "energy_impact",
)
STORES = ("energy_kinetic", "energy_magnetic")
LOADS = {
    "no load": {},
    "brake": {"load": {"brake": {"terms": [constant(1.0)]}}},
    "output load": {"load": {"output": {"terms": [constant(100.0)]}}},
}
# Two masses: the contact's spring stores, its damper loses; both are in the impact account.
ELASTIC = {
    "backlash.model": "elastic",
    "backlash.stiffness": 1e4,
    "backlash.damping": 20.0,
    "load.inertia": 0.5,
    "load.stiffness": 0.8,
}
LOSSY = {"inverter.on_resistance": 0.2, "inverter.diode_drop": 1.0, "inverter.dead_time": 2.4e-6}


DRIVES = {
    "hysteresis": HYSTERESIS,
    "pwm": PWM,
    "lossy-hysteresis": HYSTERESIS | LOSSY,
    "lossy-pwm": PWM | LOSSY,
    "lossy-located": HYSTERESIS | LOSSY | {"inverter.relay_crossing": "located"},
    "elastic-backlash": HYSTERESIS | ELASTIC,
}


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("load", LOADS)
def test_energy_balances_over_a_cycle(drive: str, load: str) -> None:
    """One cycle of a sine: the books close within 0.1 % of what the supply gave."""
    names = ("energy_supply", *SINKS, *STORES)
    rec = run(
        MOTOR | DRIVES[drive],
        duration=0.5,
        command=[term("sine", amplitude="7 deg", frequency="2 Hz")],
        record=",".join(names) + "@2 kHz",
        scenario=LOADS[load],
    )
    change = {name: rec[name].values[-1] - rec[name].values[0] for name in names}
    lost = sum(change[name] for name in SINKS) + sum(change[name] for name in STORES)
    assert change["energy_supply"] > 0.1
    assert abs(change["energy_supply"] - lost) < 1e-3 * change["energy_supply"]
    assert change["energy_copper"] > 0.0
    assert change["energy_friction"] > 0.0


def test_each_account_is_what_its_name_says() -> None:
    """Every account recomputed from the recorded signals at every step, by midpoints.

    The signals are samples of the same run, so this catches a balance that closes because a term
    was defined as the remainder. 1 %: midpoints of samples that a relay may have switched in
    between.
    """
    rec = run(
        MOTOR | HYSTERESIS,
        duration=0.1,
        command=[term("sine", amplitude="7 deg", frequency="5 Hz")],
        record="@every",
        scenario=LOADS["brake"],
    )
    time = rec["current_a"].time
    currents = np.stack(values(rec, "current_a", "current_b", "current_c"))
    speed, torque, friction = values(rec, "motor_speed", "motor_torque", "friction_torque")

    def integral(power: np.ndarray) -> float:
        return float(np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(time)))

    def change(name: str) -> float:
        return float(rec[name].values[-1] - rec[name].values[0])

    assert change("energy_copper") == pytest.approx(
        integral(R * (currents**2).sum(axis=0)), rel=0.01
    )
    kinetic = 0.5 * INERTIA * speed**2
    assert change("energy_kinetic") == pytest.approx(kinetic[-1] - kinetic[0], rel=0.01)
    magnetic = 0.5 * L * (currents**2).sum(axis=0)
    assert change("energy_magnetic") == pytest.approx(
        magnetic[-1] - magnetic[0], rel=0.01, abs=1e-4
    )
    rubbed = change("energy_friction") + change("energy_brake")
    assert change("energy_brake") == pytest.approx(integral(np.abs(speed)), rel=0.01)
    assert rubbed == pytest.approx(integral(friction * speed), rel=0.01)
    assert change("energy_load") == 0.0
    assert integral(torque * speed) == pytest.approx(change("energy_kinetic") + rubbed, rel=0.01)
