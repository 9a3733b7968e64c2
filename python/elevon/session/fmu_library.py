"""One instance of a foreign FMU, 2.0 or 3.0 alike, through FMPy."""

from __future__ import annotations

import ctypes
import math
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.errors import ElevonError, ForeignModelError

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ScalarVariable

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
