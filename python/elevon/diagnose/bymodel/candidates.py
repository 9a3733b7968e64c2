"""Faults that are weighed against each other, how often they come, and how far they go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from elevon.diagnose.bymodel.not_modelled import not_modelled
from elevon.errors import InputError, unknown

__all__ = ["CANDIDATES", "Candidate", "chosen"]


@dataclass(frozen=True)
class Candidate:
    """A fault of the catalogue.

    Attributes
    ----------
    kind, place : str
        Of the catalogue.
    unit : str
        Of the severity.
    low, high : float
        Severities considered.
    rate : float
        Failures per hour: the prior weight.
    error : float
        Deviation of the model's shift of the evidence, as a share of it.
    same : tuple of str
        Places of the same kind that no log without the electrical zero tells from this one.
    still : tuple of str
        Evidence that the fault leaves alone, although the low model moves it.
    sure : tuple of str
        Evidence whose shift is known; what moves beside it depends on an angle that no log tells,
        so it only makes that evidence uncertain. Empty: all of it.
    akin : tuple of (str, str)
        Faults that are not weighed themselves, since in closed form they move the same evidence.
    switched : bool
        Whether it is there or not: it acts in full from one half on.
    """

    kind: str
    place: str
    unit: str
    low: float
    high: float
    rate: float
    error: float
    same: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    sure: tuple[str, ...] = ()
    akin: tuple[tuple[str, str], ...] = ()
    switched: bool = False

    @property
    def key(self) -> str:
        """``KIND@PLACE``."""
        return f"{self.kind}@{self.place}"

    def text(self, severity: float) -> str:
        """Return the fault in the grammar of faults."""
        return f"{self.key}={severity!r}"


# Reference: T3 Table 1.1, per hour: bearings 1.78e-5 (friction), position sensor 1.70e-5, motor
# 1.03e-5, power connector 6.64e-7. An item's rate is shared evenly by its kinds (ASSUMED). The
# table has no gear, no drive, no current sensor and no unbalance: backlash like the bearings,
# unbalance and worn teeth a tenth of them, drift of a gain like the position sensor, and a current
# sensor like that, too, shared by gain, offset and failure (ASSUMED).
_BEARING, _SENSOR, _MOTOR, _CONNECTOR = 1.78e-5, 1.70e-5, 1.03e-5, 6.64e-7
_PHASES = tuple(f"motor.phase_{p}" for p in "abc")
_RINGS = tuple(f"bearing.{p}" for p in ("outer", "inner", "ball"))
_CURRENTS = tuple(f"sensor.current_{p}" for p in "abc")
_VOLTAGES = ("voltage_per_speed", "voltage_order_1", "voltage_order_2", "voltage_sideband")

# How well the low model knows what a fault does, ASSUMED from benches with another friction law,
# elastic backlash and a PWM drive: positions and gains are geometry and arithmetic, ripples depend
# on what the current loop makes of them, friction on its law.
#
# A current sensor's gain leaves the motor as it is, so its EMF stays balanced; the low model puts
# the wrong current into the motor's constants and moves the voltage as a short would.
#
# A weak pole pair multiplies the coefficient of phase j by a window of
# theta_m - phi - 2 pi (j-1)/3, whose first harmonic is a dynamic eccentricity: the same sideband.
#
# An encoder's gain is seen as the ratio of the two positions, and so is, with the other sign, a
# resolver's. Whether it reaches the position loop depends on where the drive closes it, which no
# healthy log tells.
CANDIDATES: tuple[Candidate, ...] = (
    Candidate("backlash", "transmission", "rad", 0.0, 0.03, _BEARING, 0.01),
    Candidate("friction", "transmission", "1", 0.0, 2.0, _BEARING / 3, 0.08),
    Candidate("lubrication", "transmission", "1", -0.7, 5.0, _BEARING / 3, 0.10),
    Candidate("short", _PHASES[0], "1", 0.0, 0.6, _MOTOR / 4, 0.10, _PHASES[1:]),
    Candidate("eccentricity_static", "motor", "1", 0.0, 0.6, _MOTOR / 4, 0.05),
    Candidate("eccentricity_dynamic", "motor", "1", 0.0, 0.6, _MOTOR / 4, 0.10,
              sure=("current_sideband", "voltage_sideband"),
              akin=(("local_demagnetisation", "motor"),)),
    Candidate("demagnetisation", "motor", "1", 0.0, 0.4, _MOTOR / 4, 0.05),
    Candidate("unbalance", "motor.rotor", "kg m2", 0.0, 4e-4, _BEARING / 10, 0.05),
    Candidate("gain_drift", "control.position", "1", -0.4, 0.6, _SENSOR / 2, 0.003),
    Candidate("gain_drift", "control.speed", "1", -0.5, 1.0, _SENSOR / 2, 0.05),
    Candidate("gain", "sensor.encoder", "1", -0.04, 0.04, _SENSOR, 0.01, sure=("position_scale",),
              akin=(("gain", "sensor.resolver"),)),
    Candidate("gain", _CURRENTS[0], "1", -0.3, 0.3, _SENSOR / 3, 0.10, _CURRENTS[1:], _VOLTAGES),
    Candidate("tooth_wear", "gear", "rad", 0.0, 0.006, _BEARING / 10, 0.50),
    Candidate("sag", "supply", "1", 0.0, 0.4, _CONNECTOR, 0.10),
    Candidate("bearing", _RINGS[0], "m", 0.0, 0.005, _BEARING / 3, 0.30, _RINGS[1:]),
)  # fmt: skip


def chosen(texts: Sequence[str] | None) -> tuple[Candidate, ...]:
    """Return the candidates, or those named as ``KIND@PLACE`` (any of equivalent places).

    Raises
    ------
    UnknownNameError
        None of that name is weighed by the model.
    InputError
        One is named twice, or is not weighed, with the reason.
    """
    if not texts:
        return CANDIDATES
    out: list[Candidate] = []
    names = [f"{c.kind}@{p}" for c in CANDIDATES for p in (c.place, *c.same)]
    reasons = {f"{item['kind']}@{item['place']}": item["reason"] for item in not_modelled()}
    for text in texts:
        key = text.strip()
        if key in reasons:
            raise InputError(f"--fault {key}: not weighed by the model: {reasons[key]}")
        if key not in names:
            raise unknown("fault", key, names, "--fault")
        item = next(c for c in CANDIDATES if key in {f"{c.kind}@{p}" for p in (c.place, *c.same)})
        if item in out:
            raise InputError(f"--fault {key}: {item.key} is already among the candidates")
        out.append(item)
    return tuple(out)
