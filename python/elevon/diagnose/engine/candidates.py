"""Faults that are candidates of a diagnosis, how often they come, and how far they go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.door import turns
from elevon.errors import InputError, unknown
from elevon.faults import FaultRecord, catalogue
from elevon.simulate.acting import own_faults

if TYPE_CHECKING:
    from elevon.actuator import Actuator


_LAW = "motor.eccentricity_law"


@dataclass(frozen=True)
class CandidateFault:
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
        Deviation of the model's shift of the features, as a share of it.
    same : tuple of str
        Places of the same kind that no log without the electrical zero tells from this one.
    fixed_features : tuple of str
        Features that the fault leaves alone, although the reduced-order model moves them.
    known_features : tuple of str
        Features whose shift is known; what moves beside them depends on an angle that no log
        shows, so it only makes those features uncertain. Empty: all of them.
    either : bool
        Whether that is moved in full or not at all, as the unit is wired, which no log shows.
    ambiguous : tuple of (str, str)
        Faults that are no candidates themselves: in closed form they move the same features.
    switched : bool
        Whether it is there or not: it acts in full from one half on.
    whole : bool
        Whether it is that, or counted.
    amplified : tuple of str
        Plausibility features that grow by the severity as a share: a loop's gain amplifies noise,
        which no model run has.
    """

    kind: str
    place: str
    unit: str
    low: float
    high: float
    rate: float
    error: float
    same: tuple[str, ...] = ()
    fixed_features: tuple[str, ...] = ()
    known_features: tuple[str, ...] = ()
    either: bool = False
    ambiguous: tuple[tuple[str, str], ...] = ()
    switched: bool = False
    whole: bool = False
    amplified: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """``KIND@PLACE``."""
        return f"{self.kind}@{self.place}"

    @property
    def counted(self) -> bool:
        """Whether severities are whole numbers from one on."""
        return self.whole and not self.switched

    def range(self, count: int) -> Floats:
        """Return severities over the whole range, so many of them; of what is counted, each."""
        if self.counted:
            return np.arange(1.0, self.high + 1.0)
        return np.linspace(self.low, self.high, count)

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
_LOOP_NOISE = ("target_noise", "control_noise", "voltage_noise", "voltage_rest")
#: What a loop of a greater gain amplifies or moves, by its place.
_AMPLIFIED = {
    "control.position": ("reference_noise", *_LOOP_NOISE),
    "control.speed": ("integral_rate", *_LOOP_NOISE),
}  # fmt: skip
_RIPPLES = ("current_order_1", "current_order_2", "current_shaft", "current_sideband")
_VOLTAGES = ("voltage_per_speed", "voltage_order_1", "voltage_order_2", "voltage_sideband")

