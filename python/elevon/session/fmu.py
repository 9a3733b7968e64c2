"""A foreign FMU that drives or loads a session: `elevon.Fmu`."""

from __future__ import annotations

import ctypes
import math
import os
import tempfile
import weakref
import zipfile
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from elevon.arrays import Floats
from elevon.errors import (
    ArgumentTypeError,
    ElevonError,
    ForeignModelError,
    FormatError,
    InputError,
    unknown,
)
from elevon.extras import missing_package
from elevon.scenario.compile import signal_units
from elevon.session.values import positive_seconds
from elevon.units.quantity import check_kind
from elevon.units.unit import Unit, parse_unit

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ScalarVariable

    from elevon.session.session import Session


#: What a variable takes.
Value = float | str | bool

_TEXTS = 3  # of the logger that an error quotes
_WARNING = 1  # status from which a text of the logger is noted


class FmuInstance:
    """One instance.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
        Of the FMU.
    folder : Path
        Where it is unpacked.
    name : str
        Of the instance, for errors.
    """

    def __init__(self, description: ModelDescription, folder: Path, name: str) -> None:
        self.name = name
        self._three = description.fmiVersion.startswith("3")
        self._texts: deque[str] = deque(maxlen=_TEXTS)
        made = self._made(description, folder)
        self._slave = self._call("load", made)
        # The logger is kept: the library calls it as long as the instance lives.
        self._logger = self._logger_of_three if self._three else self._callbacks()
        key = "logMessage" if self._three else "callbacks"
        self._call("instantiate", lambda: self._slave.instantiate(**{key: self._logger}))
        self._alive = True

    def _made(self, description: ModelDescription, folder: Path) -> Callable[[], Any]:
        from fmpy import fmi2, fmi3

        kind = fmi3.FMU3Slave if self._three else fmi2.FMU2Slave
        return lambda: kind(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=str(folder),
            instanceName=self.name,
        )

    def _callbacks(self) -> Any:
        from fmpy import calloc, fmi2, free
        from fmpy.logging import addLoggerProxy

        out = fmi2.fmi2CallbackFunctions()
        out.logger = fmi2.fmi2CallbackLoggerTYPE(self._logger_of_two)
        out.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        out.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(ctypes.byref(out))
        return out

    def _logger_of_two(self, *given: Any) -> None:
        self._note(given[2], given[4])

    def _logger_of_three(self, *given: Any) -> None:
        self._note(given[1], given[3])

    def _note(self, status: int, message: bytes | None) -> None:
        if status >= _WARNING and message:
            self._texts.append(message.decode("utf-8", "replace").strip())

    def begin(self, time: float, values: Mapping[ScalarVariable, Value]) -> None:
        """Set start values and parameters, and initialise at an instant [s]."""
        if not self._three:
            self._call("set up", lambda: self._slave.setupExperiment(startTime=time))
        for variable, value in values.items():
            self.put(variable, value)
        enter = {"startTime": time} if self._three else {}
        self._call("initialise", lambda: self._slave.enterInitializationMode(**enter))
        self._call("initialise", self._slave.exitInitializationMode)

    def put(self, variable: ScalarVariable, value: Value) -> None:
        """Set a variable."""
        put = getattr(self._slave, f"set{self._type(variable)}")
        self._call(
            f"set {variable.name} = {value}", lambda: put([variable.valueReference], [value])
        )

    def get(self, variable: ScalarVariable) -> float:
        """Return a variable as a number.

        Raises
        ------
        ForeignModelError
            It cannot be had, or is not finite.
        """
        get = getattr(self._slave, f"get{self._type(variable)}")
        (value,) = self._call(f"get {variable.name}", lambda: get([variable.valueReference]))
        if not math.isfinite(value):
            raise self._error(f"{variable.name} = {value}")
        return float(value)

    def step(self, time: float, period: float) -> None:
        """Step from an instant on [s].

        Raises
        ------
        ForeignModelError
            It refuses, asks for an end, or returns early.
        """
        answer = self._call(
            f"step from {time:.9g} s by {period:g} s", lambda: self._slave.doStep(time, period)
        )
        if self._three and (answer[1] or answer[2]):
            raise self._error(f"ended its step from {time:.9g} s at {answer[3]:.9g} s")

    def close(self) -> None:
        """End the instance; afterwards nothing may be called."""
        if self._alive:
            self._alive = False
            for end in (self._slave.terminate, self._slave.freeInstance):
                with suppress(Exception):  # it is thrown away, whatever it answers
                    end()

    def _type(self, variable: Any) -> str:
        if variable.type == "Enumeration":
            return "Int64" if self._three else "Integer"
        return str(variable.type)

    def _call(self, what: str, function: Callable[[], Any]) -> Any:
        try:
            return function()
        except ElevonError:
            raise
        except Exception as error:
            raise self._error(f"{what}: {error}") from error

    def _error(self, text: str) -> ForeignModelError:
        texts = "; ".join(self._texts)
        return ForeignModelError(f"{self.name}: {text}" + (f" ({texts})" if texts else ""))


