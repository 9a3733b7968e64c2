"""An actuator that is moved by hand: its session, and what may be done to it while it runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from elevon.bench.rig import moved
from elevon.documents import Document, validated
from elevon.errors import ArgumentTypeError, DivergedError, InputError, RangeError, unknown
from elevon.faults import Fault, check_together
from elevon.parameters.records import wirings
from elevon.scenario import Command, Terms
from elevon.scenario.compile import evaluate_terms, port_units, signal_records
from elevon.session import Session
from elevon.units import display_unit, format_quantity, parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.scenario import Terms


_COLDEST, _HOTTEST = 213.15, 393.15  # K: -60 to 120 degC, beyond what flies. ASSUMED
_SUPPLY = 1.5  # times the nominal voltage. ASSUMED: beyond it no drive of these lives
_RAM = 25e3  # N on a landing gear's ram. ASSUMED: as the hydraulic rig's limit
_AHEAD, _GRID = 120.0, 24_001  # s of a waveform that are looked at, and at how many instants


@dataclass(frozen=True)
class InputRange:
    """The range within which an input may be set, SI."""

    low: float
    high: float
    unit: str


def input_ranges(actuator: Actuator, mode: str) -> dict[str, InputRange]:
    """Return the range of each input; that of the command goes with its mode."""
    units = port_units(mode, actuator.wiring)
    torque = _value(actuator, "motor.torque_limit", math.inf)
    output = torque * _ratio(actuator) if units.get("output") != "N" else _force(actuator, torque)
    supply = _value(actuator, "inverter.supply_voltage", math.inf)
    spans = {
        "command": _command(actuator, mode),
        "output": (-output, output),
        "brake": (0.0, output if units.get("brake") == "N" else torque),
        "shaft": (-torque, torque),
        "supply": (0.0, _SUPPLY * supply),
        "ambient": (_COLDEST, _HOTTEST),
        "weight_on_wheels": (0.0, 1.0),
    }
    return {port: InputRange(*spans[port], units[port]) for port in units if port in spans}


def check_value(name: str, value: float, span: InputRange) -> None:
    """Raise `RangeError` for a value outside its range."""
    if not span.low <= value <= span.high:
        low, high = format_quantity(span.low, span.unit), format_quantity(span.high, span.unit)
        raise RangeError(
            f"{name} = {format_quantity(value, span.unit)}: the bench takes {low} to {high}"
        )


def check_waveform(name: str, terms: Terms, span: InputRange) -> None:
    """Raise `RangeError` for a sum of waveforms that leaves its range within two minutes."""
    time = np.linspace(0.0, _AHEAD, _GRID)
    values = evaluate_terms(terms.terms, span.unit, time, name)
    for value in (float(values.min()), float(values.max())):
        check_value(name, value, span)


def _command(actuator: Actuator, mode: str) -> tuple[float, float]:
    if mode == "gear":
        return 0.0, 8.0
    if mode == "speed":
        most = _value(actuator, "control.speed_limit", math.inf)
        return -most, most
    if mode == "torque":
        most = _value(actuator, "motor.torque_limit", math.inf)
        return -most, most
    return _value(actuator, "stop.lower", -math.inf), _value(actuator, "stop.upper", math.inf)


def _force(actuator: Actuator, torque: float) -> float:
    """Return the force of a screw at the motor's largest torque."""
    if "control.position_gain" not in actuator.parameters:
        return _RAM
    lead = _value(actuator, "screw.lead", math.inf)
    return torque * _ratio(actuator) / lead if math.isfinite(lead) else _RAM


def _ratio(actuator: Actuator) -> float:
    return _value(actuator, "gear.ratio", 1.0)


def _value(actuator: Actuator, path: str, other: float) -> float:
    known: Mapping[str, object] = actuator.parameters
    return float(actuator.parameters.value(path)) if path in known else other


PERIOD = 0.0025  # s between two samples: the rate of a drive's trace
_FILTERED = ("current_q_meas", "current_d_meas", "voltage_q_meas")


class Source(Protocol):
    """What the bench shows: a running actuator or a replayed log."""

    names: tuple[str, ...]
    period: float

    @property
    def time(self) -> float:
        """Present simulated time [s]."""
        ...

    @property
    def status(self) -> tuple[str, str]:
        """``ok``, ``tripped``, ``diverged`` or ``ended``, and why."""
        ...

    def step(self) -> Sequence[float]:
        """Advance by one period; return the value of each signal."""
        ...


def sample_period(step: float) -> float:
    """Return the whole number of solver steps [s] that is nearest to the drive's rate."""
    return max(1, round(PERIOD / step)) * step