# How well the reduced-order model knows what a fault does, ASSUMED from benches with another
# friction law, elastic backlash and a PWM drive: positions and gains are geometry and arithmetic,
# ripples depend on what the current loop makes of them, friction on its law.
#
# A current sensor's gain leaves the motor as it is, so its EMF stays balanced; the reduced-order
# model puts the wrong current into the motor's constants and moves the voltage as a short would.
#
# A weak pole pair multiplies the coefficient of phase j by a window of
# theta_m - phi - 2 pi (j-1)/3, whose first harmonic is a dynamic eccentricity: the same sideband.
#
# A resolver off by an angle of d turns the drive's q axis by d: torque and EMF by its cosine, as
# lost flux would; the current beside it, on the other axis, is in no log.
#
# A speed loop near its limit chatters in the reduced-order model, which has no sampled controller:
# what that leaves at the orders of the current is no ripple of a drive.
#
# An encoder's gain is seen as the ratio of the two positions, and so is, with the other sign, a
# resolver's. Whether it reaches the position loop depends on where the drive closes it, which no
# healthy log tells.
CANDIDATES: tuple[CandidateFault, ...] = (
    CandidateFault("backlash", "transmission", "rad", 0.0, 0.03, _BEARING, 0.01),
    CandidateFault("friction", "transmission", "1", 0.0, 2.0, _BEARING / 3, 0.08,
                   amplified=("creeping_current",)),
    CandidateFault("lubrication", "transmission", "1", -0.7, 5.0, _BEARING / 3, 0.10),
    CandidateFault("short", _PHASES[0], "1", 0.0, 0.6, _MOTOR / 4, 0.10, _PHASES[1:]),
    CandidateFault("eccentricity_static", "motor", "1", 0.0, 0.6, _MOTOR / 4, 0.05),
    CandidateFault("eccentricity_dynamic", "motor", "1", 0.0, 0.6, _MOTOR / 4, 0.10,
                   known_features=("current_sideband", "voltage_sideband"),
                   ambiguous=(("local_demagnetisation", "motor"),)),
    CandidateFault("demagnetisation", "motor", "1", 0.0, 0.4, _MOTOR / 4, 0.05,
                   ambiguous=(("offset", "sensor.resolver"),)),
    CandidateFault("unbalance", "motor.rotor", "kg m2", 0.0, 4e-4, _BEARING / 10, 0.05),
    CandidateFault("gain_drift", "control.position", "1", -0.4, 0.6, _SENSOR / 2, 0.003,
                   amplified=_AMPLIFIED["control.position"]),
    CandidateFault("gain_drift", "control.speed", "1", -0.5, 1.0, _SENSOR / 2, 0.05,
                   fixed_features=_RIPPLES, amplified=_AMPLIFIED["control.speed"]),
    CandidateFault("gain", "sensor.encoder", "1", -0.04, 0.04, _SENSOR, 0.01,
                   known_features=("position_scale",), either=True,
                   ambiguous=(("gain", "sensor.resolver"),)),
    CandidateFault("gain", _CURRENTS[0], "1", -0.3, 0.3, _SENSOR / 3, 0.10, _CURRENTS[1:],
                   _VOLTAGES),
    CandidateFault("tooth_wear", "gear", "rad", 0.0, 0.006, _BEARING / 10, 0.50),
    CandidateFault("sag", "supply", "1", 0.0, 0.4, _CONNECTOR, 0.10),
    CandidateFault("bearing", _RINGS[0], "m", 0.0, 0.005, _BEARING / 3, 0.30, _RINGS[1:]),
)  # fmt: skip


#: Of an actuator that has no table of its own. Largest severity considered where the catalogue's
#: own is larger or none, by unit: what a unit of this size runs with at all; shares and counts are
#: given by the catalogue. Rates and errors are alike for all. ASSUMED.
_MOST = {"m": 0.002, "rad": 0.3, "N": 5000.0, "kg m2": 4e-4, "A": 2.0, "N m": 1.0}
_COUNTED = 8.0  # of what is counted
_SHARE = 2.0  # of a share that the catalogue lets grow without bound
_RATE, _ERROR = 1e-5, 0.1  # per hour; of a shift


def candidates_of(actuator: Actuator) -> tuple[CandidateFault, ...]:
    """Return the faults that an actuator may have, one for places that differ by a phase only.

    A turning servo's are `CANDIDATES`; of any other all of its catalogue that the reduced-order
    model has.
    """
    if turns(actuator):
        return CANDIDATES
    # Ranges end where the unit's own numbers make a whole severity impossible.
    most = {(r.kind, place): r.maximum for r in own_faults(actuator) for place in r.places}
    records = [record for record in catalogue(actuator.wiring) if "low" in record.fidelities]
    return tuple(
        _candidate(replace(r, maximum=most.get((r.kind, group[0]), r.maximum)), group)
        for r in records
        for group in _groups(r.places)
    )


def not_candidates(actuator: Actuator) -> tuple[dict[str, str], ...]:
    """Return kind, place and reason of each fault of the catalogue that is no candidate."""
    if turns(actuator):
        return not_modelled()
    return tuple(
        {"kind": record.kind, "place": place, "reason": f"reduced-order model: {reason}"}
        for record in catalogue(actuator.wiring)
        if "low" not in record.fidelities
        for place in record.places
        for reason in [record.not_modelled.get("low", "does not have it")]
    )


