"""What is kept of a run: texts such as ``"output_position,motor_speed@400 Hz"`` become clocks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from elevon.errors import InputError, unknown
from elevon.units import parse_quantity

#: Solver steps are counted in whole numbers that a double holds exactly.
MOST_STEPS = 9.0e15

#: Named groups of signals; a model without one of them leaves it out of the group.
_GROUPS = {
    "drive_log": (
        "encoder_position motor_position speed_ref motor_speed current_ref current_q_meas "
        "current_d_meas voltage_q_ref voltage_q_meas"
    ),
    "essential": ("command output_position motor_torque friction_torque current_q current_d"),
    "gear": (
        "command state fault_code warning_code command_refused locked brake_released "
        "released output_position output_speed motor_position motor_speed speed_ref "
        "voltage_ref current_mean current_peak supply_voltage"
    ),
    "currents": "current_a current_b current_c",
    "voltages": "voltage_a voltage_b voltage_c",
}
GROUPS = {name: tuple(signals.split()) for name, signals in _GROUPS.items()}

#: What is kept when nothing is given: the rate of the Torino drive's log (T1).
DEFAULT_RECORD = "drive_log,essential@400 Hz"

#: The same for an actuator with a control unit: what a test engineer reads.
DEFAULT_GEAR_RECORD = "gear@500 Hz"

_EVERY = "every"
_ALL = "all"


@dataclass(frozen=True)
class ClockPlan:
    """Signals kept on one clock.

    Attributes
    ----------
    name : str
        The clock's name in the recording: ``at_400_hz``, ``every_step``.
    period_steps : int
        Solver steps between two samples.
    signals : tuple of str
        Names.
    rate : float
        Hz.
    """

    name: str
    period_steps: int
    signals: tuple[str, ...]
    rate: float

    def to_core(self) -> dict[str, object]:
        """Return the form that crosses the seam."""
        return {
            "clock": self.name,
            "period_steps": self.period_steps,
            "signals": list(self.signals),
        }

    def samples(self, duration: float, step: float) -> int:
        """Return how many instants a run of some duration (s) keeps, the first one included."""
        return round(duration / step) // self.period_steps + 1


def record_plan(
    record: str | Sequence[str] | None,
    units: Mapping[str, str],
    step: float,
) -> list[ClockPlan]:
    """Resolve what to record.

    Parameters
    ----------
    record : str, sequence of str or None
        Texts ``SIGNALS@RATE``: names or groups (``drive_log``, ``essential``, ``currents``,
        ``voltages``, ``gear``, ``all``) separated by commas, and a rate with unit, or ``every`` for
        every solver step. Without ``@RATE`` the rate of None: drive log and essentials at 400 Hz;
        of an actuator with a control unit the group ``gear`` at 500 Hz.
    units : mapping
        The model's signals.
    step : float
        Solver step in s.

    Returns
    -------
    list of ClockPlan
        One a rate.

    Raises
    ------
    UnknownNameError
        A signal the model does not have.
    InputError
        The rate is no whole number of steps (the nearest possible rates are named), or a signal
        is given at two rates.
    """
    usual = DEFAULT_GEAR_RECORD if "fault_code" in units else DEFAULT_RECORD
    if record is None:
        record = usual
    texts = [record] if isinstance(record, str) else record
    if not texts:
        raise InputError("record: nothing is recorded; leave it out for the default")
    chosen: dict[int, list[str]] = {}
    owner: dict[str, str] = {}
    for text in texts:
        full = text if "@" in text else f"{text}@{usual.partition('@')[2]}"
        names, period = _read(full, units, step)
        for name in names:
            if owner.setdefault(name, text) != text:
                raise InputError(f"record: {name!r} is requested twice: {owner[name]!r}, {text!r}")
        chosen_names = chosen.setdefault(period, [])
        chosen_names.extend(name for name in names if name not in chosen_names)
    return [
        ClockPlan(clock_name(period, step), period, tuple(names), 1.0 / (period * step))
        for period, names in chosen.items()
    ]


def clock_name(period_steps: int, step: float) -> str:
    """Return the name of a clock: an identifier with its rate."""
    if period_steps == 1:
        return "every_step"
    rate = f"{1.0 / (period_steps * step):.6g}".replace(".", "p").replace("+", "")
    return f"at_{rate.replace('-', 'm')}_hz"


def _read(text: str, units: Mapping[str, str], step: float) -> tuple[list[str], int]:
    names, _, rate = text.partition("@")
    if not rate.strip() or not (names.strip() or rate.strip() == _EVERY):
        raise InputError(
            f"record: {text!r} is not of the form SIGNALS@RATE, such as "
            "'output_position,motor_speed@400 Hz' or 'current_a@every'"
        )
    wanted = names if names.strip() else _ALL
    chosen: list[str] = []
    for name in (part.strip() for part in wanted.split(",")):
        chosen.extend(item for item in _expand(name, units) if item not in chosen)
    return chosen, period_of(rate.strip(), step)


def _expand(name: str, units: Mapping[str, str]) -> list[str]:
    if name == _ALL:
        return list(units)
    if name in units:
        return [name]
    if name in GROUPS:
        return [item for item in GROUPS[name] if item in units]
    raise unknown("signal", name, [*units, *GROUPS, _ALL], "record")


def period_of(rate: str, step: float, place: str = "record") -> int:
    """Return the solver steps (of `step` s) between two samples of a rate such as ``400 Hz``.

    Raises
    ------
    InputError
        The rate is no whole number of steps; the nearest possible rates are named.
    """
    if rate == _EVERY:
        return 1
    hertz = parse_quantity(rate, "Hz", place)
    if hertz <= 0.0:
        raise InputError(f"{place}: the rate {rate} must be positive")
    slowest = 1.0 / (MOST_STEPS * step)
    if hertz < slowest:
        raise InputError(f"{place}: the rate {rate} is too low; at least {slowest:.3g} Hz")
    exact = 1.0 / (hertz * step)
    period = max(round(exact), 1)
    if abs(exact - period) <= 1e-9 * exact:
        return period
    low, high = max(math.floor(exact), 1), max(math.ceil(exact), 1)
    near = " or ".join(f"{1.0 / (n * step):.9g} Hz" for n in dict.fromkeys((high, low)))
    raise InputError(
        f"{place}: {rate} is no whole number of solver steps of {step:g} s "
        f"({exact:.6g} of them); nearest: {near}"
    )
