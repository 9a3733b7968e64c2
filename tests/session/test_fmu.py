"""Foreign FMUs beside a session: a PI controller and a load made of C, without any headers."""

import math
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon.errors import (
    ArgumentTypeError,
    ForeignModelError,
    FormatError,
    InputError,
    UnknownNameError,
)
from elevon.session import fmu

fmpy = pytest.importorskip("fmpy")
HERE = Path(__file__).resolve().parents[2] / "examples" / "foreign-fmu"
UNIT = "torino-rotary"
JOINED = {"speed": "motor_speed", "reference": 200.0, "torque": "command"}  # rev/min


def packed(path, *, source=lambda c: c, text=lambda xml: xml, binary=True):
    """The FMU of the C source of the example, with changes."""
    code, library = path.with_suffix(".c"), path.with_suffix(".so")
    code.write_text(source((HERE / "pi.c").read_text()))
    options = ["-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["cc", *options, "-o", library, code, "-lm"], check=True)
    with zipfile.ZipFile(path, "w") as out:
        out.writestr("modelDescription.xml", text((HERE / "modelDescription.xml").read_text()))
        out.writestr("resources/none.txt", "")
        if binary:
            out.write(library, f"binaries/{fmpy.platform}/pi{fmpy.sharedLibraryExtension}")
    return path


@pytest.fixture(scope="module")
def pi(tmp_path_factory):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    return packed(tmp_path_factory.mktemp("fmu") / "pi.fmu")


def session(pi, mapping=JOINED, actuator=UNIT, mode="torque", **kind):
    controller = elevon.Fmu(pi, mapping, trust=True, **kind)
    return elevon.Session(actuator, fidelity="low", mode=mode, controller=controller), controller


class Pi:
    """The same controller in Python."""

    def __init__(self, kp=0.05, ki=1.0, limit=5.0):
        self.kp, self.ki, self.limit, self.integral = kp, ki, limit, 0.0

    def __call__(self, now):
        error = math.pi / 30.0 * 200.0 - now["motor_speed"]
        self.integral += self.ki * error * 1e-3
        return float(np.clip(self.kp * error + self.integral, -self.limit, self.limit))


def test_a_foreign_controller_does_what_the_same_one_in_python_does(pi):
    foreign, _ = session(pi)
    (got,) = foreign.run("300 ms", record=["motor_speed", "motor_torque", "command"])
    python = elevon.Session(UNIT, fidelity="low", mode="torque")
    (expected,) = python.run("300 ms", Pi(), record=["motor_speed", "motor_torque", "command"])
    for name in ("motor_speed", "motor_torque"):
        # Both compute in doubles; a compiler may join a product and a sum.
        np.testing.assert_allclose(got[name].values, expected[name].values, rtol=1e-9, atol=1e-9)
    assert got["motor_speed"].values[-1] == pytest.approx(200.0 * math.pi / 30.0, rel=0.05)


@pytest.mark.parametrize("steps", ["0.5 ms", "1 ms", "7 ms"])
def test_ticks_are_its_own_whatever_the_callers_steps(pi, steps):
    whole, _ = session(pi)
    whole.advance("42 ms")
    cut, _ = session(pi)
    while cut.time < 0.042 - 1e-9:
        cut.advance(steps)
    assert cut["motor_speed"] == whole["motor_speed"]


def test_parameters_period_and_what_is_set_on_the_way(pi):
    slow, controller = session(pi, parameters={"kp": 0.0, "ki": 0.0}, period="2 ms")
    slow.advance("20 ms")
    assert slow["motor_speed"] == 0.0
    assert "each 0.002 s" in repr(controller)
    live, controller = session(pi)
    live.advance("300 ms")
    controller.set(reference=lambda now: -100.0 if now.time < 10.0 else 0.0)
    live.advance("400 ms")
    assert live["motor_speed"] == pytest.approx(-100.0 * math.pi / 30.0, rel=0.05)


def test_many_runs_have_an_instance_each(pi):
    pull = {"output": {"terms": [{"kind": "constant", "value": "20 N m"}]}}
    runs = [
        elevon.Run(UNIT, {"duration": 1, "command": {"mode": "torque"}, "load": load})
        for load in ({}, pull)
    ]
    both = elevon.Session(runs, fidelity="low", controller=elevon.Fmu(pi, JOINED, trust=True))
    both.advance("100 ms")
    for run, speed in zip(runs, both["motor_speed"], strict=True):
        alone = elevon.Session([run], fidelity="low", controller=elevon.Fmu(pi, JOINED, trust=True))
        alone.advance("100 ms")
        assert alone["motor_speed"][0] == speed
    assert both["motor_speed"][0] != both["motor_speed"][1]


def test_a_foreign_load_acts_with_what_it_had_put_out_at_the_tick(pi):
    load = elevon.Fmu(
        pi, {"speed": "motor_speed", "torque": "output"}, parameters={"kp": -0.5}, trust=True
    )
    loaded = elevon.Session(UNIT, fidelity="low", mode="speed", loads=[load])
    loaded.set(command="100 rpm")
    python = elevon.Session(UNIT, fidelity="low", mode="speed")
    python.set(command="100 rpm")
    torque = integral = 0.0
    for _ in range(100):
        python.set(output=torque)
        speed = python["motor_speed"]
        integral -= speed * 1e-3
        torque = float(np.clip(0.5 * speed + integral, -5.0, 5.0))
        python.advance("1 ms")
    loaded.advance("100 ms")
    assert loaded["motor_speed"] == pytest.approx(python["motor_speed"], rel=1e-9)
    free = elevon.Session(UNIT, fidelity="low", mode="speed")
    free.set(command="100 rpm")
    free.advance("100 ms")
    assert loaded["motor_speed"] != free["motor_speed"]


@pytest.mark.parametrize(
    ("mapping", "kind", "words"),
    [
        ({"torqe": "command"}, UnknownNameError, "did you mean 'torque'"),
        ({"torque": "comand"}, UnknownNameError, "did you mean 'command'"),
        ({"torque": "command", "speed": "motor_sped"}, UnknownNameError, "motor_speed"),
        ({"torque": "command", "speed": "motor_torque"}, InputError, "'rad/s' is of another kind"),
        ({"torque": "supply"}, InputError, "'N.m' is of another kind than V"),
        ({"torque": "command", "kp": 1.0}, InputError, "kp is parameter"),
        ({"speed": "motor_speed"}, InputError, "joins none of its outputs"),
        ("speed", ArgumentTypeError, "no mapping"),
    ],
)
def test_a_mapping_that_does_not_fit_is_refused(pi, mapping, kind, words):
    with pytest.raises(kind, match=words):
        session(pi, mapping)


def test_what_else_does_not_fit_is_refused(pi):
    for parameters, words in (
        ({"kpp": 1}, "did you mean 'kp'"),
        ({"torque": 1}, "torque is output, no parameter"),
        ({"kp": "fast"}, "not of the type Real"),
        ({"kp": math.nan}, "must be finite"),
    ):
        with pytest.raises(InputError, match=words):
            elevon.Fmu(pi, JOINED, trust=True, parameters=parameters)
    with pytest.raises(InputError, match="no whole number of solver steps"):
        session(pi, period=1.00001e-3)
    with pytest.raises(InputError, match="above 0"):
        session(pi, period=0.0)
    with pytest.raises(ArgumentTypeError, match=r"no elevon\.Fmu"):
        elevon.Session(UNIT, fidelity="low", loads=[Pi()])
    taken, controller = session(pi)
    with pytest.raises(InputError, match="belongs to a session already"):
        elevon.Session(UNIT, fidelity="low", mode="torque", controller=controller)
    with pytest.raises(InputError, match="no part of the session's"):
        taken.save()
    alone = elevon.Session(UNIT, fidelity="low", mode="torque")
    with pytest.raises(InputError, match="another kind"):
        taken.restore(alone.save())
    with pytest.raises(InputError, match="two outputs of FMUs"):
        elevon.Session(
            UNIT,
            fidelity="low",
            mode="torque",
            controller=elevon.Fmu(pi, JOINED, trust=True),
            loads=[elevon.Fmu(pi, {"torque": "command"}, trust=True)],
        )
    controller.set(speed=1.0)
    for changed, words in (
        ({"speed": "motor_speed"}, "before the session"),
        ({"torque": 1.0}, "is an output"),
        ({"sped": 1.0}, "did you mean"),
    ):
        with pytest.raises(InputError, match=words):
            controller.set(**changed)


def test_what_the_fmu_refuses_is_quoted_and_the_session_stands(pi):
    live, controller = session(pi, {**JOINED, "trips": False})
    live.advance("3 ms")
    controller.set(trips=True)
    with pytest.raises(ForeignModelError, match=r"step from 0\.003 s .*error.*the drive tripped"):
        live.advance("5 ms")
    assert live.time == pytest.approx(0.003)
    controller.set(trips=0.5, reference=math.inf)
    with pytest.raises(InputError, match="must be finite"):
        live.advance("1 ms")


def test_what_it_puts_out_must_be_a_number(pi, tmp_path):
    broken = packed(
        tmp_path / "broken.fmu",
        source=lambda c: c.replace("p->steps++;", "if (++p->steps > 2) p->r[2] = NAN;"),
    )
    live, _ = session(broken)
    with pytest.raises(ForeignModelError, match="torque = nan"):
        live.advance("10 ms")
    assert live.time == pytest.approx(0.002)


def test_without_trust_nothing_is_loaded(pi, monkeypatch):
    """An FMU is a program: neither its library nor its folder is touched."""
    monkeypatch.setattr(fmu, "FmuInstance", None)
    for given in ({}, {"trust": False}, {"trust": "yes"}):
        with pytest.raises(InputError, match=r"is a program.*trust=True"):
            elevon.Fmu(pi, JOINED, **given)


def test_files_that_are_none_are_refused(pi, tmp_path):
    text = (HERE / "modelDescription.xml").read_text()
    file = tmp_path / "x.fmu"
    with pytest.raises(InputError, match="no such file"):
        elevon.Fmu(file, JOINED)
    for data in (b"", b"PK\x03\x04" + b"x" * 50, pi.read_bytes()[:3000]):
        file.write_bytes(data)
        with pytest.raises(FormatError, match="is no FMU"):
            elevon.Fmu(file, JOINED)
    for change, kind, words in (
        (lambda t: t.replace('fmiVersion="2.0"', 'fmiVersion="1.0"'), InputError, "FMI 1|no FMU"),
        (lambda t: t.replace("CoSimulation", "ModelExchange"), InputError, "co-simulation|no FMU"),
        (lambda t: t[: len(text) // 2], FormatError, "is no FMU"),
    ):
        with pytest.raises(kind, match=words):
            elevon.Fmu(packed(file, text=change), JOINED)
    with pytest.raises(InputError, match="no binary for"):
        elevon.Fmu(packed(file, binary=False), JOINED)
    foreign = packed(file, text=lambda t: t.replace('guid="{pi}"', 'guid="{other}"'))
    with pytest.raises(ForeignModelError, match="instantiate"):
        session(foreign)
    lacks = packed(file, source=lambda c: c.replace("int fmi2DoStep", "int fmi2Step"))
    with pytest.raises(ForeignModelError, match="load"):
        session(lacks)


def test_the_examples_run(tmp_path):
    """The controller on a session, then on the actuator as an FMU, which runs the first one too."""
    done = subprocess.run(
        [sys.executable, "-W", "error", HERE / "plant.py"],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first.endswith(" rpm of 200")
    assert float(first.split()[0]) == pytest.approx(200.0, rel=0.05)
    assert second == f"plant.fmu: {first}; the same bits as the session"


def test_without_fmpy_the_message_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(InputError, match=r"extra elevon\[fmu\], .*pip install"):
        elevon.Fmu("pi.fmu", JOINED)
