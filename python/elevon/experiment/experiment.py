"""A log's test on a model, with values and faults that differ from run to run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.errors import InputError, Interrupted
from elevon.faults import Fault
from elevon.logs.log import Log, on_clock
from elevon.parameters.records import positions
from elevon.scenario import Scenario
from elevon.scenario.compile import signal_records
from elevon.simulate.acting import report
from elevon.simulate.batch import BUDGET, check_budget, simulate_prepared
from elevon.simulate.prepare import Prepared, Run, prepare

#: Instants from the run's beginning [s] and values there; straight lines between.
Table = tuple[Floats, Floats]

_EMPTY: Mapping[str, Any] = {"kind": "table", "times": [0.0, 1.0], "values": [0.0, 0.0]}


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of a run, SI.

    Attributes
    ----------
    duration : float
        s.
    mode : str
        What is commanded: ``position``, ``speed``, ``gear``, ...
    command : (ndarray, ndarray) or None
        In the unit of the mode.
    actions : tuple of (float, str)
        Instants and actions, where those are commanded.
    loads : mapping of str to (ndarray, ndarray)
        Port (``brake``, ``output``, ``rig_speed``, ...) to what acts there.
    initial : mapping of str to float or str
        Signal to where it starts.
    """

    duration: float
    mode: str
    command: Table | None = None
    actions: tuple[tuple[float, str], ...] = ()
    loads: Mapping[str, Table] = field(default_factory=dict)
    initial: Mapping[str, float | str] = field(default_factory=dict)

    def scenario(self) -> Scenario:
        """Return the test with empty tables: their arrays are put in when all else is checked."""
        command: dict[str, Any] = {"mode": self.mode}
        if self.command is not None:
            command["terms"] = [_EMPTY]
        if self.actions:
            command["steps"] = [{"time": time, "action": name} for time, name in self.actions]
        document = {
            "duration": self.duration,
            "command": command,
            "load": {port: {"terms": [_EMPTY]} for port in self.loads},
            "initial": dict(self.initial),
        }
        return Scenario.from_dict(document)

    def tables(self, name: str) -> dict[str, Table]:
        """Return the arrays by port.

        Raises
        ------
        InputError
            Instants that do not increase, or what is no finite number; `name` is the log's.
        """
        tables = dict(self.loads)
        if self.command is not None:
            tables["command"] = self.command
        return {port: checked(table, f"{name}: {port}") for port, table in tables.items()}


def checked(table: Table, place: str) -> Table:
    """Return a table as the core takes it; errors as `Inputs.tables`."""
    times, values = (np.ascontiguousarray(x, dtype=np.float64) for x in table)
    if len(times) != len(values) or not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise InputError(f"{place}: a sample is missing or no finite number")
    if not np.all(np.diff(times) > 0.0):
        raise InputError(f"{place}: time does not increase")
    return times, values


@dataclass(frozen=True)
class Sensor:
    """How a log shows a channel: behind a filter, late, offset.

    Attributes
    ----------
    delay : float
        s.
    offset : float
        In the channel's unit.
    lag : float
        Time constant of a first-order filter, s.
    unsigned : bool
        Whether its sign is lost.
    scale : float
        Of the channel over the model's signal.
    """

    delay: float = 0.0
    offset: float = 0.0
    lag: float = 0.0
    unsigned: bool = False
    scale: float = 1.0


_PLAIN = Sensor()


@dataclass(frozen=True, eq=False)
class ModelRun:
    """One run.

    Attributes
    ----------
    status : str
        ``ok``, ``tripped`` or ``diverged``.
    seconds : float
        Simulated.
    message : str
        Why it ended, where it did before its end.
    log : Log
        On the run's own clock, which begins at zero.
    """

    status: str
    seconds: float
    message: str
    log: Log

    @property
    def complete(self) -> bool:
        """Whether it stayed within the finite numbers."""
        return self.status in {"ok", "tripped"} and all(
            np.isfinite(values).all() for values in self.log.channels.values()
        )

    def seen(self, log: Log, sensors: Mapping[str, Sensor] | None = None) -> Log:
        """Return the run as a log's sensors would have shown it, on the log's instants."""
        sensors = {} if sensors is None else sensors
        channels = {
            role: self._seen(role, log.time, sensors.get(role, _PLAIN)) for role in self.log
        }
        return replace(log, channels=channels, units=self.log.units, gain=None, recording=None)

    def _seen(self, role: str, time: Floats, sensor: Sensor) -> Floats:
        clock, values = self.log.time, self.log[role]
        if sensor.unsigned:
            values = np.abs(values)
        if sensor.lag > 0.0:
            values = _late(values, sensor.lag / self.log.period)
        at = time - sensor.delay
        seen = on_clock(clock, values, at, self.log.units.get(role, ""))
        return sensor.scale * seen + sensor.offset


