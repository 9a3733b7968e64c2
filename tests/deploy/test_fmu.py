"""An FMU gives the bits of a session; what cannot be is refused with a reason."""

import ctypes
import threading
import zipfile

import numpy as np
import pytest

import elevon
from elevon.deploy import export_fmu, run_document
from elevon.errors import InputError, UnknownNameError
from tests.deploy.driver import DISCARD, ERROR, OK, Component, Fmu

VERSIONS = ("2.0", "3.0")
NAMES = ("torino-rotary", "nasa-ballscrew", "pisa-landing-gear")
#: Actuator to a command, a load on the output, and a fault with its severity, all SI.
CASES = {
    "torino-rotary": (0.05, 2.0, "friction@transmission", 1.5),
    "nasa-ballscrew": (0.003, 400.0, "friction@transmission", 1.5),
    "pisa-landing-gear": (1.0, 300.0, "friction_growth@screw", 900.0),
}


def _port(fault):
    kind, _, place = fault.partition("@")
    return f"fault.{kind}.{place}"


def _session_rows(name, fidelity, names, steps, period, prepared=()):
    """Command from the start, load after a quarter, the fault from the half on."""
    command, load, fault, severity = CASES[name]
    session = elevon.Session(name, fidelity=fidelity, faults=prepared, signals=names)
    session.set(command=command)
    rows = []
    for k in range(steps):
        if k == steps // 4:
            session.set(output=load)
        if k == steps // 2:
            if not prepared:
                session.announce(faults=[fault])
            session.set_fault(fault, severity)
        session.advance(period)
        rows.append(list(session.read(*names).values()))
    return np.array(rows)


def _fmu_rows(instance, name, names, steps, period, first=0, state_at=None):
    command, load, fault, severity = CASES[name]
    rows, state = [], None
    for k in range(first, steps):
        if k == state_at:
            state = instance.save()
        if k == 0:
            assert instance.set(command=command) == OK
        if k == steps // 4:
            assert instance.set(output=load) == OK
        if k == steps // 2:
            assert instance.set(**{_port(fault): severity}) == OK
        assert instance.step(k * period, period) in (OK, 1), instance.texts
        rows.append(instance.outputs(names))
    return np.array(rows), state


@pytest.mark.parametrize("version", VERSIONS)
def test_an_fmu_gives_the_bits_of_a_session(component, exported, version):
    file, _ = exported("torino-rotary", "low", version)
    names, steps, period = file.document.signals, 200, 2e-3
    instance = component(version=version)
    assert instance.begin() == OK
    rows, _ = _fmu_rows(instance, "torino-rotary", names, steps, period)
    assert np.array_equal(rows, _session_rows("torino-rotary", "low", names, steps, period))


