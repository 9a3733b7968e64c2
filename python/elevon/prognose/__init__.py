"""Prognosis: growth of faults with use, and how long an actuator will do what it must.

>>> from elevon.prognose import Mission, predict
>>> mission = Mission.load("mission.toml")  # doctest: +SKIP
>>> result = predict(inspections, actuator, mission)  # doctest: +SKIP
>>> result.median, result.interval  # doctest: +SKIP
"""

from elevon.prognose.answer import Prognosis
from elevon.prognose.growth import GrowthFilter
from elevon.prognose.law import Coefficient, Law
from elevon.prognose.laws import LAWS
from elevon.prognose.mission import Mission
from elevon.prognose.observation import Inspection, Seen, inspection
from elevon.prognose.predict import predict
from elevon.prognose.process import Process
from elevon.prognose.respond import respond
from elevon.prognose.response import ResponseTables

__all__ = [
    "LAWS",
    "Coefficient",
    "GrowthFilter",
    "Inspection",
    "Law",
    "Mission",
    "Process",
    "Prognosis",
    "ResponseTables",
    "Seen",
    "inspection",
    "predict",
    "respond",
]
