"""One kind of result: written as JSON and read back equal, from its annotated fields."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
import pytest

import elevon
from elevon import results
from elevon.arrays import Floats
from elevon.errors import FormatError, OutputExistsError, UnknownNameError
from elevon.plain import REMAINDER, STORED, WORKING, Plain, in_unit, key, plain


class Point(NamedTuple):
    x: float
    y: float


@dataclass(frozen=True)
class Row(Plain):
    name: str
    ends: Annotated[tuple[float, float] | None, key("low", "high"), in_unit("m")]
    ok: bool = True

    COMPUTED: ClassVar = ("size=width",)

    @property
    def width(self):
        return None if self.ends is None else self.ends[1] - self.ends[0]


@dataclass(frozen=True)
class Made(results.Result):
    rows: tuple[Row, ...]
    way: Literal["short", "long"]
    best: Annotated[float, key("choice.best")]
    other: Annotated[float | None, key("choice.other")]
    curve: Annotated[Floats, STORED]
    places: dict[str, Point]
    seconds: Annotated[float, in_unit("s")] = field(default=0.0, compare=False)
    hand: Annotated[object, WORKING] = field(default=None, compare=False)
    facts: Annotated[dict[str, object], REMAINDER] = field(default_factory=dict)

    KIND: ClassVar = "made"
    TABLE: ClassVar = "rows"
    BARS: ClassVar = ("name", "size")


@pytest.fixture
def made(monkeypatch):
    monkeypatch.setitem(results._KINDS, "made", f"{__name__}:Made")
    rows = (Row("a", (0.0, math.inf)), Row("b", None, ok=False), Row("c", (1.0, 3.0)))
    curve = np.array([1.0, math.nan, 1e-300])
    return Made(rows, "long", 0.1, None, curve, {"p": Point(1.0, 2.0)}, 3.5, [1], {"more": [1]})


def test_saved_and_read_back_equal(made, tmp_path):
    path = made.save(tmp_path / "made.json")
    back = elevon.load(path)
    assert back == made
    assert back.seconds == 3.5
    assert back.hand is None
    assert back.facts == {"more": [1]}
    assert json.loads(path.read_text("utf-8"))["curve"][1:] == ["NaN", 1e-300]
    with pytest.raises(OutputExistsError):
        made.save(path)


def test_what_is_compared_is_what_is_written(made):
    other = Made(made.rows, "long", 0.1, None, made.curve, made.places, 9.0, [2], {"more": [1]})
    assert other == made
    assert Made(made.rows, "long", 0.1, 1.0, made.curve, made.places) != made
    assert made != "made"


def test_the_form_in_json(made):
    data = made.to_dict(stored=False)
    assert data["schema"] == "elevon/made/1"
    assert data["units"] == {"rows.low": "m", "rows.high": "m", "seconds": "s"}
    assert data["choice"] == {"best": 0.1, "other": None}
    assert data["rows"][1] == {"name": "b", "low": None, "high": None, "ok": False, "size": None}
    assert data["more"] == [1]
    assert not {"curve", "hand", "facts"} & data.keys()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"way": "wide"}, "way = 'wide' is not one of"),
        ({"rows": [{"name": "a", "low": 0.0, "high": 1.0, "okay": True}]}, "did you mean 'ok'"),
        ({"rows": [{"name": "a", "low": 0.0, "high": 1.0, "ok": 1}]}, "not true or false"),
        ({"rows": [{"low": 0.0, "high": 1.0}]}, "'name' is missing"),
        ({"choice": {"best": "0.1", "other": None}}, "best = '0.1' is not a number"),
        ({"choice": {"best": 10**400, "other": None}}, "best"),
        ({"curve": [1.0, "x"]}, "curve"),
        ({"places": {"p": {"x": 1.0}}}, "the keys must be x, y"),
        ({"schema": "elevon/made/2"}, "'elevon/made/2' is not 'elevon/made/1'"),
    ],
)
def test_a_damaged_file_is_refused(made, change, says):
    with pytest.raises(FormatError, match=says):
        Made.from_dict({**made.to_dict(), **change})


def test_what_is_no_result_is_refused(tmp_path):
    path = tmp_path / "x.json"
    for text, error, says in (
        ("{", FormatError, "not JSON"),
        ("[1]", FormatError, "not one JSON object"),
        ("{}", FormatError, "names no result"),
        ('{"schema": "elevon/diagnosys/1"}', UnknownNameError, "did you mean 'diagnosis'"),
    ):
        path.write_text(text, "utf-8")
        with pytest.raises(error, match=says):
            elevon.load(path)


def test_tables_pictures_and_pages(made):
    table = made.to_pandas()
    assert list(table["name"]) == ["a", "b", "c"]
    assert "Made: ok" in made._repr_html_()
    assert "Made: ok" in made.report().html()


def test_every_kind_is_there():
    for kind, place in results._KINDS.items():
        module, _, name = place.partition(":")
        kind_class = getattr(__import__(module, fromlist=[name]), name)
        assert issubclass(kind_class, results.Result)
        assert kind == kind_class.KIND
        assert results.units_of(kind_class) is not None  # every field has a form in JSON


def test_plain_types():
    assert plain({1: (np.float64(2.0), {"b"})}) == {"1": [2.0, ["b"]]}
    assert plain(np.array([1j])) == {"real": [0.0], "imag": [1.0]}
