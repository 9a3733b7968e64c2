"""A measured value without an actuator: what is read, refused and predicted."""

import json

import numpy as np
import pytest

import elevon
from elevon.errors import FormatError, InputError
from elevon.prognose.value_history import VALUE, read_value_history
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture

HEAD = "use [cycles],severity [mm],sd,p\n"


def written(place, rows, head=HEAD):
    place.write_text(head + "\n".join(rows) + "\n")
    return place


def line(count=8):
    return [f"{u:g},{9.0 + 0.02 * u:g},0.2,1" for u in np.linspace(0.0, 1000.0, count)]


def test_severities_are_shares_of_the_way_from_new_to_the_limit(tmp_path):
    read = read_value_history(written(tmp_path / "a.csv", line()), "49 mm")
    assert (read.start, read.limit, read.unit, read.unit_of_use) == (9.0, 49.0, "mm", "cycles")
    last = read.inspections[-1].seen[VALUE]
    assert last.severity == pytest.approx(0.5)
    assert last.low == pytest.approx(0.2 / 40.0)
    falling = read_value_history(
        written(tmp_path / "b.csv", ["0,2.0,0.01", "50,1.7,0.01"], "use,severity,sd\n"), "1.4"
    )
    assert falling.inspections[-1].seen[VALUE].severity == pytest.approx(0.5)


def test_growth_in_proportion_ends_where_the_line_does(tmp_path):
    result = elevon.predict(written(tmp_path / "a.csv", line(12)), limit="49 mm")
    low, high = result.interval
    assert low < 1000.0 < high
    assert result.median == pytest.approx(1000.0, rel=0.35)
    assert result.unit == "cycles"
    wide = elevon.predict(tmp_path / "a.csv", limit="49 mm", bias=0.2)
    assert wide.interval[1] - wide.interval[0] > 1.05 * (high - low)


@pytest.mark.parametrize(
    ("rows", "head", "limit", "text"),
    [
        (["0,9,0.2"], "use,severty,sd\n", "49", "did you mean 'severity'"),
        (["0,9"], "use,severity\n", "49", "has no column 'sd'"),
        (["0,9,0"], "use,severity,sd\n", "49", "sd = 0.0 must be above 0"),
        (["0,9,x"], "use,severity,sd\n", "49", "sd = 'x' is not a number"),
        (["0,9,nan"], "use,severity,sd\n", "49", "is not finite"),
        (["5,9,1", "4,9,1"], "use,severity,sd\n", "49", "use falls from 5"),
        (["0,9,1,1.5"], "use,severity,sd,p\n", "49", "p = 1.5 is outside 0 to 1"),
        (["0,9,1"], "use,severity [mm],sd\n", "2 in", "are in mm"),
        (["0,9,1"], "use,severity,sd\n", "9", "no life lies between"),
        (["0,9,1"], "use,severity,sd\n", "far", "is not a value such as"),
        ([], "use,severity,sd\n", "9", "has no measurement"),
    ],
)
def test_what_cannot_be_read_is_named(rows, head, limit, text, tmp_path):
    with pytest.raises((FormatError, InputError), match=text):
        read_value_history(written(tmp_path / "a.csv", rows, head), limit)


def test_a_history_needs_an_actuator_or_a_limit(tmp_path):
    with pytest.raises(InputError, match="needs --limit instead"):
        elevon.predict(tmp_path)
    with pytest.raises(InputError, match="without an actuator"):
        elevon.predict(tmp_path, "torino-rotary", limit="1")


def test_the_command_line(elevon_cli, tmp_path):  # noqa: F811
    place = written(tmp_path / "a.csv", line())
    result = elevon_cli("predict", place, "--limit", "49 mm", "--json")
    assert result.code == 0
    values = json.loads(result.out)
    assert values["rul"]["unit"] == "cycles"
    assert values["branches"][0]["probability"] == 1.0
    assert elevon_cli("predict", place, "--limit", "49 in").code == 2
