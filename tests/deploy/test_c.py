"""The C interface: bits of a session, no heap once made, refusals with a code and a text."""

import os
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon.deploy import run_document
from elevon.deploy.fmu import library
from tests.deploy.driver import CRun

ROOT = Path(__file__).resolve().parents[2]
HEADERS = ROOT / "crates" / "elevon-capi" / "include"
ARGUMENT, RANGE, STEP, STATE, DOCUMENT, BUSY = -1, -2, -3, -5, -6, -7
FAULT = "friction@transmission"
CASES = [
    ("torino-rotary", FAULT, 1.5),
    ("torino-rotary", "short@motor.phase_a", 0.3),
    ("nasa-ballscrew", FAULT, 1.5),
    ("pisa-landing-gear", "friction_growth@screw", 900.0),
]


@pytest.fixture(scope="module")
def static():
    """The static library of the build whose shared one is installed; None where there is none."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return target / "release" / "libelevon.a"


@pytest.fixture
def low():
    document = run_document("torino-rotary", fidelity="low")
    run = CRun(library(), document.text([FAULT]))
    assert run.code == 0, run.reason
    yield run, document
    run.free()


def test_a_run_gives_the_bits_of_a_session(low):
    run, document = low
    session = elevon.Session(
        "torino-rotary", fidelity="low", faults=[FAULT], signals=document.signals
    )
    run.set_input("command", 0.05)
    session.set(command=0.05)
    states = []
    for k in range(60):
        if k == 20:
            assert run.set_fault(FAULT, 1.5) == 0
            session.set_fault(FAULT, 1.5)
        if k == 30:
            states.append(run.save())
        assert run.step(2e-3) == 0
        session.advance(2e-3)
        assert run.read() == list(session.read(*document.signals).values())
    end = run.read()
    assert run.restore(states[0]) == 0
    for _ in range(30):
        run.step(2e-3)
    assert run.read() == end


def test_what_cannot_be_has_a_code_and_a_text(low):
    run, document = low
    assert run.set_input("command", float("nan")) == ARGUMENT
    assert "not a number" in run.message()
    assert run.set_input("ambient", -1.0) == RANGE
    assert run.set_fault(FAULT, -1.0) == RANGE
    for seconds in (0.0, -1.0, 1e-4, float("nan"), float("inf"), 1e300):
        assert run.step(seconds) == STEP
    assert run.call("set_input", 99, 0) == ARGUMENT
    assert run.lib.elevon_step(None, 0) == ARGUMENT
    good = run.save()
    other = CRun(library(), run_document("nasa-ballscrew", fidelity="low").text())
    for bad in (good[:-1], good[:-1] + b"\0\1"[good[-1] == 0 :][:1], b"", other.save()):
        assert run.restore(bad) == STATE
    other.free()
    assert run.restore(good) == 0
    refused = CRun(library(), document.text().replace('"low"', '"medium"'))
    assert (refused.code, bool(refused.run)) == (DOCUMENT, False)
    assert "medium" in refused.reason
    for code in (*range(-8, 3), 99):
        assert run.lib.elevon_code_text(code)


def test_a_second_thread_is_told_that_the_run_is_busy():
    run = CRun(library(), run_document("torino-rotary").text())
    long = threading.Thread(target=lambda: run.step(1.0))
    long.start()
    codes = set()
    while long.is_alive():
        codes.add(run.call("set_input", 0, 0))
    long.join()
    run.free()
    assert BUSY in codes


def test_the_header_is_that_of_the_source(tmp_path):
    """Every exported function is declared; where cbindgen is, it writes the same header."""
    source = (ROOT / "crates/elevon-capi/src/c.rs").read_text("utf-8")
    header = (HEADERS / "elevon.h").read_text("utf-8")
    names = [line.split("fn ")[1].split("(")[0] for line in source.splitlines()
             if 'extern "C" fn elevon' in line]  # fmt: skip
    assert len(names) > 10
    assert all(f"{name}(" in header for name in names)
    if shutil.which("cbindgen"):
        made = tmp_path / "elevon.h"
        config = ROOT / "crates/elevon-capi/cbindgen.toml"
        words = ["cbindgen", "--quiet", "--config", config, ROOT / "crates/elevon-capi/src/c.rs"]
        subprocess.run([*words, "--output", made], check=True)
        assert made.read_text("utf-8") == header


def _compiled(source, out, static):
    if not static.is_file():
        pytest.skip("the static library is not built: make capi")
    flags = ["-std=gnu99", "-O1", f"-I{HEADERS}"]
    libraries = [static, "-lpthread", "-ldl", "-lm"]
    subprocess.run(["cc", *flags, "-o", out, source, *libraries], check=True)
    return out


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="the C library's own malloc is stood before")
def test_a_run_takes_nothing_from_the_heap_once_it_is_made(static, tmp_path):
    """Inputs, an announced fault, steps, readings, states, refusals: not one call of malloc."""
    program = _compiled(Path(__file__).parent / "heap.c", tmp_path / "heap", static)
    for name, fault, severity in CASES:
        for fidelity in ("high", "low"):
            document = tmp_path / "d.json"
            document.write_text(run_document(name, fidelity=fidelity).text([fault]))
            gear = ["gear"] if name == "pisa-landing-gear" else []
            done = subprocess.run(
                [program, document, fault, str(severity), *gear],
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert done.returncode == 0, (name, fidelity, done.stdout, done.stderr)
            assert done.stdout.startswith("0 calls of the heap, 904 calls done"), done.stdout


@pytest.mark.long
def test_the_example_runs_and_is_clean_under_valgrind(static, tmp_path):
    program = _compiled(ROOT / "examples/c/example.c", tmp_path / "example", static)
    for fidelity in ("high", "low"):
        document = tmp_path / f"{fidelity}.json"
        document.write_text(run_document("torino-rotary", fidelity=fidelity).text())
        done = subprocess.run(
            [program, document, "0.1"], capture_output=True, text=True, check=True
        )
        assert "the same bits" in done.stdout
        if shutil.which("valgrind"):
            words = ["valgrind", "--error-exitcode=9", "--leak-check=full", "--quiet"]
            checked = subprocess.run([*words, program, document, "0.1"], capture_output=True,
                                     text=True, check=False)  # fmt: skip
            assert checked.returncode == 0, checked.stderr


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_random_documents_are_refused_or_run(seed):
    """A document with bytes changed at random is refused with a reason, or runs; never worse."""
    rng = np.random.default_rng(seed)
    good = run_document("torino-rotary", fidelity="low").text().encode()
    reasons = 0
    for _ in range(2000 if seed else 40):
        bad = bytearray(good)
        for _ in range(rng.integers(1, 6)):
            bad[rng.integers(len(bad))] = rng.integers(32, 127)
        if rng.random() < 0.3:
            bad = bad[: rng.integers(len(bad))]
        run = CRun(library(), bytes(bad).decode())
        assert run.code in (0, DOCUMENT)
        if run.code == 0:
            assert run.step(1e-3) != -8, run.message()
            run.free()
        else:
            reasons += bool(run.reason)
    assert reasons > 10
