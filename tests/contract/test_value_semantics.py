"""Copies of public objects: each is right and independent, or is refused in our words."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon.errors import DivergedError, ElevonError, UnknownNameError

WAYS = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda item: pickle.loads(pickle.dumps(item)),
}

#: What is a state in this process's memory.
LIVING = {"Session", "SessionState"}


@pytest.fixture(scope="module")
def recording():
    return elevon.simulate(
        "torino-rotary",
        {"duration": "20 ms", "command": {"terms": [{"kind": "constant", "value": 0.01}]}},
        fidelity="low",
        record="output_position,motor_speed@1 kHz",
    )


@pytest.fixture(scope="module")
def items(recording, tmp_path_factory):
    """Return one of each public class, and of what public functions return."""
    log = tmp_path_factory.mktemp("log") / "log.csv"
    recording.save(log)
    actuator = elevon.Actuator.load("torino-rotary")
    session = elevon.Session("torino-rotary", fidelity="low")
    return {
        "Actuator": actuator,
        "Scenario": elevon.Scenario.model_validate({"duration": "1 s"}),
        "Recording": recording,
        "Channel": recording.channels[0],
        "Clock": recording.channels[0].clock,
        "Log": elevon.read_log(log),
        "Result": elevon.doctor(log, actuator),
        "Run": elevon.Run(actuator, None, 3),
        "Session": session,
        "SessionState": session.save(),
        "ElevonError": ElevonError("a"),
        "InputError": elevon.InputError("a"),
        "ElevonWarning": elevon.ElevonWarning("a"),
        "NotActingWarning": elevon.NotActingWarning("a"),
        "UnknownNameError": UnknownNameError("a", "b", ["c"]),
        "DivergedError": DivergedError("a", 1.0, "b", [2]),
    }


def form(item, seen=()):
    """Return an object's content as nested tuples, arrays as their bytes."""
    if isinstance(item, np.ndarray):
        return (item.dtype.str, item.shape, item.tobytes())
    if isinstance(item, (str, bytes, int, float, type(None), type, Path)) or id(item) in seen:
        return repr(item)
    seen = (*seen, id(item))
    if isinstance(item, dict) or hasattr(item, "items"):
        return tuple((form(key, seen), form(value, seen)) for key, value in item.items())
    if isinstance(item, (list, tuple, set, frozenset)):
        return tuple(form(value, seen) for value in item)
    slots = [name for kind in type(item).__mro__ for name in getattr(kind, "__slots__", ())]
    fields = {name: getattr(item, name) for name in slots if hasattr(item, name)}
    fields |= getattr(item, "__dict__", {})
    args = getattr(item, "args", ()) if isinstance(item, BaseException) else ()
    return (type(item).__name__, form(args, seen), form(fields, seen))


@pytest.mark.parametrize("way", WAYS)
def test_copies_are_right_or_refused(items, way):
    public = {name for name in elevon.__all__ if isinstance(getattr(elevon, name), type)}
    assert public - items.keys() == {"Fmu"}  # it is a foreign program: tests/session/test_fmu.py
    for name, item in items.items():
        if way == "pickle" and name in LIVING:
            with pytest.raises(ElevonError, match="cannot be pickled"):
                WAYS[way](item)
            continue
        made = WAYS[way](item)
        assert type(made) is type(item), name
        if name not in LIVING:
            assert form(made) == form(item), name


@pytest.mark.parametrize("way", ["copy", "deepcopy"])
def test_a_copied_session_goes_on_by_itself(way):
    """The copy's bits are those of the first, whichever is advanced in between."""
    first = elevon.Session("torino-rotary", fidelity="low", faults=["friction@transmission"])
    first.set(command=0.02)
    first.advance("5 ms")
    second = WAYS[way](first)
    first.set(command=-0.02)
    first.set_fault("friction@transmission", 0.5)
    first.advance("5 ms")
    assert second.time == pytest.approx(0.005)
    second.advance("5 ms")
    alone = elevon.Session("torino-rotary", fidelity="low", faults=["friction@transmission"])
    alone.set(command=0.02)
    alone.advance("10 ms")
    names = ("output_position", "motor_speed", "current_q")
    assert second.read(*names) == alone.read(*names)
    assert second.read(*names) != first.read(*names)


def test_arrays_of_a_session_are_its_callers():
    session = elevon.Session([elevon.Run("torino-rotary", None)] * 2, fidelity="low")
    values = np.array([0.01, 0.02])
    session.set(command=values)
    values[:] = 9.0
    session.advance("2 ms")
    read = session["command"]
    assert read.tolist() == [0.01, 0.02]
    read[:] = 5.0
    assert session["command"].tolist() == [0.01, 0.02]


def test_arrays_of_a_recording_cannot_be_changed_behind_it(recording):
    for channel in recording.channels:
        with pytest.raises(ValueError, match="read-only"):
            channel.values[0] = 1.0
