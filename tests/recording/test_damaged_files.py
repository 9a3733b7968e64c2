"""Disks that fail and files that are damaged: a clear error, never half a recording."""

import json
import os
import random
import signal
import subprocess
import sys
import textwrap
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elevon import Recording
from elevon.errors import (
    FormatError,
    UncheckedWarning,
)
from tests.recording.make import ALL, one_clock, ordinary


@pytest.mark.parametrize("ending", ALL)
def test_kill_9_in_the_middle_of_a_save_leaves_no_half_file(tmp_path, ending):
    """The saver is killed at random instants while it replaces a good file again and again."""
    path = tmp_path / f"a{ending}"
    one_clock().save(path)
    program = textwrap.dedent(
        """
        import sys, numpy as np
        from elevon import Recording
        n = 50_000
        big = Recording.build(np.arange(n), {"x": np.sin(np.arange(n))}, {"x": "rad"})
        big.save(sys.argv[1], force=True)
        print("saving", flush=True)
        while True:
            big.save(sys.argv[1], force=True)
        """
    )
    chance = random.Random(ending)
    process = subprocess.Popen([sys.executable, "-c", program, str(path)], stdout=subprocess.PIPE)
    with process:
        assert process.stdout.readline() == b"saving\n"
        try:
            process.wait(chance.uniform(0.05, 0.3))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert len(Recording.load(path)["x"]) == 50_000


@pytest.mark.parametrize("ending", ALL)
def test_a_full_disk_leaves_the_old_file(tmp_path, ending):
    """A limit on the file size stands in for the full disk."""
    path = one_clock().save(tmp_path / f"a{ending}")
    before = path.read_bytes()
    program = textwrap.dedent(
        """
        import resource, signal, sys, numpy as np
        from elevon import Recording
        from elevon.errors import OutputError
        x = np.random.default_rng(0).normal(size=50_000)
        big = Recording.build(np.arange(x.size), {"x": x}, {"x": "rad"})
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))
        try:
            big.save(sys.argv[1], force=True)
        except OutputError:
            sys.exit(42)
        """
    )
    assert subprocess.run([sys.executable, "-c", program, str(path)], check=False).returncode == 42
    assert path.read_bytes() == before
    left = {entry.name for entry in tmp_path.iterdir()}
    assert left == {path.name, *([f"{path.name}.json"] if ending == ".csv" else [])}
    assert Recording.load(path).equals(one_clock())


@pytest.mark.parametrize("ending", ALL)
def test_too_large_for_the_limit(tmp_path, ending):
    path = ordinary().select(clock="drive").save(tmp_path / f"a{ending}")
    with pytest.raises(FormatError, match=r"the limit is 0 MiB"):
        Recording.load(path, max_bytes=4000)


@pytest.mark.parametrize("ending", ALL)
@pytest.mark.parametrize(
    "content", [b"", b"\0" * 200, b"hello\n", b"PAR1" * 50, b"\x89HDF\r\n\x1a\n"]
)
def test_another_content_is_a_clear_error(tmp_path, ending, content):
    path = tmp_path / f"a{ending}"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=rf"a\{ending}"):
        Recording.load(path)


@pytest.mark.parametrize("ending", ALL)
@given(data=st.data())
@settings(max_examples=60)
def test_damaged_files_are_a_clear_error_or_the_same_recording(tmp_path_factory, ending, data):
    """Cut short or with bytes changed: never another exception, never a crash."""
    path = tmp_path_factory.mktemp("damaged") / f"a{ending}"
    content = bytearray(one_clock().save(path).read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        for _ in range(data.draw(st.integers(1, 4))):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    whole = one_clock()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UncheckedWarning)
            loaded = Recording.load(path, max_bytes=2**26)
    except FormatError as error:
        assert str(path) in str(error)  # noqa: PT017
        return
    assert loaded.equals(whole) or (loaded.meta, bits(loaded)) == (whole.meta, bits(whole))


def bits(recording):
    """The values, every NaN as one: not all formats keep its payload, so no checksum has it."""
    return {
        name: np.where(np.isnan(recording[name].values), np.nan, recording[name].values).tobytes()
        for name in recording
    }


@given(data=st.data())
@settings(max_examples=60)
def test_a_damaged_file_beside_is_a_clear_error_or_the_same(tmp_path_factory, data):
    path = one_clock().save(tmp_path_factory.mktemp("damaged") / "a.csv")
    near = path.with_name("a.csv.json")
    content = bytearray(near.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    near.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    try:
        loaded = Recording.load(path)
    except FormatError as error:
        assert str(path) in str(error)  # noqa: PT017
        return
    assert loaded.equals(one_clock())


def _header(path):
    return json.loads(path.with_name(f"{path.name}.json").read_text())["recording"]


def _with_header(path, header):
    near = path.with_name(f"{path.name}.json")
    near.write_text(json.dumps({**json.loads(near.read_text()), "recording": header}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda h: h.update(schema=1), "layout has version 1, this Elevon reads version 2 and 3"),
        (lambda h: h.pop("clocks"), "damaged"),
        (lambda h: h.update(clocks=[]), "describes 0 clocks"),
        (lambda h: h["clocks"][0].update(samples=4), "holds 5 of 4"),
        (lambda h: h["clocks"][0].update(samples="5"), "integers"),
        (lambda h: h["clocks"][0].update(samples=10**15), "the limit is"),
        (lambda h: h["clocks"][0].update(gaps=[17]), "gap indices"),
        (lambda h: h["clocks"][0].update(rate="fast"), "fast"),
        (lambda h: h["clocks"][0].update(name="../x"), "clock '../x'"),
        (lambda h: h["clocks"][0]["channels"][0].update(unit="rad"), "do not agree"),
        (lambda h: h["clocks"][0]["channels"][0].update(name="forces"), "do not agree"),
        (lambda h: h["clocks"][0]["channels"][0].update(text="another"), "SHA-256"),
        (lambda h: h["meta"].update(seed=9), "SHA-256"),
        (lambda h: h.pop("sha256"), "damaged"),
        (lambda h: h["clocks"][0]["channels"].append(dict(h["clocks"][0]["channels"][0])), "once"),
    ],
)
def test_a_description_that_lies_is_found_out(tmp_path, change, message):
    path = one_clock().save(tmp_path / "a.csv")
    header = _header(path)
    change(header)
    _with_header(path, header)
    with pytest.raises(FormatError, match=message):
        Recording.load(path)


def test_deeply_nested_descriptions_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    one_clock().save(path)
    path.with_name("a.csv.json").write_text("[" * 1_000_000)
    with pytest.raises(FormatError, match="damaged"):
        Recording.load(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
def test_an_unreadable_file_is_a_clear_error(tmp_path):
    path = one_clock().save(tmp_path / "a.csv")
    path.chmod(0)
    with pytest.raises(FormatError, match="cannot be read"):
        Recording.load(path)
