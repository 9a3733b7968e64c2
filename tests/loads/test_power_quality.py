"""Supply transients of standards: corners, a run under each, names that are not there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import elevon
from elevon.errors import InputError
from elevon.loads.power_quality import EDGE, TRANSIENTS


def scenario(**term: Any) -> elevon.Scenario:
    """A held command under a supply."""
    return elevon.Scenario.from_dict(
        {
            "duration": "1.4 s",
            "command": {"terms": []},
            "supply": {"terms": [{"kind": "table", **term}]},
        }
    )


@pytest.mark.parametrize("name", TRANSIENTS)
def test_a_run_sees_the_limit_of_the_clause(name: str) -> None:
    """Corner by corner; nominal before and after; no energy of its own between."""
    transient = TRANSIENTS[name]
    rec = elevon.simulate(
        elevon.Actuator.load("torino-rotary").with_values({"low.step": 1e-4}),
        scenario(standard=name, start="0.1 s"),
        fidelity="low",
        record="supply_voltage@10 kHz",
    )
    time, volts = rec["supply_voltage"].time, rec["supply_voltage"].values
    assert volts[0] == volts[-1] == transient.nominal
    for instant, level in transient.levels:
        at = 0.1 + EDGE + instant
        assert np.interp(at, time, volts) == pytest.approx(level, rel=1e-9)
    inside = volts[(time > 0.1) & (time < 0.1 + transient.levels[-1][0])]
    levels = [level for _, level in transient.levels] + [transient.nominal]
    assert min(levels) - 1e-9 <= inside.min()
    assert inside.max() <= max(levels) + 1e-9


def test_the_first_corner_of_28_volts_holds_12_5_milliseconds() -> None:
    """MIL-STD-704F figure 13: 50 V for 12.5 ms, 29 V at 82.5 ms."""
    time, volts = TRANSIENTS["mil-std-704f/28v/overvoltage"].points()
    assert volts.tolist() == [28.0, 50.0, 50.0, 29.0, 28.0]
    assert np.diff(time) == pytest.approx([EDGE, 0.0125, 0.07, EDGE])


@pytest.mark.parametrize(
    ("term", "message"),
    [
        ({"standard": "mil-std-704f/28v/overvolt"}, "mil-std-704f/28v/overvoltage"),
        ({"standard": "do-160g/28v/sag-a", "times": [0.0], "values": [1.0]}, "either"),
        ({"standard": "do-160g/28v/sag-a", "unit": "V"}, "own units"),
    ],
)
def test_wrong_tables_are_named(term: dict[str, Any], message: str) -> None:
    """With the nearest name."""
    with pytest.raises(InputError, match=message):
        scenario(**term)


def test_a_command_has_no_supply_transient() -> None:
    """Its unit is the volt."""
    given = {"terms": [{"kind": "table", "standard": "do-160g/28v/sag-a"}]}
    with pytest.raises(InputError, match="V"):
        elevon.simulate("torino-rotary", {"duration": "10 ms", "command": given})
