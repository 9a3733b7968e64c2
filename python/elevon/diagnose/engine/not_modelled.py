"""Faults of the rotary catalogue that are no candidates, and what becomes of a log that has one."""

from __future__ import annotations

_PHASES = tuple(f"motor.phase_{p}" for p in "abc")
_CURRENTS = tuple(f"sensor.current_{p}" for p in "abc")
_SWITCHES = tuple(f"inverter.{p}_{side}" for p in "abc" for side in ("high", "low"))

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
    ("phase_short", tuple(f"motor.phases_{p}" for p in ("ab", "bc", "ca")), _LOOP),
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