class LiveUnit:
    """An actuator in a session; actions on it act at the present instant.

    Parameters
    ----------
    actuator : Actuator
        As it is when it is healthy.
    fidelity : str
        ``high`` or ``low``.
    mode : str, optional
        What the command demands; default: the first that the wiring takes.
    seed : int
        Of the random numbers.
    """

    def __init__(
        self,
        actuator: Actuator,
        *,
        fidelity: str = "high",
        mode: str | None = None,
        seed: int = 0,
    ) -> None:
        self.actuator, self.fidelity, self.seed = actuator, fidelity, seed
        self.mode: str = mode or wirings()[actuator.wiring]["modes"][0]
        self.faults: dict[str, Fault] = {}
        self._begun = 0.0  # the session's start on the bench's clock
        self._actions: list[tuple[float, float]] = []
        self._last_action = 0.0
        self.given: Mapping[str, Any] | None = None
        self.given_at = 0.0
        self.inputs: dict[str, Any] = {}
        self.changed_at = 0.0
        self._session = self._begin(actuator, {})
        self._look()
        self.names = tuple(name for name in self._session.names if self._carried(name))
        self.period = sample_period(self._session.step)

    @property
    def time(self) -> float:
        """Present simulated time [s]."""
        return self._time

    @property
    def status(self) -> tuple[str, str]:
        """``ok``, ``tripped`` or ``diverged``, and why."""
        return self._status

    @property
    def units(self) -> dict[str, str]:
        """The SI unit of each signal."""
        known = signal_records(self.actuator.wiring, self.fidelity)
        units = {name: str(known[name]["unit"] or "1") for name in self.names}
        units["command"] = port_units(self.mode, self.actuator.wiring)["command"]
        return units

    @property
    def ranges(self) -> dict[str, InputRange]:
        """The range within which each input may be set."""
        return input_ranges(self.actuator, self.mode)

    @property
    def now(self) -> Actuator:
        """The actuator with the parameters that were set."""
        return self._session.actuators[0]

    def step(self) -> Sequence[float]:
        """Advance by one sample; return the value of each signal.

        One that has diverged or tripped stands; its time goes on no more.
        """
        self._due()
        if self.status[0] == "ok":
            with suppress(DivergedError):  # its status tells
                self._session.advance(self.period)
            self._look()
        return self.values()

    def values(self) -> list[float]:
        """Return the present values of the signals."""
        return list(self._session.read(*self.names).values())

    def command(self, given: Mapping[str, object]) -> None:
        """Set the command, as in a scenario file, in time from now on.

        Raises
        ------
        InputError
            What a scenario refuses; a value that the bench does not take.
        """
        read = self.check_command(given)
        if read.mode != self.mode:
            self._change_mode(read.mode)
        if read.mode == "gear":
            self._sequence(read)
        else:
            self._set_terms("command", read)
        self.given = {"mode": read.mode, **given}
        self.given_at = self.time

    def check_command(self, given: Mapping[str, object]) -> Command:
        """Return a command that the bench takes; raises as `command`, and changes nothing."""
        read = validated(Command, {"mode": self.mode, **given}, Document("command", "", {}))
        modes = wirings()[self.actuator.wiring]["modes"]
        if read.mode not in modes:
            raise unknown("mode", read.mode, modes, "command")
        if read.mode == "gear":
            self._numbers(read)
        else:
            check_waveform("command", read, input_ranges(self.actuator, read.mode)["command"])
        return read

    def hold(self) -> None:
        """Hold the command at the present output: no motion and no torque is requested."""
        if self.mode == "gear":
            self._act("stop")
        else:
            position = self._session.read("output_position")["output_position"]
            self._session.set(command=position if self.mode == "position" else 0.0)
        self.given, self.given_at = None, self.time

    def ramp_home(self, seconds: float) -> None:
        """Bring the output to zero in a time [s]."""
        start = self._session.read("output_position")["output_position"]
        ramp = {"kind": "ramp", "initial": start, "slope": -start / seconds, "end": seconds}
        self.command({"mode": self.mode, "terms": [ramp]})

    def set(self, name: str, value: object) -> None:
        """Set an input (a number, a text with a unit, a waveform) or a parameter by its path.

        Raises
        ------
        InputError
            No such input or parameter, a value that the bench or the model does not take.
        """
        ranges = self.ranges
        if name == "command":
            self.command({"terms": [{"kind": "constant", "value": value}]})
        elif name in ranges:
            self._input(name, value, ranges[name])
            self.inputs[name], self.changed_at = value, self.time
        elif "." in name:
            if isinstance(value, bool) or not isinstance(value, (int, float, str)):
                raise ArgumentTypeError(f"{name}: {value!r:.60} is no value")
            self._session.announce(tunable=[name])
            self._session.set_parameter(name, value)
            self.inputs[name], self.changed_at = value, self.time
        else:
            raise unknown("input", name, [*ranges, *self.actuator.parameters], "set")

    def inject(self, name: str, given: object) -> None:
        """Set the severity of a fault, ``KIND@PLACE``; zero clears it.

        Parameters
        ----------
        name : str
            As in the catalogue.
        given : float, str, mapping or None
            Severity in the catalogue's unit, or with one; a mapping holds ``severity`` and the
            fault's attributes.

        Raises
        ------
        InputError
            No such fault, a severity out of range.
        """
        kind, _, place = name.partition("@")
        data = dict(given) if isinstance(given, Mapping) else {"severity": given or 0.0}
        severity = data.get("severity", 0.0)
        if isinstance(severity, bool) or not isinstance(severity, (int, float, str)):
            raise ArgumentTypeError(f"{name}: {severity!r:.60} is no severity")
        fault = Fault.from_dict({"kind": kind, "place": place, **data}, name)
        resolved = fault.resolved(self.actuator.wiring, self.fidelity, name)
        others = [other for key, other in self.faults.items() if key != name]
        if resolved["severity"] != 0.0:
            check_together([*others, fault])
        self._session.announce(faults=[name])
        self._session.set_fault(name, severity, **dict(fault.attributes))
        self.faults.pop(name, None)
        if resolved["severity"] != 0.0:
            self.faults[name] = fault

    def restart(self) -> None:
        """Restart from rest with the present faults and parameters; time continues."""
        self._anew(self.now, {})

    def renew(self, mode: str) -> None:
        """Restart from rest as at the first start: healthy, nothing set; time continues."""
        if mode not in wirings()[self.actuator.wiring]["modes"]:
            raise unknown("mode", mode, wirings()[self.actuator.wiring]["modes"], "repeat")
        self.mode, self.given = mode, None
        self.faults.clear()
        self.inputs.clear()
        self._anew(self.actuator, {})

    def _begin(self, actuator: Actuator, initial: Mapping[str, float]) -> Session:
        scenario = {"duration": 1.0, "command": {"mode": self.mode}, "initial": dict(initial)}
        known = signal_records(actuator.wiring, self.fidelity)
        session = Session(
            actuator,
            scenario,
            fidelity=self.fidelity,
            seed=self.seed,
            faults=list(self.faults),
            signals=[name for name in _FILTERED if name in known],
        )
        for name, fault in self.faults.items():
            session.set_fault(name, fault.severity, **dict(fault.attributes))
        if self.mode == "position" and initial.get("output_position"):
            session.set(command=initial["output_position"])
        ports = port_units(self.mode, actuator.wiring)
        for name, value in self.inputs.items():
            if name in ports:
                session.set(**{name: value})
        return session

    def _change_mode(self, mode: str) -> None:
        from elevon import _core

        self.mode = mode

        names = [n for n in _core.initial(self.actuator.wiring, self.fidelity) if n in self.names]
        self._anew(self.now, self._session.read(*names))

    def _anew(self, actuator: Actuator, initial: Mapping[str, float]) -> None:
        begun = self.time
        self._session = self._begin(actuator, initial)
        self._begun, self._actions, self._last_action = begun, [], 0.0
        self._look()

    def _look(self) -> None:
        """Note what other threads read: a session bears one at a time."""
        self._time = self._begun + self._session.time
        self._status = self._session.state_of(0)

    def _carried(self, name: str) -> bool:
        try:
            self._session.read(name)
        except InputError:
            return False
        return True

    def _input(self, name: str, value: Any, span: InputRange) -> None:
        if isinstance(value, Mapping):
            given = value if "terms" in value else {"terms": [value]}
            read = validated(Terms, given, Document(name, "", {}))
            check_waveform(name, read, span)
            self._set_terms(name, read)
            return
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise ArgumentTypeError(f"{name}: {value!r:.60} is no value")
        number = parse_quantity(value, span.unit, name, display_unit(span.unit))
        check_value(name, number, span)
        self._session.set(**{name: number})

    def _set_terms(self, port: str, sum_: Terms) -> None:
        """Let a sum of waveforms act, in time from now on."""
        plain = [term.model_dump(exclude_unset=True, mode="json") for term in sum_.terms]
        terms = [moved(term, self._session.time) for term in plain]
        self._session.set(**{port: {"terms": terms}})

    def _sequence(self, command: Command) -> None:
        now = self._session.time
        self._actions = [(now + later, number) for later, number in self._numbers(command)]
        self._due()

    def _numbers(self, command: Command) -> list[tuple[float, float]]:
        """Return the actions of a sequence: seconds from now, and the number of each."""
        actions: list[str] = wirings()[self.actuator.wiring]["actions"]
        out: list[tuple[float, float]] = []
        for step in command.steps:
            if step.action not in actions:
                raise unknown("action", step.action, actions, "command.steps")
            seconds = parse_quantity(step.time, "s", "command.steps: time")
            if seconds < (out[-1][0] if out else 0.0):
                raise InputError(f"command.steps: time = {step.time}: times must rise from 0 s")
            out.append((seconds, float(actions.index(step.action))))
        return out

    def _due(self) -> None:
        while self._actions and self._actions[0][0] <= self._session.time + 1e-9:
            self._numbered(self._actions.pop(0)[1])

    def _act(self, action: str) -> None:
        self._actions = []
        self._numbered(float(wirings()[self.actuator.wiring]["actions"].index(action)))

    def _numbered(self, number: float) -> None:
        """Give an action; the same one again is a round higher, else it would not be seen."""
        rounds = len(wirings()[self.actuator.wiring]["actions"])
        self._last_action = number + rounds if self._last_action == number else number
        self._session.set(command=self._last_action)
