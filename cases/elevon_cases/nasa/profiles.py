"""The stand's motion profiles and loads as scenarios."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from elevon.actuator import Actuator
from elevon.errors import InputError, RangeError, unknown
from elevon.parameters.relations import torque_constant
from elevon.progress import Progress

LoadKind = Literal["constant", "step", "spring"]
LOAD_KINDS: tuple[LoadKind, ...] = ("constant", "step", "spring")

HOLD = 1.0
"""Time a trapezoid stands at each end [s]."""

PROFILES = {
    "rectangular": False,
    "trapezoidal": True,
    "sinusoidal": True,
    "triangular": True,
    "sweep": False,
}
"""Name of each profile, and whether its rate is asked of the actuator (ramped): a jump or a
sweep may ask for more than it can give, a ramp may not."""


@dataclass(frozen=True, slots=True)
class MotionProfile:
    """One motion about mid-stroke.

    Attributes
    ----------
    name : str
        One of `PROFILES`.
    amplitude : float
        m, peak value.
    rate : float
        m/s, peak; of a sweep that of its first cycle, whose end has twice this rate.
    duration : float
        s.
    acceleration : float
        m/s2, at which the corners of a triangle or a trapezoid are rounded; 0: sharp, as the
        paper draws them.
    """

    name: str
    amplitude: float
    rate: float
    duration: float
    acceleration: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no profile."""
        if self.name not in PROFILES:
            raise unknown("profile", self.name, PROFILES)
        if self.acceleration and self.name not in ("trapezoidal", "triangular"):
            raise InputError(
                f"profile {self.name}: has no corners to round; acceleration must be 0"
            )
        if self.amplitude < 0.0 or self.rate <= 0.0 or self.duration <= 0.0:
            raise InputError(
                f"profile {self.name}: amplitude {self.amplitude:g} m must not be negative; rate "
                f"{self.rate:g} m/s and duration {self.duration:g} s must be positive"
            )

    @property
    def ramped(self) -> bool:
        """Whether the rate is asked of the actuator."""
        return PROFILES[self.name]

    @property
    def peak_rate(self) -> float:
        """Largest commanded rate, m/s; infinite for jumps."""
        if self.amplitude == 0.0:
            return 0.0
        if self.name == "rectangular":
            return math.inf
        return 2.0 * self.rate if self.name == "sweep" else self.rate

    @property
    def peak_acceleration(self) -> float:
        """Largest commanded acceleration, m/s2; sharp corners, which ask for any, left out."""
        if self.name in ("sinusoidal", "sweep") and self.amplitude > 0.0:
            return self.peak_rate**2 / self.amplitude
        return self.acceleration

    @property
    def period(self) -> float:
        """Length of a cycle, s; infinite where no cycle is like the next."""
        if self.amplitude == 0.0 or self.name == "sweep":
            return math.inf
        if self.name == "sinusoidal":
            return 2.0 * math.pi * self.amplitude / self.rate
        holds = 2.0 * HOLD if self.name == "trapezoidal" else 0.0
        return 4.0 * self.amplitude / self.rate + holds

    def term(self) -> dict[str, object]:
        """Return the waveform; every profile starts at mid-stroke."""
        a, v = self.amplitude, self.rate
        if a == 0.0:
            return {"kind": "constant", "value": 0.0}
        if self.name == "rectangular":
            return {"kind": "rectangle", "low": -a, "high": a, "period": 4.0 * a / v}
        if self.name == "trapezoidal":
            ramp = 2.0 * a / v
            # Entered in the middle of its rise.
            return {
                "kind": "trapezoid", "low": -a, "high": a, "rise": ramp, "fall": ramp,
                "hold_high": HOLD, "hold_low": HOLD, "start": -0.5 * ramp,
                "acceleration": self.acceleration,
            }  # fmt: skip
        if self.name == "sinusoidal":
            return {"kind": "sine", "amplitude": a, "frequency": v / (2.0 * math.pi * a)}
        if self.name == "triangular":
            frequency = v / (4.0 * a)
            return {"kind": "triangle", "amplitude": a, "frequency": frequency,
                    "acceleration": self.acceleration}  # fmt: skip
        period = 2.0 * math.pi * a / v
        return {
            "kind": "period_sweep", "amplitude": a, "start_period": period,
            "end_period": 0.5 * period, "sweep_time": self.duration,
        }  # fmt: skip