_MOST_BYTES = 2**30  # of an FMU, unpacked
_PERIOD = 1e-3  # s, where the FMU states no step of its own
_WHOLE = ("Integer", "Enumeration", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32",
          "UInt64")  # fmt: skip
_NUMBERS = ("Real", "Float64", "Float32", "Boolean", *_WHOLE)

#: What an input of an FMU is given: a signal's name, a number in its own unit, or a function of the
#: session that returns such a number.
FmuSource = str | float | Callable[["Session"], Any]


@dataclass(frozen=True)
class _Link:
    """One variable of the FMU, and what it is joined to: SI = factor * value + offset."""

    variable: Any
    name: str
    factor: float
    offset: float


class Fmu:
    """A foreign FMU for co-simulation, 2.0 or 3.0, that a session is coupled to.

    As a session's ``controller`` it takes the session's signals at each of its ticks, steps, and
    what it puts out acts from that tick on: as an own controller. As one of its ``loads`` it acts
    with what it put out at that tick and steps beside the actuator. Values are held between ticks.
    In a session of many runs each has its own instance.

    An FMU is a program: loading it runs it with the rights of this process. It cannot be copied or
    pickled: what it holds is a state of that program.

    Parameters
    ----------
    path : path
        The file.
    mapping : mapping of str to str, float or callable
        Variable of the FMU to what it is joined to. An output: an input of the session
        (``command``, ``output``, ``supply``, ...). An input: a signal of the session, or a number,
        or a function of the session that returns one; numbers in the unit that the FMU states.
        Where the FMU states units, values are converted; where it states none, they are SI.
    parameters : mapping of str to float, str or bool, optional
        Its parameters, or start values of inputs that nothing is joined to, in its units.
    period : float or str, optional
        Between its ticks: a whole number of solver steps. Default: the step that the FMU states,
        else 1 ms.
    trust : bool
        That it may be loaded.

    Raises
    ------
    InputError
        Without `trust`; FMPy is not installed (extra ``fmu``); no such file, none for
        co-simulation or for this platform; a variable that is not there or is no input, output or
        parameter.
    FormatError
        A file that is no FMU, or one that FMPy finds invalid.

    Examples
    --------
    >>> joined = {"speed": "motor_speed", "torque": "command"}
    >>> pi = elevon.Fmu("pi.fmu", joined, trust=True)  # doctest: +SKIP
    >>> session = Session("torino-rotary", mode="torque", controller=pi)  # doctest: +SKIP
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        mapping: Mapping[str, FmuSource],
        *,
        parameters: Mapping[str, float | str | bool] | None = None,
        period: float | str | None = None,
        trust: bool = False,
    ) -> None:
        self.path = Path(path).expanduser()
        self._description = _described(self.path)
        if trust is not True:
            raise InputError(
                f"{self.path}: an FMU is a program, which would run with all rights of this "
                "process; where you trust who made it, give trust=True"
            )
        self.variables = {item.name: item for item in self._description.modelVariables}
        if not isinstance(mapping, Mapping):
            raise ArgumentTypeError(f"mapping: {mapping!r:.60} is no mapping of variables")
        self._sources = {n: v for n, v in mapping.items() if self._causality(n) == "input"}
        self._targets = {n: v for n, v in mapping.items() if n not in self._sources}
        if not self._targets:
            raise InputError(f"{self}: the mapping joins none of its outputs to the session")
        self._values = {
            self._variable(name): self._value(name, value)
            for name, value in (parameters or {}).items()
        }
        stated = getattr(self._description.defaultExperiment, "stepSize", None)
        default = _PERIOD if stated is None else float(stated)
        self.period = default if period is None else positive_seconds(period, "period")
        self._instances: list[FmuInstance] = []
        self._inputs: list[_Link] = []
        self._outputs: list[_Link] = []

    def __copy__(self) -> NoReturn:
        raise ArgumentTypeError(f"{self}: is a foreign program; make another Fmu of its file")

    def __deepcopy__(self, _memo: dict[int, object]) -> NoReturn:
        self.__copy__()

    def __reduce__(self) -> NoReturn:
        self.__copy__()

    def __str__(self) -> str:
        return self.path.name

    def __repr__(self) -> str:
        return f"<Fmu {self}, FMI {self._description.fmiVersion}: each {self.period:g} s>"

    def set(self, **sources: FmuSource) -> None:
        """Join inputs to something else from the next tick on, such as a reference to a number."""
        for name, source in sources.items():
            if self._causality(name) != "input":
                raise InputError(f"{self}: {name} is an output; what it acts on stays")
            if self._instances and isinstance(source, str):
                raise InputError(f"{self}: {name}: signals are joined before the session begins")
            self._sources[name] = source

    def bind(self, session: Session) -> None:
        """Join it to a session that begins: names and units are checked, instances made.

        Raises
        ------
        InputError
            A signal or input that the session has not, a unit of another kind, a period that is no
            whole number of solver steps; it belongs to another session.
        ForeignModelError
            The FMU cannot be loaded or initialised.
        """
        if self._instances:
            raise InputError(f"{self}: belongs to a session already; make an Fmu for each")
        whole = round(self.period / session.step)
        if whole < 1 or abs(self.period - whole * session.step) > 1e-6 * session.step:
            raise InputError(
                f"{self}: period = {self.period:.9g} s is no whole number of solver steps of "
                f"{session.step:g} s"
            )
        units = signal_units(session.wiring, session.fidelity)
        units = {**units, "command": session.unit("command") or units["command"]}
        self._outputs = [
            self._link(n, str(p), session.unit(str(p))) for n, p in self._targets.items()
        ]
        for name, source in self._sources.items():
            if isinstance(source, str):
                session.read(source)
                self._inputs.append(self._link(name, source, units[source]))
        self._begin(session)

    def _begin(self, session: Session) -> None:
        folder = tempfile.TemporaryDirectory(prefix="elevon-fmu-")
        from fmpy import extract

        extract(self.path, folder.name)
        finalizer = weakref.finalize(self, _end, self._instances, folder)
        try:
            for run in range(len(session)):
                name = f"{self} of run {run}" if len(session) > 1 else str(self)
                instance = FmuInstance(self._description, Path(folder.name), name)
                self._instances.append(instance)
                instance.begin(session.time, self._values)
        except BaseException:
            finalizer()
            raise

    def outputs(self) -> dict[str, Floats]:
        """Return what it puts out now: input of the session to SI values, shape (runs,)."""
        return {
            link.name: np.array(
                [link.factor * one.get(link.variable) + link.offset for one in self._instances]
            )
            for link in self._outputs
        }

    def advance(self, session: Session) -> None:
        """Take the session's signals and step."""
        names = [link.name for link in self._inputs]
        values = session.read(*names) if names else {}
        for link in self._inputs:
            self._give(link.variable, (values[link.name] - link.offset) / link.factor)
        for name, source in self._sources.items():
            if not isinstance(source, str):
                self._give(self.variables[name], source(session) if callable(source) else source)
        for one in self._instances:
            one.step(session.time, self.period)

    def _give(self, variable: Any, value: Any) -> None:
        try:
            each = np.broadcast_to(np.asarray(value, dtype=np.float64), (len(self._instances),))
        except (TypeError, ValueError) as error:
            raise InputError(f"{self}: {variable.name}: {value!r:.60} is no number") from error
        for one, number in zip(self._instances, each.tolist(), strict=True):
            one.put(variable, _typed(variable, number, str(self)))

    def _variable(self, name: str) -> Any:
        if name not in self.variables:
            raise unknown("variable", name, self.variables, str(self))
        return self.variables[name]

    def _causality(self, name: str) -> str:
        variable = self._variable(name)
        kind = str(variable.causality)
        if kind not in ("input", "output") or variable.type not in _NUMBERS or variable.dimensions:
            raise InputError(
                f"{self}: {name} is {kind} of type {variable.type}"
                f"{', an array' if variable.dimensions else ''}; inputs and outputs that are one "
                "number can be joined"
            )
        return kind

    def _value(self, name: str, value: float | str | bool) -> Any:
        variable = self._variable(name)
        if variable.causality not in ("parameter", "structuralParameter", "input"):
            raise InputError(f"{self}: {name} is {variable.causality}, no parameter")
        if variable.type == "String" or isinstance(value, str):
            if variable.type == "String" and isinstance(value, str):
                return value
            raise InputError(f"{self}: {name} = {value!r:.60} is not of the type {variable.type}")
        return _typed(variable, float(value), str(self))

    def _link(self, name: str, joined: str, unit: str) -> _Link:
        variable = self._variable(name)
        factor, offset = self._scale(variable, unit or "1")
        return _Link(variable, joined, factor, offset)

    def _scale(self, variable: Any, si: str) -> tuple[float, float]:
        """Return what makes a value of the FMU an SI value of the session."""
        stated = variable.unit or getattr(variable.declaredType, "unit", None)
        if not stated:
            return 1.0, 0.0
        place = f"{self}: {variable.name}"
        known = {unit.name: unit.baseUnit for unit in self._description.unitDefinitions}
        base = known.get(stated)
        if base is None:
            unit: Unit = check_kind(stated, si, place)
            return unit.factor, float(unit.offset)
        # FMI counts the radian where others leave it out, so it decides nothing.
        got = (base.m, base.kg, base.s, base.A, base.K)
        if got != tuple(parse_unit(si).dimension[:5]) or base.mol or base.cd:
            raise InputError(f"{place}: unit {stated!r} is of another kind than {si}")
        return float(base.factor), float(base.offset)


