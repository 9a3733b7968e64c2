"""What a ballscrew actuator can follow, from its parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass

from elevon.actuator import Actuator
from elevon.errors import InputError, RangeError
from elevon.parameters.relations import torque_constant
from elevon.reproduce.nasa.profiles import MotionProfile


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