def _groups(places: Sequence[str]) -> list[tuple[str, ...]]:
    """Places that differ in the letter of a phase stand together."""
    groups: dict[str, list[str]] = {}
    for place in places:
        stem = place[:-1] if place.endswith(("_a", "_b", "_c")) else place
        groups.setdefault(stem, []).append(place)
    return [tuple(group) for group in groups.values()]


def _candidate(record: FaultRecord, places: tuple[str, ...]) -> CandidateFault:
    unit = record.unit or "1"
    most = _MOST.get(unit, _SHARE)
    top = record.maximum if math.isfinite(record.maximum) else most
    high = 0.95 * top if unit == "1" and top <= 1.0 else min(top, most)
    low = max(record.minimum, -0.5 if unit == "1" else -most) if record.minimum < 0.0 else 0.0
    if record.whole:
        high = min(record.maximum, _COUNTED)
    return CandidateFault(
        record.kind, places[0], unit, low, 1.0 if record.switched else high, _RATE, _ERROR,
        places[1:], switched=record.switched, whole=record.whole or record.switched,
        amplified=_AMPLIFIED.get(places[0], ()) if record.kind == "gain_drift" else (),
    )  # fmt: skip


def chosen(
    texts: Sequence[str] | None, actuator: Actuator | None = None
) -> tuple[CandidateFault, ...]:
    """Return the candidates, or those named as ``KIND@PLACE`` (or any place of `same`).

    Parameters
    ----------
    texts : sequence of str, optional
        Those wanted; default: all.
    actuator : Actuator, optional
        Whose; default: a turning servo's.

    Raises
    ------
    UnknownNameError
        None of that name is a candidate.
    InputError
        One is named twice, or is not modelled, with the reason.
    """
    known = CANDIDATES if actuator is None else candidates_of(actuator)
    if not texts:
        return known
    out: list[CandidateFault] = []
    names = {f"{c.kind}@{p}": c for c in known for p in (c.place, *c.same)}
    left = not_modelled() if actuator is None else not_candidates(actuator)
    reasons = {f"{item['kind']}@{item['place']}": item["reason"] for item in left}
    for key in (text.strip() for text in texts):
        if key in reasons:
            raise InputError(f"--fault {key}: not modelled: {reasons[key]}")
        if key not in names:
            raise unknown("fault", key, names, "--fault")
        if names[key] in out:
            raise InputError(f"--fault {key}: {names[key].key} is already among the candidates")
        out.append(names[key])
    return tuple(out)


def of_a_magnet(actuator: Actuator) -> Actuator:
    """Return the actuator as diagnosis runs it: an eccentric rotor has a periodic flux.

    The published law has an EMF with a mean over a turn, which no magnet has. An actuator that
    states its law keeps it.
    """
    if actuator.parameters[_LAW].confidence != "default":
        return actuator
    return actuator.with_values({_LAW: "periodic"}, source="law of diagnosis", request=False)


_SWITCHES = tuple(f"inverter.{phase}_{side}" for phase in "abc" for side in ("high", "low"))

_FORM = "not in the reduced-order model; "
_LOOP = (
    f"{_FORM}a drive's log shows it by the current that the motor does not take, once or twice an "
    "electrical turn: named with the other phases; a small one brakes like viscous friction and "
    "unbalances the phases, so it is named lubrication@transmission with short@motor.phase_a (or "
    "gain@sensor.current_a), or not explained"
)
_RESISTOR = (
    "the reduced-order model has no loop of its own for it: its current brakes like viscous "
    "friction and unbalances the phases, so it is named lubrication@transmission with "
    "short@motor.phase_a (or gain@sensor.current_a), or not explained"
)
_OPEN = (
    f"{_FORM}where all current is asked for and none flows it is named with the other phases, or "
    "with connector_open@supply, open_phase@motor.phase_a and open_switch@inverter.a_high where no "
    "field current was logged; else refused, not explained, or a short@motor.phase_a is named"
)
_DRY = "on the whole it adds dry friction and is named friction@transmission"
_ANGLE = (
    f"{_FORM}an error once or twice a turn of the shaft stands in the difference of the two "
    "positions: named as channel_offset@sensor.resolver.sine or "
    "resolver_short@sensor.resolver.sine with those that look alike; a constant one gives less "
    "torque for the current (named demagnetisation@motor where it is much), else nothing visible"
)
_COUNTS = (
    f"{_FORM}an output position that is too short in whole counts: named "
    "missing_counts@sensor.encoder or, where it goes in steps, dark_sectors@sensor.encoder; "
    "refused as another gear ratio where many are lost, not seen below 0.2 %"
)
_GONE = (
    f"{_FORM}where the drive asks for all current and the shaft seems to stand, it is named "
    "resolver_open@sensor.resolver.sine with those that look alike, or jam@transmission where the "
    "output stands, too; else such a log is refused"
)