def profile_scenario(
    profile: MotionProfile, load: float = 0.0, kind: LoadKind = "constant", opposing: float = 0.0
) -> dict[str, object]:
    """Return the scenario of a profile under a load.

    Parameters
    ----------
    profile : MotionProfile
        The motion.
    load : float
        N, positive compressive (opposes extension), negative tensile.
    kind : str
        ``constant``; ``step``: from nothing at half time; ``spring``: proportional to the
        position, `load` at the profile's amplitude.
    opposing : float
        N, resists motion of either direction.

    Returns
    -------
    dict
        In the form of a scenario file, SI.

    Raises
    ------
    InputError
        A load kind that is none, or a spring without amplitude.
    """
    if kind not in LOAD_KINDS:
        raise unknown("load kind", kind, LOAD_KINDS)
    data: dict[str, Any] = {
        "duration": profile.duration,
        "command": {"mode": "position", "terms": [profile.term()]},
    }
    loads: dict[str, Any] = {}
    if kind == "spring" and load != 0.0:
        if profile.amplitude == 0.0:
            raise InputError(f"profile {profile.name}: a spring load needs an amplitude above 0 mm")
        data["parameters"] = {"load.stiffness": abs(load) / profile.amplitude}
    elif kind == "step":
        step = {"kind": "step", "final": load, "time": 0.5 * profile.duration}
        loads["output"] = {"terms": [step]}
    elif load != 0.0:
        loads["output"] = {"terms": [{"kind": "constant", "value": load}]}
    if opposing:
        loads["brake"] = {"terms": [{"kind": "constant", "value": opposing}]}
    return {**data, "load": loads} if loads else data


@dataclass(frozen=True, slots=True)
class Capability:
    """Torque, speed and acceleration that motor, link and limits allow.

    Attributes
    ----------
    travel_per_radian : float
        m/rad of the motor.
    emf, resistance, reactance : float
        V s/rad, ohm and V s/(rad A): k, R and p L.
    voltage : float
        V, largest phase voltage, link / sqrt 3.
    friction, viscous : float
        N m and N m s/rad on the motor, without the preload.
    preload, preload_torque : float
        N, and N m on the motor without load.
    load_friction : float
        N on the load side.
    efficiency : float
        Against the motion, gear and screw.
    inertia : float
        kg m2 on the motor, the load's mass included.
    speed_limit, current_limit, rated_current : float
        rad/s, A, A.
    stops : tuple of float
        m, lower and upper.
    """

    travel_per_radian: float
    emf: float
    resistance: float
    reactance: float
    voltage: float
    friction: float
    viscous: float
    preload: float
    preload_torque: float
    load_friction: float
    efficiency: float
    inertia: float
    speed_limit: float
    current_limit: float
    rated_current: float
    stops: tuple[float, float]

    @classmethod
    def of(cls, actuator: Actuator) -> Capability:
        """Read the numbers of an actuator of the wiring ``ballscrew``.

        Raises
        ------
        InputError
            The actuator is of another wiring.
        """
        if actuator.wiring != "ballscrew":
            raise InputError(
                f"{actuator.name}: a {actuator.wiring} actuator has no screw; "
                "the profiles of the stand need the wiring ballscrew"
            )
        value = actuator.parameters.value
        ratio = value("gear.ratio")
        travel = value("screw.lead") / ratio
        eta, aiding = value("screw.efficiency"), value("screw.efficiency_aiding")
        preload = value("screw.preload") * travel * (1.0 / eta - aiding)
        rotor = value("motor.inertia") + value("gear.inertia") + value("screw.inertia") / ratio**2
        return cls(
            travel_per_radian=travel,
            emf=value("motor.emf_constant"),
            resistance=value("motor.winding_resistance"),
            reactance=value("motor.pole_pairs") * value("motor.winding_inductance"),
            voltage=value("inverter.supply_voltage") / math.sqrt(3.0),
            friction=value("friction.dynamic"),
            viscous=value("friction.viscous"),
            preload=value("screw.preload"),
            preload_torque=preload,
            load_friction=value("load.friction"),
            efficiency=eta * value("gear.efficiency"),
            inertia=rotor + value("load.mass") * travel**2,
            speed_limit=value("control.speed_limit"),
            current_limit=value("control.current_limit"),
            rated_current=value("rating.current"),
            stops=(value("stop.lower"), value("stop.upper")),
        )

    def current(self, load: float, rate: float = 0.0) -> float:
        """Return the quadrature current [A] of steady motion at `rate` [m/s] against `load` [N]."""
        force = (abs(load) + self.load_friction) * self.travel_per_radian / self.efficiency
        drag = self.viscous * rate / self.travel_per_radian
        drag += self.preload_torque * self._relieved(abs(load) + self.load_friction)
        return (force + self.friction + drag) / torque_constant(self.emf)

    def _relieved(self, force: float) -> float:
        """Load that the relieved half of the nut keeps, over the preload."""
        if self.preload <= 0.0 or force >= 2.0**1.5 * self.preload:
            return 0.0
        from scipy.optimize import brentq

        # Halves of (1 +- u)^(3/2) preloads, by Hertz; their difference is the force.
        def excess(u: float) -> float:
            return float((1.0 + u) ** 1.5 - (1.0 - u) ** 1.5 - force / self.preload)

        return float((1.0 - float(brentq(excess, 0.0, 1.0))) ** 1.5)

    def voltage_rate(self, load: float) -> float:
        """Return the rate [m/s] at which the link's voltage is used up against `load` [N]."""
        current = self.current(load)
        # (k^2 + p^2 L^2 i^2) w^2 + 2 R i k w + R^2 i^2 = V^2
        square = self.emf**2 + (self.reactance * current) ** 2
        half = self.resistance * current * self.emf
        constant = (self.resistance * current) ** 2 - self.voltage**2
        root = half * half - square * constant
        speed = (math.sqrt(root) - half) / square if constant < 0.0 else 0.0
        return self.travel_per_radian * speed

    def rate(self, load: float) -> tuple[float, str]:
        """Return the largest steady rate [m/s] against `load` [N] and what sets it."""
        limits = [
            (self.travel_per_radian * self.speed_limit, "control.speed_limit"),
            (self.voltage_rate(load), "inverter.supply_voltage"),
        ]
        return min(limits)

    def acceleration(self, load: float, rate: float = 0.0) -> float:
        """Return the largest acceleration [m/s2] against `load` [N] at `rate` [m/s]."""
        spare = torque_constant(self.emf) * (self.current_limit - self.current(load, rate))
        return self.travel_per_radian * spare / self.inertia

    def refusal(self, profile: MotionProfile, load: float, opposing: float = 0.0) -> str | None:
        """Return why a profile cannot be run, or None; jumps and sweeps only need the stroke."""
        force = abs(load) + opposing
        lower, upper = self.stops
        if profile.amplitude > min(upper, -lower):
            return (
                f"amplitude {1e3 * profile.amplitude:g} mm lies beyond the end stops, "
                f"stop.lower {1e3 * lower:g} and stop.upper {1e3 * upper:g} mm"
            )
        needed = self.current(force)
        if needed > self.current_limit:
            return (
                f"load {force:g} N needs {needed:.3g} A, more than control.current_limit, "
                f"{self.current_limit:g} A"
            )
        if not profile.ramped:
            return None
        rate, cause = self.rate(force)
        if profile.peak_rate > rate:
            return (
                f"rate {100 * profile.peak_rate:.4g} cm/s exceeds {100 * rate:.4g} cm/s under "
                f"{force:g} N, set by {cause}"
            )
        possible = self.acceleration(force)
        if profile.peak_acceleration > possible:
            return (
                f"acceleration {profile.peak_acceleration:.3g} m/s2 exceeds {possible:.3g} m/s2 "
                f"under {force:g} N, set by control.current_limit"
            )
        return None

    def check(self, profile: MotionProfile, load: float, opposing: float = 0.0) -> None:
        """Raise `RangeError` for a profile that cannot be run."""
        reason = self.refusal(profile, load, opposing)
        if reason is not None:
            raise RangeError(f"profile {profile.name}: {reason}")

    def limited(self, profile: MotionProfile, load: float, opposing: float = 0.0) -> bool:
        """Tell whether a jump or a sweep requests more than the actuator can give."""
        force = abs(load) + opposing
        too_fast = profile.peak_rate > self.rate(force)[0]
        return too_fast or profile.peak_acceleration > self.acceleration(force)