def _late(values: Floats, lag: float) -> Floats:
    """Return samples behind a first-order filter, `lag` in sample times, from rest."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1.0 / lag))
    start = np.array([keep * values[0]])
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=start)[0])


_CHUNK = 64  # runs held at once

Progress = Callable[[float], Any]


@dataclass(frozen=True)
class Variant:
    """How one run differs from the experiment.

    Attributes
    ----------
    values : mapping of str to float
        Parameters by path, SI.
    faults : tuple of str
        As in ``--fault``.
    loads : mapping of str to (ndarray, ndarray)
        Loads by port, in place of the log's.
    initial : mapping of str to float
        Signals that start elsewhere, SI.
    later : float
        s by which all inputs come later.
    number : int
        Of its random numbers.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = ()
    loads: Mapping[str, Table] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)
    later: float = 0.0
    number: int = 0


class Experiment:
    """The test of a log, ready to be run on an actuator's model.

    Names, units and ranges are checked once; the variants exchange numbers only.

    Parameters
    ----------
    log : Log
        Whose test it is.
    actuator : Actuator
        The model.
    inputs : Inputs or Scenario
        What drove the log; a scenario where the test is known to the last bit.
    shows : mapping of str to str
        Role to the model's signal; default: what the model has of the log's roles.
    rate : str
        Of what is recorded: ``400 Hz``, or ``every`` step.
    period : float, optional
        Seconds between two recorded samples at most, instead of a rate.
    fidelity : str
        ``low`` or ``high``.
    notices : bool
        Whether what has no effect in the run is reported.

    Raises
    ------
    InputError
        Values, inputs or signals that the model cannot take.
    """

    def __init__(
        self,
        log: Log,
        actuator: Actuator,
        inputs: Inputs | Scenario,
        shows: Mapping[str, str] | None = None,
        *,
        rate: str = "every",
        period: float | None = None,
        fidelity: str = "low",
        notices: bool = False,
    ) -> None:
        self.log, self.actuator, self.fidelity = log, actuator, fidelity
        served = signals_by_role(actuator.wiring, fidelity) if shows is None else shows
        self.shows = {r: s for r, s in served.items() if shows is not None or r in log.channels}
        record = f"{','.join(dict.fromkeys(self.shows.values()))}@{rate}"
        known = inputs if isinstance(inputs, Scenario) else inputs.scenario()
        run = Run(actuator, known)
        ready = prepare(run, fidelity, record, notices=notices)
        if notices:
            report([ready.notices], strict=False)
        plan = ready.plan[0]
        if period is not None:
            plan = replace(plan, period_steps=max(1, int(period / ready.step + 1e-6)))
        tables = {} if isinstance(inputs, Scenario) else inputs.tables(log.name)
        core = {**ready.core, "inputs": _filled(ready.core["inputs"], tables)}
        self._prepared = replace(ready, core=core, plan=(plan,))
        self._place = positions(actuator.wiring)

    @property
    def step(self) -> float:
        """Solver step [s]."""
        return self._prepared.step

    def run(
        self,
        variants: Sequence[Variant] = (Variant(),),
        progress: Progress | None = None,
        threads: int | None = None,
    ) -> Iterator[ModelRun]:
        """Run the variants, some of them at once; yield what each shows, in their order.

        Raises
        ------
        InputError
            A path, a fault or a value that cannot be.
        Interrupted
            `progress` returned False.
        """
        for first in range(0, len(variants), _CHUNK):
            part = variants[first : first + _CHUNK]
            yield from run_all([(self, variant) for variant in part], progress, threads)

    def stepped(
        self,
        law: Callable[[int, Floats], float],
        port: str,
        signals: Sequence[str],
        times: Floats,
        variant: Variant = Variant(),
    ) -> Floats:
        """Run with an input that a law sets from what it reads, instant by instant.

        Parameters
        ----------
        law : callable
            Of the instant's number and the signals there, shape (k,); what it returns is held at
            the port until the next instant, SI.
        port : str
            Which input.
        signals : sequence of str
            Of the model.
        times : ndarray, shape (n,)
            Instants, increasing from zero [s].
        variant : Variant
            How the run differs from the experiment.

        Returns
        -------
        ndarray, shape (n, k + 1)
            The signals at each instant, and what the law set there.

        Raises
        ------
        InputError
            The run leaves the finite numbers.
        """
        from elevon import _core

        ready, wiring = self._varied(variant), self.actuator.wiring
        core = _core.Session(wiring, self.fidelity, [ready.core], [], list(signals), "auto")
        names = list(signal_records(wiring, self.fidelity))
        places = [names.index(name) for name in signals]
        steps = np.diff(np.round(times / core.step)).astype(np.int64).tolist()
        out = np.empty((len(times), len(places) + 1))
        for k, count in enumerate([*steps, 0]):
            seen = core.read(places)[0]
            value = law(k, seen)
            out[k, :-1], out[k, -1] = seen, value
            if count:
                core.set_values(port, [value])
                if core.advance(count):
                    raise InputError(f"{self.log.name}: the run leaves the finite numbers")
        return out

    def sensitivities(
        self, variant: Variant, paths: Sequence[str], progress: Progress | None = None
    ) -> dict[str, dict[str, Floats]]:
        """Return a run's exact derivatives: path to role to values, shape (n,), on `log.time`.

        They are those of the branch the run takes: where friction sticks or slips they jump.
        """
        from elevon import _core

        ready = self._varied(variant)
        plan = [clock.to_core() for clock in ready.plan]
        passes = _core.sensitivities(
            self.actuator.wiring, self.fidelity, ready.core, plan, list(paths), [],
            lambda fraction: progress is None or progress(fraction) is not False,
        )  # fmt: skip
        if any(item["status"] == "interrupted" for item in passes):
            raise Interrupted("the run was stopped")
        count, out = _core.derivatives_per_pass(), {}
        for number, item in enumerate(passes):
            rows = item["clocks"][ready.plan[0].name]
            chosen = paths[count * number : count * (number + 1)]
            array = rows["values"].reshape(len(rows["time"]), -1, 1 + len(chosen))
            for k, path in enumerate(chosen):
                out[path] = {
                    role: np.interp(self.log.time, rows["time"], array[:, at, 1 + k])
                    for role, at in self._columns().items()
                }
        return out

    def _columns(self) -> dict[str, int]:
        names = self._prepared.plan[0].signals
        return {role: names.index(signal) for role, signal in self.shows.items()}

    def _varied(self, variant: Variant) -> Prepared:
        base = self._prepared.core
        vector = np.array(base["parameters"])
        for path, value in variant.values.items():
            vector[self._place[path]] = value
        faults = [
            Fault.parse(text).resolved(self.actuator.wiring, self.fidelity, f"fault[{k}]")
            for k, text in enumerate(variant.faults)
        ]
        loads = {p: checked(t, f"{self.log.name}: {p}") for p, t in variant.loads.items()}
        inputs = _filled(base["inputs"], loads)
        if variant.later != 0.0:
            inputs = {
                port: [{**t, "times": np.asarray(t["times"]) + variant.later} for t in terms]
                for port, terms in inputs.items()
            }
        core = {
            **base,
            "parameters": vector,
            "inputs": inputs,
            "faults": faults,
            "initial": {**base["initial"], **variant.initial},
            "run": variant.number,
        }
        return replace(self._prepared, core=core)

    def _read(self, result: Mapping[str, Any]) -> ModelRun:
        rows = result["clocks"][self._prepared.plan[0].name]
        values = rows["values"]
        channels = {role: values[:, at] for role, at in self._columns().items()}
        units = {role: self.log.units.get(role, "") for role in channels}
        log = Log(self.log.name, np.asarray(rows["time"]), channels, units)
        status, message = str(result["status"]), str(result["message"])
        return ModelRun(status, float(result["time"]), message, log)


