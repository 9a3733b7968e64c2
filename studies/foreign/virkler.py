"""Virkler's fatigue cracks: 68 real courses of growth, predicted by Paris laws of any exponent."""

from __future__ import annotations

from functools import lru_cache, partial
from importlib.resources import files

import numpy as np

from elevon.arrays import Floats
from elevon.prognose import Coefficient, Inspection, Law, ResponseTables, Seen
from elevon.prognose.mission import Mission
from elevon.prognose.requirement import Requirement
from elevon.prognose.response import Grid
from studies.foreign.truth import Case, ForeignLife, visits

EXPONENTS = (2.0, 2.5, 2.9, 3.5)
_START, _LIMIT = 9e-3, 49.8e-3  # m, first and last length of the tests
_ERROR = (0.01, 1e-4)  # of the length, and m: deviation of an inspection; ASSUMED
_POINTS = 400


@lru_cache(maxsize=1)
def cracks() -> tuple[Floats, Floats]:
    """Return lengths [m], shape (9,), and cycles at which each specimen had them, (68, 9)."""
    text = (files("studies.foreign") / "virkler.csv").read_text("ascii")
    rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")]
    table = np.array(rows, dtype=np.float64)
    cycles = np.column_stack((np.zeros(len(table) - 1), 1e3 * table[1:]))
    return np.concatenate(([_START], 1e-3 * table[0])), cycles


def crack(number: int, exponent: float) -> ForeignLife:
    """Return one specimen's course, monotone between the lengths that were noted.

    Between two of them the logarithm of the length is taken as a straight line over cycles; the
    name of the law carries the exponent that the filter is given.
    """
    length, cycles = cracks()
    usage = np.linspace(0.0, cycles[number, -1], _POINTS)
    course = np.exp(np.interp(usage, cycles[number], np.log(length)))
    return ForeignLife(f"Paris {exponent:g}", "Virkler", number, usage, course, float(usage[-1]))


def _rate(exponent: float, damage: Floats, _drivers: object, c: dict[str, float]) -> Floats:
    return np.asarray(c["pace"] * (np.maximum(damage, _START) / _START) ** (0.5 * exponent))


@lru_cache(maxsize=8)
def crack_case(exponent: float) -> Case:
    """Return a mission whose only law is Paris' with an exponent; its median life is the tests'."""
    end = float(np.median(cracks()[1][:, -1]))
    half = 0.5 * exponent
    grown = np.log(_LIMIT / _START) if half == 1.0 else (
        ((_LIMIT / _START) ** (1.0 - half) - 1.0) / (1.0 - half)
    )  # fmt: skip
    law = Law(
        name=f"paris {exponent:g}", text="crack", source="Paris and Erdogan 1963", kind="crack",
        place="plate", unit="m", rate=partial(_rate, exponent), drivers=("hours",),
        coefficients={"pace": Coefficient(_START * grown / end, "m", "median of the tests")},
        highest=1.2 * _LIMIT, spread=0.5, start=_START, start_spread=1e-4, grain=1e-5,
    )  # fmt: skip
    requirement = Requirement(name="length", measure="severity", fault=law.key, limit=_LIMIT)
    tables = ResponseTables(
        (law,), (requirement,), (_LIMIT,), ("m",), Grid((np.array([0.0, law.highest]),)),
        {"hours": np.ones(2)}, np.zeros((2, 1)), 2, "none",
    )  # fmt: skip
    mission = Mission.from_dict({
        "unit": "cycles", "scenario": {"duration": "1 s"},
        "requirement": [{"name": "length", "measure": "severity", "fault": law.key, "limit": 1}],
        "growth": [{"law": "spall"}],
    })  # fmt: skip
    return Case(law.name, mission, tables, _START, _LIMIT, end)


def crack_inspections(
    life: ForeignLife, given: Case, density: float, seed: int
) -> list[Inspection]:
    """Inspect a crack each 4 % of the median life, over the density, irregularly."""
    rng = np.random.default_rng([35, seed, int(density), life.number])
    key = given.tables.laws[0].key
    out = []
    for usage in visits(life.end, 0.04 * given.expected / density, rng):
        length = float(np.interp(usage, life.usage, life.severity))
        deviation = float(np.hypot(_ERROR[0] * length, _ERROR[1]))
        seen = Seen(length + deviation * float(rng.standard_normal()), deviation, deviation)
        out.append(Inspection(usage, {key: seen}, name=f"{usage:.0f}"))
    return out
