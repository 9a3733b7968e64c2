"""FMPy, an importer of others: it finds no problem, its simulation has the bits of one call."""

import contextlib
import io
from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon.deploy import export_fmu

fmpy = pytest.importorskip("fmpy")
validation = pytest.importorskip("fmpy.validation")
VERSIONS = ("2.0", "3.0")
PERIOD = 1e-3
#: Actuator to a command, a load on the output from a quarter on, a fault with its severity from the
#: half on, all SI; and signals with a part that load, friction or torque demand set at once.
CASES = {
    "torino-rotary": (0.05, 2.0, "friction@transmission", 1.5),
    "nasa-ballscrew": (0.003, 400.0, "friction@transmission", 1.5),
    "pisa-landing-gear": (1.0, 300.0, "friction_growth@screw", 900.0),
}
AT_ONCE = {"friction_torque", "motor_torque"}
EVERY = [(name, fidelity) for name in CASES for fidelity in ("high", "low")]


def _simulated(path, document, name, steps):
    """Return FMPy's result: inputs and the fault's severity are a table, a row a step."""
    command, load, fault, severity = CASES[name]
    fault = fault.replace("@", ".")
    columns = ("time", "command", "output", f"fault.{fault}")
    table = np.zeros(steps + 1, dtype=[(column, float) for column in columns])
    table["time"] = np.arange(steps + 1) * PERIOD
    table["command"] = command
    table["output"][steps // 4 :] = load
    table[f"fault.{fault}"][steps // 2 :] = severity
    choices = ["none", "all", *(port.name for port in document.faults)]
    with contextlib.redirect_stdout(io.StringIO()):  # it names every input that the table lacks
        return fmpy.simulate_fmu(
            path, stop_time=steps * PERIOD, output_interval=PERIOD, input=table,
            start_values={"fault_prepared": choices.index(fault) + 1},
            output=list(document.signals), fmi_type="CoSimulation",
        )  # fmt: skip


def _once(document, name, fidelity, steps):
    """Return the same by one call, with a row each solver step."""
    command, load, fault, severity = CASES[name]
    gear = {"mode": "gear", "steps": [{"time": 0.0, "action": "extend"}]}
    constant = {"terms": [{"kind": "constant", "value": command}]}
    step = {"kind": "step", "final": load, "time": steps // 4 * PERIOD}
    scenario = {
        "duration": steps * PERIOD,
        "command": gear if name == "pisa-landing-gear" else constant,
        "load": {"output": {"terms": [step]}},
        "fault": [f"{fault}={severity}:step(time={steps // 2 * PERIOD})"],
    }
    record = f"{','.join(document.signals)}@every"
    return elevon.simulate(name, scenario, fidelity=fidelity, record=record)


def _check(exported, name, fidelity, version, steps):
    """At each communication point: the recorded row, or what stood before that instant acted."""
    file, fmu = exported(name, fidelity, version)
    document = file.document
    got = _simulated(str(file.path), document, name, steps)
    once = _once(document, name, fidelity, steps)
    whole = round(PERIOD / document.step)
    assert fmu.version == version
    acting = {steps // 4, steps // 2}
    for signal in document.signals:
        values = once[signal].values
        row, before = values[whole::whole], values[whole - 1 :: whole][:steps]
        apart = set(1 + np.flatnonzero((got[signal][1:] != row) & (got[signal][1:] != before)))
        if signal in AT_ONCE:
            apart = {k for k in apart if k not in acting and k % 10}
        assert not apart, (signal, sorted(apart)[:5])
        if signal in ("output_position", "motor_position", "motor_speed"):
            assert np.array_equal(got[signal][1:], row), signal
    return got


@pytest.mark.parametrize("version", VERSIONS)
def test_it_simulates_the_bits_of_one_call(exported, version):
    got = _check(exported, "torino-rotary", "low", version, 100)
    assert abs(got["output_position"][-1]) > 1e-3


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("name", "fidelity"), EVERY)
def test_it_simulates_the_bits_of_one_call_of_every_model(exported, name, fidelity, version):
    _check(exported, name, fidelity, version, 400)


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("name", "fidelity"), EVERY)
def test_it_finds_no_problem(exported, name, fidelity, version):
    file, _ = exported(name, fidelity, version)
    assert validation.validate_fmu(str(file.path)) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_an_exported_actuator_is_coupled_to_a_session(tmp_path, version):
    """Its position commands a second actuator, as that of a session beside it does."""
    path = export_fmu("torino-rotary", tmp_path / "a.fmu", fidelity="low", version=version).path
    first = elevon.Fmu(path, {"command": 0.05, "output_position": "command"}, trust=True)
    second = elevon.Session("torino-rotary", fidelity="low", controller=first)
    alone = elevon.Session("torino-rotary", fidelity="low", signals=["output_position"])
    alone.set(command=0.05)
    follower = elevon.Session("torino-rotary", fidelity="low")
    for _ in range(150):
        second.advance(PERIOD)
        alone.advance(PERIOD)
        follower.set(command=alone["output_position"])
        follower.advance(PERIOD)
        assert second["output_position"] == follower["output_position"]
    assert second["output_position"] != 0.0


def test_a_file_is_valid_for_this_platform_and_small(exported):
    """The binary in it is what the wheel grows by: 4 MB at most."""
    path = str(exported("torino-rotary", "low", "3.0")[0].path)
    assert validation.validate_fmu(path) == []
    assert fmpy.supported_platforms(path) == [fmpy.platform]
    assert Path(path).stat().st_size < 4e6
