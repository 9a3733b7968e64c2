"""Histories of backlash towards a limit, for the cases of an answer."""

from functools import cache

from elevon import Actuator
from elevon.prognose import Inspection, Mission, Seen, predict, respond
from tests.prognose.test_predict import FLIGHT, KEY

LIMIT = 0.012  # rad
DETECTABLE = 3e-4


@cache
def _tables():
    need = {"name": "backlash", "measure": "severity", "fault": KEY, "limit": LIMIT}
    growth = [{"law": "gear_wear"}]
    mission = Mission.from_dict({**FLIGHT, "requirement": [need], "growth": growth})
    unit = Actuator.load("torino-rotary")
    return unit, mission, respond(unit, mission)


def answer(*rows):
    """Predict from use, severity over the limit (None: not seen) and probability."""
    unit, mission, tables = _tables()
    seen = []
    for usage, share, probability in rows:
        if share is None:
            one = Seen(None, DETECTABLE / 3.0, DETECTABLE / 3.0, detectable=DETECTABLE)
        else:
            value = share * LIMIT
            one = Seen(value, 0.03 * value, 0.03 * value, probability=probability,
                       detectable=DETECTABLE)  # fmt: skip
        seen.append(Inspection(float(usage), {KEY: one}, name=f"{usage}"))
    return predict(seen, unit, mission, response=tables)
