"""Prognosis: growth of faults with use, and how long an actuator will do what it must.

>>> from elevon.prognose import Mission, predict
>>> mission = Mission.load("mission.toml")  # doctest: +SKIP
>>> result = predict(inspections, actuator, mission)  # doctest: +SKIP
>>> result.median, result.interval  # doctest: +SKIP
"""

from elevon.prognose.answer import Prognosis
from elevon.prognose.growth import GrowthFilter
from elevon.prognose.law import LAWS, Coefficient, Law
from elevon.prognose.mission import Mission
from elevon.prognose.observation import Inspection, Seen, inspection
from elevon.prognose.predict import predict
from elevon.prognose.process import Process
from elevon.prognose.response import ResponseTables
from elevon.prognose.tabulate import respond

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
