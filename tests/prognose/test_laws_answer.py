"""Every law of every actuator: a history by it, diagnosed, ends in an answer."""

import numpy as np
import pytest

from elevon import Actuator
from elevon.prognose import LAWS, Inspection, Mission, Seen, predict, respond
from elevon.prognose.law import laws_of

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
ACTUATORS = {"torino-rotary": "rotary", "nasa-ballscrew": "ballscrew",
             "pisa-landing-gear": "landing_gear"}  # fmt: skip
EVERY = [(name, law) for name, wiring in ACTUATORS.items() for law in laws_of(wiring)]
LIFE = 4000.0  # cycles, about


def scenario(unit):
    """A motion against a load; a gear's own."""
    if unit.wiring == "landing_gear":
        return dict(unit.default_scenario)
    size, push = {"rotary": ("7 deg", "60 N m"), "ballscrew": ("20 mm", "2000 N")}[unit.wiring]
    sine = {"kind": "sine", "frequency": "0.5 Hz"}
    return {
        "duration": "4 s",
        "command": {"terms": [{**sine, "amplitude": size}]},
        "load": {"output": {"terms": [{**sine, "amplitude": push}]}},
    }


@pytest.mark.long
@pytest.mark.parametrize(("name", "law"), EVERY, ids=["-".join(pair) for pair in EVERY])
def test_a_history_by_a_law_ends_in_an_answer(name, law):
    """Ten inspections to half of the limit, in equal steps; what is left is in its interval."""
    unit, made = Actuator.load(name), LAWS[law]
    limit = 0.5 * made.highest
    need = {"name": "limit", "measure": "severity", "fault": made.key, "limit": limit}
    flight = Mission.from_dict({
        "unit": "cycles", "hours": 0.01, "scenario": scenario(unit),
        "requirement": [need], "growth": [{"law": law, "dormant": 0}],
    })  # fmt: skip
    tables = respond(unit, flight)
    seen = []
    for usage in np.linspace(0.05, 0.5, 10) * LIFE:
        severity = limit * usage / LIFE
        deviation = 0.03 * limit
        seen.append(Inspection(float(usage), {made.key: Seen(severity, deviation, deviation)}))
    result = predict(seen, unit, flight, response=tables)
    low, high = result.interval
    assert np.isfinite(low)
    assert low <= 0.5 * LIFE <= high
    assert result.status in ("ok", "off_law")
    assert "nan" not in result.headline
