"""The reader of MATLAB version 5 files: what it decodes, what it never touches, where it stops."""

import contextlib
import struct
import zlib

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import given
from hypothesis import strategies as st

from elevon.containers.mat5 import variables
from elevon.errors import FormatError
from elevon.logs.formats.table import Limits
from elevon.logs.formats.vectors import has_variable, read_matlab

TYPES = ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"]


def free(_size):
    """No bound."""


def bound(most):
    def check(size):
        if size > most:
            raise FormatError(f"{size} bytes")

    return check


def read(path, check=free):
    return {variable.name: variable for variable in variables(path, check)}


def header(order="<"):
    mark = b"IM" if order == "<" else b"MI"
    return b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}H", 0x0100) + mark


def element(kind, data, order="<"):
    return struct.pack(f"{order}II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def array(name, shape, content, *, kind=6, order="<"):
    """An array of any class: its heading, then what it holds."""
    body = element(6, struct.pack(f"{order}II", kind, 0), order)
    body += element(5, struct.pack(f"{order}{len(shape)}i", *shape), order)
    return element(14, body + element(1, name, order) + content, order)


def packed(data, length=None):
    """A compressed variable, which may lie about its length."""
    if length is not None:
        data = data[:4] + struct.pack("<I", length) + data[8:]
    small = zlib.compress(data)
    return struct.pack("<II", 15, len(small)) + small


@pytest.mark.parametrize("compressed", [False, True])
def test_numbers_of_every_type_as_scipy_reads_them(tmp_path, compressed):
    chance = np.random.default_rng(0)
    content = {f"a_{t}": (1e2 * chance.random((3, 4))).astype(t) for t in TYPES}
    content |= {"empty": np.empty((0, 3)), "one": 2.5, "long": np.arange(1e4), "yes": True}
    scipy.io.savemat(tmp_path / "a.mat", content, do_compression=compressed)
    oracle = scipy.io.loadmat(tmp_path / "a.mat")
    found = read(tmp_path / "a.mat")
    assert found.keys() == content.keys()
    for name, variable in found.items():
        assert variable.kind == "numbers"
        assert variable.shape == oracle[name].shape
        np.testing.assert_array_equal(
            variable.numbers(), oracle[name].astype(np.float64).ravel(order="F")
        )


def test_the_other_byte_order(tmp_path):
    values = struct.pack(">3d", 1.5, -2.0, 1e300)
    (tmp_path / "a.mat").write_bytes(
        header(">") + array(b"x", (3, 1), element(9, values, ">"), order=">")
    )
    assert read(tmp_path / "a.mat")["x"].numbers().tolist() == [1.5, -2.0, 1e300]


def test_texts_and_structs(tmp_path):
    content = {"word": "Größe", "run": {"t": np.arange(3.0), "name": "x", "none": np.empty((0, 0))}}
    scipy.io.savemat(tmp_path / "a.mat", content)
    found = read(tmp_path / "a.mat")
    assert found["word"].text() == "Größe"
    fields = {field.name: field for field in found["run"].fields()}
    assert fields["t"].numbers().tolist() == [0.0, 1.0, 2.0]
    assert fields["name"].text() == "x"
    assert fields["none"].count == 0
    with pytest.raises(FormatError, match=r"'word': is of kind text, not numbers"):
        found["word"].numbers()
    with pytest.raises(FormatError, match="not struct"):
        list(fields["t"].fields())


def test_other_kinds_are_told_and_never_decoded(tmp_path):
    cell = np.empty(2, dtype=object)
    cell[:] = [np.zeros(3), "x"]
    rows = np.zeros(2, dtype=[("a", object)])
    content = {"cell": cell, "sparse": scipy.sparse.eye(3).tocsc(), "z": 1j * np.ones(3)}
    scipy.io.savemat(tmp_path / "a.mat", content | {"rows": rows})
    found = read(tmp_path / "a.mat")
    assert {name: v.kind for name, v in found.items()} == {
        "cell": "cell", "sparse": "sparse", "z": "numbers", "rows": "struct",
    }  # fmt: skip
    assert found["z"].is_complex
    with pytest.raises(FormatError, match="arrays of structures"):
        list(found["rows"].fields())
    for name in ("cell", "sparse"):
        for decode in (found[name].numbers, found[name].text):
            with pytest.raises(FormatError, match="is of kind"):
                decode()


def test_objects_and_what_they_keep_beside_the_variables_hold_nothing(tmp_path):
    opaque = element(6, struct.pack("<II", 17, 0)) + element(1, b"obj") + element(1, b"MCOS")
    junk = element(2, b"\x80\x04cposix\nsystem\n")
    (tmp_path / "a.mat").write_bytes(
        header() + element(14, opaque + junk) + array(b"old", (1, 1), junk, kind=3)
        + array(b"", (1, 16), junk, kind=9) + array(b"f", (1, 1), junk, kind=16)
    )  # fmt: skip
    found = list(variables(tmp_path / "a.mat", free))
    assert [v.kind for v in found] == ["opaque object", "object", "opaque object", "function"]
    for variable in found:
        with pytest.raises(FormatError, match="is of kind"):
            variable.numbers()
    with pytest.raises(FormatError, match="no vector"):
        read_matlab(tmp_path / "a.mat")


def test_the_bound_is_on_all_variables_together(tmp_path):
    scipy.io.savemat(
        tmp_path / "a.mat", {f"x{k}": np.zeros(1000) for k in range(5)}, do_compression=True
    )
    assert (tmp_path / "a.mat").stat().st_size < 1000
    assert len(read(tmp_path / "a.mat", bound(50_000))) == 5
    with pytest.raises(FormatError, match="bytes"):
        read(tmp_path / "a.mat", bound(30_000))
    with pytest.raises(FormatError, match="over the limit"):
        read_matlab(tmp_path / "a.mat", limits=Limits(values=3000))
    assert not has_variable(tmp_path / "a.mat", "x4", Limits(values=3000))
    assert has_variable(tmp_path / "a.mat", "x4", Limits(values=8000))
    assert has_variable(tmp_path / "a.mat", "x0", Limits(values=3000))


def test_a_bomb_is_refused_whatever_it_declares(tmp_path):
    """An honest length is over the bound, a small one is passed, a large one is not reached."""
    whole = array(b"x", (1, 2_000_000), element(9, bytes(16_000_000)))
    path = tmp_path / "a.mat"
    for length, message in ((None, "bytes"), (16, "more than it declares"), (2**20, "more than")):
        path.write_bytes(header() + packed(whole, length))
        with pytest.raises(FormatError, match=message):
            read(path, bound(2**21))
    path.write_bytes(header() + packed(whole[:1000], 10_000))
    with pytest.raises(FormatError, match="cut off"):
        read(path, bound(2**21))


VALUES = element(9, struct.pack("<2d", 1.0, 2.0))
DAMAGED = {
    "another element at the top": (element(9, bytes(16)), "type 9 stands"),
    "packed twice": (packed(packed(array(b"x", (1, 2), VALUES))), "type 15 stands"),
    "cut": (array(b"x", (1, 2), VALUES)[:-8], "cut off"),
    "half a tag": (array(b"x", (1, 2), VALUES) + b"\x0e\0\0\0", "cut off"),
    "negative size": (array(b"x", (1, -2), VALUES), "no size"),
    "one size": (array(b"x", (2,), VALUES), "no size"),
    "fifty sizes": (array(b"x", (1,) * 50, VALUES), "no size"),
    "unknown class": (array(b"x", (1, 2), VALUES, kind=99), "class 99"),
    "more declared": (array(b"x", (2, 2), VALUES), "4 numbers declared, 16 bytes stored"),
    "unknown storage": (array(b"x", (1, 2), element(8, bytes(16))), "stored as type 8"),
    "wide field names": (
        array(b"x", (1, 1), element(5, struct.pack("<i", 65)) + element(1, b"a" * 65), kind=2),
        "width 65",
    ),
    "negative width": (
        array(b"x", (1, 1), element(5, struct.pack("<i", -8)) + element(1, b"a" * 8), kind=2),
        "width -8",
    ),
    "long short element": (element(14, struct.pack("<II", 5 << 16 | 6, 0) + bytes(8)), "5 bytes"),
    "text of another code": (array(b"x", (1, 1), element(16, b"\xff"), kind=4), "not utf-8"),
}


@pytest.mark.parametrize(("content", "message"), DAMAGED.values(), ids=DAMAGED.keys())
def test_damage_is_named(tmp_path, content, message):
    path = tmp_path / "a.mat"
    path.write_bytes(header() + content)
    with pytest.raises(FormatError, match=message) as caught:
        for variable in variables(path, free):
            decode(variable)
    assert str(path) in str(caught.value)


def decode(variable):
    if variable.kind == "numbers":
        assert variable.numbers().shape == (variable.count,)
    elif variable.kind == "text":
        variable.text()
    elif variable.kind == "struct":
        for field in variable.fields():
            decode(field)


def test_too_many_variables(tmp_path):
    (tmp_path / "a.mat").write_bytes(header() + 513 * array(b"x", (1, 2), VALUES))
    with pytest.raises(FormatError, match="more than 512 variables"):
        list(variables(tmp_path / "a.mat", free))


@pytest.mark.parametrize("head", [b"", b"MATLAB 5.0", bytes(128), header()[:126] + b"XX"])
def test_other_files_are_told(tmp_path, head):
    (tmp_path / "a.mat").write_bytes(head)
    with pytest.raises(FormatError, match="is not a MATLAB version 5 file"):
        list(variables(tmp_path / "a.mat", free))


def test_an_unknown_version_is_told(tmp_path):
    (tmp_path / "a.mat").write_bytes(header()[:124] + b"\x00\x03IM")
    with pytest.raises(FormatError, match="unknown version 0x0300"):
        list(variables(tmp_path / "a.mat", free))


@given(
    content=st.lists(
        st.binary(max_size=40)
        | st.builds(element, st.integers(0, 20), st.binary(max_size=40))
        | st.builds(
            array,
            st.binary(max_size=3),
            st.lists(st.integers(-1, 4), max_size=3),
            st.builds(element, st.integers(0, 20), st.binary(max_size=40)),
            kind=st.integers(0, 20),
        ),
        max_size=4,
    ),
    compressed=st.booleans(),
)
def test_any_chain_of_elements_is_read_or_refused(tmp_path_factory, content, compressed):
    path = tmp_path_factory.getbasetemp() / "any.mat"
    parts = [packed(part) if compressed and len(part) >= 8 else part for part in content]
    path.write_bytes(header() + b"".join(parts))
    with contextlib.suppress(FormatError):
        for variable in variables(path, bound(2**16)):
            decode(variable)