def run_all(
    runs: Sequence[tuple[Experiment, Variant]],
    progress: Progress | None = None,
    threads: int | None = None,
) -> list[ModelRun]:
    """Run variants of several experiments in one batch; what each shows, in their order.

    Raises
    ------
    InputError, Interrupted
        As `Experiment.run`.
    """
    fidelities = {experiment.fidelity for experiment, _ in runs}
    if len(fidelities) > 1:
        raise InputError("runs of one batch have one fidelity")
    ready = [experiment._varied(variant) for experiment, variant in runs]
    fidelity = fidelities.pop()
    check_budget(ready, fidelity, BUDGET)
    results = simulate_prepared(ready, fidelity=fidelity, progress=progress, threads=threads)
    return [experiment._read(r) for (experiment, _), r in zip(runs, results, strict=True)]


def signals_by_role(wiring: str, fidelity: str) -> dict[str, str]:
    """Return role to signal; what a sensor shows before what is true."""
    records = signal_records(wiring, fidelity)
    return {item["role"]: name for name, item in records.items() if item["role"] is not None}


def _filled(
    inputs: Mapping[str, Sequence[Mapping[str, Any]]], tables: Mapping[str, Table]
) -> dict[str, Any]:
    """Return the core's inputs with the arrays of some ports."""
    filled: dict[str, Any] = dict(inputs)
    for port, (times, values) in tables.items():
        filled[port] = [{**inputs[port][0], "times": times, "values": values}]
    return filled
