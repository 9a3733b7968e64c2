"""Loads that come from flight: atmosphere, airspeed, hinge moment, ram force.

>>> from elevon.loads import read_flight, HingeMoment, flight_load  # doctest: +SKIP
>>> load = flight_load(read_flight("flight.csv"), HingeMoment(...), limit=8750.0)  # doctest: +SKIP
"""

from elevon.loads.atmosphere import Atmosphere, dynamic_pressure, mach_number, standard_atmosphere
from elevon.loads.flight import FlightData, read_flight
from elevon.loads.table import HingeMoment, LoadTable, flight_load

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
