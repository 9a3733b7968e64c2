"""Loads that come from flight: atmosphere, airspeed, hinge moment, ram force.

>>> from elevon.loads import read_flight, HingeMoment, flight_load  # doctest: +SKIP
>>> load = flight_load(read_flight("flight.csv"), HingeMoment(...), limit=8750.0)  # doctest: +SKIP
"""

from elevon.loads.airspeed import dynamic_pressure, mach_number
from elevon.loads.atmosphere import Atmosphere, standard_atmosphere
from elevon.loads.flight import FlightData, read_flight
from elevon.loads.hinge import HingeMoment
from elevon.loads.table import LoadTable, flight_load

__all__ = [
    "Atmosphere",
    "FlightData",
    "HingeMoment",
    "LoadTable",
    "dynamic_pressure",
    "flight_load",
    "mach_number",
    "read_flight",
    "standard_atmosphere",
]