#: Kind and places to the reason; what it may be named stands in it as ``KIND@PLACE``.
_NOT_MODELLED: tuple[tuple[str, tuple[str, ...], str], ...] = (
    ("open_phase", _PHASES, _OPEN),
    ("open_switch", _SWITCHES, _OPEN),
    ("shorted_switch", _SWITCHES, "the drive trips: nothing flows, as with connector_open@supply"),
    ("connector_open", ("supply",), _OPEN),
    ("resistor_short", _PHASES, _RESISTOR),
    ("phase_short", tuple(f"motor.phases_{phase}" for phase in ("ab", "bc", "ca")), _LOOP),
    ("ground_short", _PHASES, _LOOP),
    ("offset", _CURRENTS, "it moves the current once a turn of the electrical angle, by as much "
     "in any motion, which the reduced-order model has not: not explained where it is much"),
    ("stuck", _CURRENTS, "the reduced-order model has no single sensor: not explained, or named "
     "gain@sensor.current_a"),
    ("dead", _CURRENTS, "a gain of nothing: beyond the range tried of gain@sensor.current_a, which "
     "is named, or not explained"),
    ("bearing", ("bearing.cage",), f"{_FORM}friction once a turn of the cage is named; where "
     f"it is small, {_DRY}"),
    ("stator_rub", ("motor",), f"{_DRY}; how that changes once a turn of the shaft is not looked "
     "for"),
    ("jam", ("transmission",), f"{_DRY}, or not explained where a motor hardly moves; where "
     "all current flows and nothing moves it is named with resolver_open@sensor.resolver.sine"),
    ("chipped_tooth", ("gear",), "a step once a turn of a wheel, which no feature follows: "
     "not seen, or named tooth_wear@gear or backlash@transmission"),
    ("offset", ("sensor.encoder",), "no test looks at absolute positions"),
    ("mismatch", ("sensor.resolver",), _ANGLE),
    ("quadrature", ("sensor.resolver",), _ANGLE),
    ("channel_offset", ("sensor.resolver.sine", "sensor.resolver.cosine"), _ANGLE),
    ("interpolation", ("sensor.encoder.first", "sensor.encoder.second"), "within one period of the "
     "encoder's pulses, below what the position's features resolve: not seen"),
    ("resolver_short", ("sensor.resolver.sine", "sensor.resolver.cosine",
                       "sensor.resolver.excitation"), _ANGLE),
    ("resolver_open", ("sensor.resolver.sine", "sensor.resolver.cosine",
                      "sensor.resolver.excitation"), _GONE),
    ("dropout", ("sensor.resolver",), "the motor's position and speed disagree: reading the log "
     "refuses it, or no feature follows"),
    ("stuck", ("sensor.resolver", "sensor.encoder"), _GONE),
    ("dead", ("sensor.encoder",), _GONE),
    ("missing_counts", ("sensor.encoder",), _COUNTS),
    ("dark_sectors", ("sensor.encoder",), _COUNTS),
)  # fmt: skip


def not_modelled() -> tuple[dict[str, str], ...]:
    """Return kind, place and reason of each fault that is no candidate."""
    return tuple(
        {"kind": kind, "place": place, "reason": reason}
        for kind, places, reason in _NOT_MODELLED
        for place in places
    )