@pytest.mark.long
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("name", NAMES)
def test_every_fmu_gives_the_bits_of_a_session_and_of_a_run(
    component, exported, name, fidelity, version
):
    """With the fault prepared the bits are those of one call of `elevon.simulate` as well."""
    file, _ = exported(name, fidelity, version)
    names, steps, period = file.document.signals, 400, 1e-3
    command, load, fault, severity = CASES[name]
    instance = component(name, fidelity, version)
    assert instance.begin() == OK
    rows, _ = _fmu_rows(instance, name, names, steps, period)
    assert np.array_equal(rows, _session_rows(name, fidelity, names, steps, period))
    choices = ["none", "all", *(port.name for port in file.document.faults)]
    prepared = component(name, fidelity, version)
    assert prepared.begin(fault_prepared=choices.index(fault.replace("@", ".")) + 1) == OK
    rows, _ = _fmu_rows(prepared, name, names, steps, period)
    plant = [n for n in ("output_position", "motor_position", "motor_speed") if n in names]
    table = [{"kind": "constant", "value": command}]
    gear = name == "pisa-landing-gear"
    begin = {"mode": "gear", "steps": [{"time": 0.0, "action": "extend"}]}
    half, quarter = steps // 2 * period, steps // 4 * period
    once = elevon.simulate(
        name,
        {
            "duration": steps * period,
            "command": begin if gear else {"terms": table},
            "load": {"output": {"terms": [
                {"kind": "step", "final": load, "time": quarter}]}},
            "fault": [f"{fault}={severity}:step(time={half})"],
        },
        fidelity=fidelity,
        record=f"{','.join(plant)}@1 kHz",
    )  # fmt: skip
    for signal in plant:
        column = rows[:, names.index(signal)]
        assert np.array_equal(column, once[signal].values[1:]), signal


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_is_saved_restored_and_branched(component, exported, version):
    file, _ = exported("torino-rotary", "low", version)
    names, steps, period = file.document.signals, 100, 2e-3
    first = component(version=version)
    assert first.begin() == OK
    rows, state = _fmu_rows(first, "torino-rotary", names, steps, period, state_at=60)
    data = first.serialise(state)
    assert first.restore(state) == OK
    again, _ = _fmu_rows(first, "torino-rotary", names, steps, period, first=60)
    assert np.array_equal(again, rows[60:])
    other = component(version=version)
    status, read = other.read_state(data)
    assert status == OK
    assert other.restore(read) == OK
    branch, _ = _fmu_rows(other, "torino-rotary", names, steps, period, first=60)
    assert np.array_equal(branch, rows[60:])
    damaged = bytearray(data)
    damaged[len(data) // 2] ^= 1
    for bad in (bytes(damaged), data[:-1], b"", data[:100]):
        assert other.read_state(bad)[0] == ERROR
    assert other.release(read) == OK
    assert first.release(state) == OK


@pytest.mark.parametrize("version", VERSIONS)
def test_setting_nothing_after_the_end_leaves_the_run(component, version):
    """Found by a million random calls: the state saved then had no run."""
    one = component(version=version)
    assert one.begin() == OK
    assert one.step(0.0, 2e-3) == OK
    before = one.outputs(["output_position"])
    assert one.call("Terminate") == OK
    assert one.set_raw("Real" if version == "2.0" else "Float64", [], []) == OK
    state = one.save()
    assert one.restore(state) == OK
    assert one.outputs(["output_position"]) == before
    assert one.release(state) == OK


@pytest.mark.long
@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("name", NAMES)
def test_states_of_every_model_branch(component, exported, name, fidelity):
    """Saved before, in and after what changes the equations; restored into a fresh instance."""
    file, _ = exported(name, fidelity, "3.0")
    names, steps, period = file.document.signals, 120, 1e-3
    for place in (10, 30, 60, 90):
        first, other = component(name, fidelity), component(name, fidelity)
        assert first.begin() == OK
        rows, state = _fmu_rows(first, name, names, steps, period, state_at=place)
        status, read = other.read_state(first.serialise(state))
        assert (status, other.restore(read)) == (OK, OK)
        branch, _ = _fmu_rows(other, name, names, steps, period, first=place)
        assert np.array_equal(branch, rows[place:]), place


def test_several_instances_do_not_know_each_other(component, exported):
    names = exported("torino-rotary", "low", "3.0")[0].document.signals
    alone = component()
    alone.begin()
    expected, _ = _fmu_rows(alone, "torino-rotary", names, 40, 2e-3)
    one, two = component(), component()
    one.begin()
    two.begin(seed=5, **{"motor.inertia": 2e-3})
    two.set(command=-0.1)
    rows = []
    for k in range(40):
        _act = {0: {"command": 0.05}, 10: {"output": 2.0},
                20: {"fault.friction.transmission": 1.5}}.get(k, {})  # fmt: skip
        one.set(**_act)
        two.step(k * 2e-3, 2e-3)
        one.step(k * 2e-3, 2e-3)
        rows.append(one.outputs(names))
    assert np.array_equal(rows, expected)
    assert two.outputs(names) != rows[-1]


@pytest.mark.parametrize("version", VERSIONS)
def test_parameters_are_those_of_an_actuator_changed_likewise(component, exported, version):
    names = exported("torino-rotary", "low", version)[0].document.signals
    changed = {"motor.inertia": 1.5e-3, "gear.ratio": 480.0}
    instance = component(version=version)
    assert instance.begin(**changed) == OK
    assert instance.get(*changed) == list(changed.values())
    assert instance.get("drive.kind")[0] >= 1
    actuator = elevon.Actuator.load("torino-rotary").with_values(changed)
    session = elevon.Session(actuator, fidelity="low", signals=names)
    instance.set(command=0.05)
    session.set(command=0.05)
    for k in range(40):
        assert instance.step(k * 2e-3, 2e-3) == OK
        session.advance(2e-3)
    assert instance.outputs(names) == list(session.read(*names).values())


@pytest.mark.parametrize("version", VERSIONS)
def test_what_cannot_be_is_refused_and_logged(component, version):
    """A refused call changes nothing: the next step is that of an instance never asked."""
    instance, plain = component(version=version), component(version=version)
    kind = ctypes.c_double
    real = "Real" if version == "2.0" else "Float64"

    def refused(status, expected, text):
        assert status == expected
        assert text in instance.texts[-1][1], instance.texts[-1]

    refused(instance.step(0.0, 1e-3), ERROR, "not allowed while Instantiated")
    refused(instance.set(**{"motor.inertia": -1.0}), DISCARD, "motor.inertia")
    refused(instance.set(seed=-1), DISCARD, "seed")
    refused(instance.set(**{"drive.kind": 99}), DISCARD, "drive.kind")
    assert instance.begin() == OK
    assert plain.begin() == OK
    refused(instance.set(**{"motor.inertia": 1e-3}), ERROR, "a fixed parameter")
    refused(instance.set(command=float("nan")), ERROR, "not a number")
    refused(instance.set(command=float("inf")), ERROR, "not a number")
    refused(instance.set(**{"fault.short.motor.phase_a": 2.0}), DISCARD, "severity 2")
    refused(instance.set(ambient=-5.0), DISCARD, "ambient")
    refused(instance.set(output_position=0.0), ERROR, "no variable to set")
    refused(instance.set_raw(real, [9999], [0.0], kind), ERROR, "9999")
    refused(instance.set_raw(real, [instance.fmu.references["seed"]], [0.0], kind), ERROR, "type")
    for time, step in ((0.0, -1e-3), (0.0, 0.0), (float("nan"), 1e-3), (0.0, float("nan")),
                       (0.0, float("inf")), (-1.0, 1e-3)):  # fmt: skip
        refused(instance.step(time, step), ERROR, "DoStep")
    refused(instance.step(0.0, 1.23e-4), DISCARD, "whole number of solver steps")
    refused(instance.call("EnterInitializationMode", *([] if version == "2.0" else [
        ctypes.c_bool(False), kind(0), kind(0), ctypes.c_bool(False), kind(0)])),
        ERROR, "not allowed")  # fmt: skip
    refused(instance.call(f"Set{real}", None, ctypes.c_size_t(3), None, ctypes.c_size_t(3)),
            ERROR, "null pointer")  # fmt: skip
    for one in (instance, plain):
        one.set(command=0.05)
        assert one.step(0.0, 0.1) == OK
    assert instance.get("output_position") == plain.get("output_position")
    assert instance.call("Terminate") == OK
    refused(instance.step(0.1, 0.1), ERROR, "Terminated")
    assert instance.call("Reset") == OK
    assert instance.begin(start=2.0) == OK
    assert instance.step(2.0, 0.1) == OK
    assert instance.get("time") == pytest.approx([2.1])


@pytest.mark.parametrize("version", VERSIONS)
def test_contradicting_faults_are_refused_together(component, version):
    instance = component(fidelity="high", version=version)
    assert instance.begin() == OK
    assert instance.set(**{"fault.short.motor.phase_a": 0.2}) == OK
    assert instance.set(**{"fault.open_phase.motor.phase_a": 1.0}) == DISCARD
    assert "contradict" in instance.texts[-1][1]
    assert instance.get("fault.open_phase.motor.phase_a") == [0.0]


@pytest.mark.parametrize("version", VERSIONS)
def test_an_fmu_that_is_damaged_or_another_is_not_instantiated(exported, tmp_path, version):
    _, fmu = exported("torino-rotary", "low", version)
    good = (fmu.folder / "resources" / "elevon.json").read_text("utf-8")
    texts = {
        "another token": (good, "token"),
        "none": (None, "elevon.json"),
        "empty": ("", "value expected"),
        "half": (good[: len(good) // 2], "expected"),
        "not UTF-8": (b"\xff\xfe", "UTF-8"),
        "another schema": (good.replace('"schema":1', '"schema":7'), "schema 7"),
        "another wiring": (good.replace('"rotary"', '"winged"'), "winged"),
        "a parameter too few": (good.replace('"parameters":[', '"parameters":[1.0,'), "expected"),
        "NaN": (good.replace('"seed":0', '"seed":NaN'), "value expected"),
        "deep": ("[" * 100000, "nesting"),
    }
    for case, (text, reason) in texts.items():
        folder = tmp_path / case.replace(" ", "_")
        folder.mkdir()
        if text is not None:
            data = text if isinstance(text, bytes) else text.encode()
            (folder / "elevon.json").write_bytes(data)
        place = (folder.as_uri() if fmu.two else str(folder)).encode()
        token = "other" if case == "another token" else None
        bad = Component(fmu, token=token, resources=place)
        assert not bad.handle, case
        assert reason in bad.texts[0][1], (case, bad.texts)


def test_two_threads_on_one_instance_exclude_each_other(component):
    instance = component(fidelity="high")
    assert instance.begin() == OK
    instance.set(command=0.05)
    done = []
    long = threading.Thread(target=lambda: done.append(instance.step(0.0, 1.0)))
    long.start()
    statuses = set()
    while long.is_alive():
        statuses.add(instance.get_raw("Float64", ctypes.c_double, [0])[0])
    long.join()
    assert done == [OK]
    assert ERROR in statuses
    assert "another thread" in instance.texts[0][1]
    assert instance.get("time") == [1.0]


def test_an_export_is_the_same_file_again(tmp_path):
    one, two = (
        export_fmu("torino-rotary", tmp_path / n, fidelity="low") for n in ("a.fmu", "b.fmu")
    )
    assert one.path.read_bytes() == two.path.read_bytes()
    with zipfile.ZipFile(one.path) as file:
        assert {"modelDescription.xml", "resources/elevon.json"} <= set(file.namelist())


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"version": "2.1"}, UnknownNameError, "2.0"),
        ({"version": "1.0"}, UnknownNameError, "3.0"),
        ({"platform": "x86_64-windows"}, InputError, "this installation"),
        ({"step": "1.3 us", "fidelity": "high"}, InputError, "solver steps"),
        ({"step": "-1 ms"}, InputError, "solver steps"),
        ({"step": "nan"}, InputError, "step"),
        ({"signals": "motr_speed"}, UnknownNameError, "motor_speed"),
        ({"mode": "postion"}, UnknownNameError, "position"),
        ({"fidelity": "medium"}, UnknownNameError, "high"),
    ],
)
def test_what_cannot_be_exported_is_named(tmp_path, options, error, text):
    with pytest.raises(error, match=text):
        export_fmu("torino-rotary", tmp_path / "a.fmu", **options)
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_no_fmus_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"\.fmu"):
        export_fmu("torino-rotary", tmp_path / "a.zip")


def test_signals_are_the_drive_logs_and_those_asked_for():
    plain = run_document("torino-rotary")
    more = run_document("torino-rotary", signals=["currents", "output_speed"])
    assert {"encoder_position", "current_q_meas", "output_position"} <= set(plain.signals)
    assert set(more.signals) - set(plain.signals) == {
        "current_a", "current_b", "current_c", "output_speed"}  # fmt: skip
    assert "command" not in plain.signals


def test_unpacking_names_the_platform(exported):
    for version, pattern in (("2.0", "64"), ("3.0", "-")):
        _, fmu = exported("torino-rotary", "low", version)
        (binary,) = (name for name in fmu.names if name.startswith("binaries/"))
        assert pattern in binary.split("/")[1]
    assert isinstance(fmu, Fmu)
