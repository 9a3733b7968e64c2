"""Calls in any order with any numbers: a status each time, never a crash, never a defect."""

import ctypes
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_uint32, c_void_p

import numpy as np
import pytest

from tests.deploy.driver import FATAL, OK, Component

NUMBERS = [0.0, 1.0, -1.0, 1e-3, 5e-4, 2e-3, 0.05, 1e300, -1e-300, np.nan, np.inf, -np.inf, 1e9]


class Caller:
    """Makes random calls on one instance; `counts` has how often each status came."""

    def __init__(self, fmu, rng):
        self.fmu, self.rng = fmu, rng
        self.one, self.states, self.saved = Component(fmu), [], []
        self.counts = dict.fromkeys(range(5), 0)
        two = fmu.two
        self.kinds = {"Real": c_double, "Integer": c_int, "Boolean": c_int} if two else {
            "Float64": c_double, "Float32": ctypes.c_float, "Int32": ctypes.c_int32,
            "Int64": ctypes.c_int64, "UInt8": ctypes.c_uint8, "Boolean": ctypes.c_uint8,
        }  # fmt: skip
        self.count = len(fmu.references)
        self.calls = [self.set, self.get, self.step, self.step, self.life, self.state, self.forward]

    def number(self):
        return float(self.rng.choice(NUMBERS) if self.rng.random() < 0.7 else self.rng.normal())

    def references(self, most=4):
        beyond = self.count + (3 if self.rng.random() < 0.05 else 0)
        return [int(x) for x in self.rng.integers(0, beyond, self.rng.integers(0, most))]

    def set(self):
        function, kind = list(self.kinds.items())[self.rng.integers(len(self.kinds))]
        references = self.references()
        values = [self.number() for _ in references]
        if kind not in (c_double, ctypes.c_float):
            values = [int(v) % 200 if np.isfinite(v) else 7 for v in values]
        return self.one.set_raw(function, references, values, kind)

    def get(self):
        function, kind = list(self.kinds.items())[self.rng.integers(len(self.kinds))]
        return self.one.get_raw(function, kind, self.references())[0]

    def step(self):
        if self.rng.random() < 0.2:
            seconds = self.number()
            # A step of years is no wrong call: it takes as long.
            return self.one.step(self.number(), seconds if abs(seconds) < 0.1 else 1e300)
        return self.one.step(self.time(), float(self.rng.choice([5e-4, 1e-3, 2e-3])))

    def time(self):
        return self.one.get_raw("Real" if self.fmu.two else "Float64", c_double, [0])[1][0]

    def forward(self):
        """Come back to where steps are taken, whatever was before."""
        if self.rng.random() < 0.5:
            return OK
        self.one.call("Reset")
        return self.one.begin()

    def life(self):
        """A call that ends a phase, in or out of turn."""
        two, start = self.fmu.two, c_double(self.number() if self.rng.random() < 0.1 else 0.0)
        enter = () if two else (c_bool(False), c_double(0), start, c_bool(False), c_double(0))
        choices = [("EnterInitializationMode", enter), ("ExitInitializationMode", ())]
        if self.rng.random() < 0.1:
            choices = [("Terminate", ()), ("Reset", ())]
        name, arguments = choices[self.rng.integers(len(choices))]
        return self.one.call(name, *arguments)

    def state(self):
        if self.rng.random() < 0.3 or not self.states:
            state = c_void_p()
            status = self.one.call(f"Get{self.one._state}", byref(state))
            if status == OK:
                self.states.append(state)
            return status
        state = self.states[self.rng.integers(len(self.states))]
        action = self.rng.integers(5)
        if action == 0:
            return self.one.restore(state)
        if action == 1:
            self.states.remove(state)
            return self.one.release(state)
        if action == 2:
            self.saved = [*self.saved[-3:], self.one.serialise(state)]
            return OK
        if action == 3:
            return self.one.restore(c_void_p())
        return self.read()

    def read(self):
        """A saved state, or one with bytes changed."""
        data = bytearray(self.saved[-1] if self.saved else b"nothing")
        if self.rng.random() < 0.5:
            data[self.rng.integers(len(data))] ^= 1 << int(self.rng.integers(8))
        status, state = self.one.read_state(bytes(data))
        if status == OK:
            self.states.append(state)
        return status

    def run(self, calls):
        for _ in range(calls):
            self.counts[self.calls[self.rng.integers(len(self.calls))]()] += 1
            self.one.texts.clear()
            while len(self.states) > 8:
                self.one.release(self.states.pop(0))
        for state in self.states:
            self.one.release(state)
        self.one.free()
        return self.counts


def _judge(counts):
    assert counts[FATAL] == 0
    assert counts[OK] > 0.1 * sum(counts.values())
    assert sum(counts.values()) - counts[OK] > 0.01 * sum(counts.values())


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_random_calls_in_random_order(exported, version):
    _, fmu = exported("torino-rotary", "low", version)
    _judge(Caller(fmu, np.random.default_rng(35)).run(600))


@pytest.mark.long
@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("name", ["torino-rotary", "nasa-ballscrew", "pisa-landing-gear"])
def test_a_million_random_calls(exported, name, fidelity, version):
    """A million over the twelve cases."""
    _, fmu = exported(name, fidelity, version)
    _judge(Caller(fmu, np.random.default_rng(1035)).run(84_000))


def test_null_pointers_are_answered(exported):
    _, fmu = exported("torino-rotary", "low", "3.0")
    none = c_void_p()
    assert fmu.library.fmi3Terminate(none) == 3
    fmu.library.fmi3FreeInstance(none)
    one = Component(fmu)
    row = (c_uint32 * 1)(0)
    assert one.call("GetFloat64", row, c_size_t(1), None, c_size_t(1)) == 3
    assert one.call("GetFloat64", row, c_size_t(1), (c_double * 2)(), c_size_t(2)) == 3
    assert one.call("GetFMUState", None) == 3
    assert one.call("SerializeFMUState", None, None, c_size_t(0)) == 3
    one.free()
