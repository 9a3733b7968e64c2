"""The stand's motion profiles and loads as scenarios."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from elevon.errors import InputError, unknown

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