def _typed(variable: Any, number: float, source: str) -> Any:
    if not np.isfinite(number):
        raise InputError(f"{source}: {variable.name} = {number} must be finite")
    if variable.type == "Boolean":
        return bool(number)
    if variable.type in _WHOLE:
        if number != round(number):
            raise InputError(f"{source}: {variable.name} = {number:g} must be a whole number")
        return round(number)
    return number


def _described(path: Path) -> Any:
    """Read and check an FMU's description, its platform and its size."""
    try:
        import fmpy
    except ModuleNotFoundError as error:
        raise InputError(missing_package(error) or str(error)) from error
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with zipfile.ZipFile(path) as packed:
            size = sum(item.file_size for item in packed.infolist())
        if size > _MOST_BYTES:
            raise FormatError(f"{path}: expands to {size} bytes; the limit is {_MOST_BYTES}")
        description = fmpy.read_model_description(str(path), validate=True)
        platforms = fmpy.supported_platforms(str(path))
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{path}: is no FMU: {str(error)[:500]}") from error
    if not description.fmiVersion.startswith(("2.", "3.")):
        raise InputError(f"{path}: is of FMI {description.fmiVersion}; 2.0 and 3.0 are served")
    if description.coSimulation is None:
        raise InputError(f"{path}: is no FMU for co-simulation")
    if fmpy.platform not in platforms:
        there = ", ".join(platforms) or "none"
        raise InputError(f"{path}: has no binary for {fmpy.platform}; binaries: {there}")
    return description


def _end(instances: list[FmuInstance], folder: tempfile.TemporaryDirectory[str]) -> None:
    for one in instances:
        one.close()
    instances.clear()
    folder.cleanup()
