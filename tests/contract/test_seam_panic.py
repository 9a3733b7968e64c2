"""A panic below a seam call is an error of the family; the session it broke says that it is lost.

The bindings turn a ``PanicException`` that Python code raises below a call back into a panic, so
a value that raises one when it is read unwinds the core's side of the call.
"""

import numpy as np
import pytest

from elevon import _core
from elevon.actuator import Actuator
from elevon.errors import SimulationError
from elevon.session import Session
from elevon.simulate import simulate


class Raising:
    """A number that raises when it is read."""

    def __init__(self, error):
        self.error = error

    def __float__(self):
        raise self.error


def panic_type():
    """Return the class by which the bindings of `elevon._core` know a panic."""
    values = np.zeros(1)
    with pytest.raises(KeyError):  # makes the class, if none has been needed yet
        _core.waveform("constant", [Raising(KeyError("x"))], values)
    kinds = [kind for kind in BaseException.__subclasses__() if kind.__name__ == "PanicException"]
    for kind in kinds:  # each package with such bindings has its own; another's comes as it is
        with pytest.raises((SimulationError, kind)) as raised:
            refused(opened(), kind("tried"))
        if raised.type is SimulationError:
            return kind
    raise AssertionError(f"no class for a panic of elevon._core among {kinds}")


def opened():
    return Session("torino-rotary", mode="torque", fidelity="low")


def refused(session, error):
    terms = [{"kind": "constant", "enabled": True, "parameters": [Raising(error)]}]
    session._core.set_input(0, "command", terms)


def test_a_panic_in_a_session_is_an_error_and_the_session_is_lost(capfd):
    kind, session = panic_type(), opened()
    session.advance("1 ms")
    with pytest.raises(SimulationError, match=r"the core panicked \(.*\); this is a defect"):
        refused(session, kind("in the middle"))
    for call in (lambda: session.advance("1 ms"), lambda: session.read("motor_speed")):
        with pytest.raises(SimulationError, match="its state is lost; begin a new one"):
            call()
    opened().advance("1 ms")
    capfd.readouterr()


def test_a_panic_in_a_call_is_an_error_and_the_next_call_works(capfd):
    run = {
        "parameters": Actuator.load("torino-rotary").parameters.vector(),
        "inputs": {},
        "duration": 1e-3,
        "initial": {"output_position": Raising(panic_type()("in the middle"))},
    }
    with pytest.raises(SimulationError, match=r"the core panicked \(.*\); this is a defect"):
        _core.simulate("rotary", "low", [run], [])
    assert simulate("torino-rotary", {"duration": "1 ms"}, fidelity="low").meta["status"] == "ok"
    capfd.readouterr()