ACCELERATION = 1.0
"""m/s2 at a rounded corner (ASSUMED): 4 A of the 20 A there are."""
DURATION = 8.0
SETTLE = 1.0


def corner_rows(actuator: Actuator, progress: Progress | None = None) -> list[dict[str, object]]:
    """Return peak and rms current and the tracking error, sharp and rounded, unloaded and loaded.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import Run, completed, simulate_batch

    cases = list(product(("trapezoidal", "triangular"), (0.0, 8500.0), (0.0, ACCELERATION)))
    runs = [
        Run(
            actuator,
            Scenario.from_dict(
                profile_scenario(MotionProfile(shape, 0.05, 0.06, DURATION, acceleration), load)
            ),
            label=f"{shape}, {load:g} N",
        )
        for shape, load, acceleration in cases
    ]
    record = "command,output_position,current_ref@2 kHz"
    rows = []
    recordings = simulate_batch(runs, fidelity="high", record=record, progress=progress)
    for (shape, load, acceleration), recording in zip(cases, completed(recordings), strict=True):
        late = recording["command"].time >= SETTLE
        current = recording["current_ref"].values[late]
        error = (recording["command"].values - recording["output_position"].values)[late]
        rows.append(
            {
                "profile": shape,
                "load_n": load,
                "acceleration_m_s2": acceleration,
                "peak_current_a": round(float(np.max(np.abs(current))), 2),
                "rms_current_a": round(float(np.sqrt(np.mean(current**2))), 3),
                "tracking_max_mm": round(1e3 * float(np.max(np.abs(error))), 3),
            }
        )
    return rows
