"""An actuator's growth of faults as a model of ProgPy, and samples both ways (extra ``progpy``).

ProgPy's licence is the NASA Open Source Agreement, so it is never part of a default installation.
Its models step in time; here time is use, in the mission's unit. Growth is the mean one: their
filters and predictors add noise of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from elevon.errors import InputError
from elevon.prognose.law import Law
from elevon.prognose.process import Process, UnitPopulation


def progpy_model(process: Process, *, load: float = 1.0, step: float = 1.0) -> object:
    """Return a ``progpy.PrognosticsModel``.

    States are ``damage KIND@PLACE``, ``growth KIND@PLACE`` (logarithm of the factor on the law's
    rate) and ``row KIND@PLACE`` (number of its way of growth); outputs the severities; events the
    requirements, whose event states are their reserve (1: untouched, 0: failed).

    Parameters
    ----------
    process : Process
        How faults grow.
    load : float
        Factor on the mission's loads.
    step : float
        Repetitions in one step of the model's derivatives.

    Raises
    ------
    InputError
        ProgPy is not installed.
    """
    try:
        from progpy import PrognosticsModel
    except ImportError as error:
        raise InputError(
            "ProgPy is not installed: pip install 'elevon[progpy]' (its licence is NASA's own)"
        ) from error
    laws = process.laws
    keys = [law.key for law in laws]
    names = [name for law in laws for name in _names(law)]
    begin = dict.fromkeys(names, 0.0) | {_names(law)[0]: law.start for law in laws}
    requirements = [item.name for item in process.response.requirements]

    class Actuator(PrognosticsModel):  # type: ignore[misc,unused-ignore]
        inputs: list[str] = []  # noqa: RUF012 - ProgPy's own form
        states = names
        outputs = keys
        events = requirements
        is_vectorized = False

        def initialize(self, _u: Any = None, _z: Any = None) -> Any:
            return self.StateContainer(begin)

        def next_state(self, x: Any, _u: Any, dt: float) -> Any:
            units = _units(x, laws)
            count = max(1, round(dt / step))
            for _ in range(count):
                units = process.advance(units, dt / count, None, np.full(1, load))
            return self.StateContainer(_states(units, 0, laws))

        def output(self, x: Any) -> Any:
            severity = process.severity(_units(x, laws).damage)[0]
            return self.OutputContainer(dict(zip(keys, map(float, severity), strict=True)))

        def event_state(self, x: Any) -> dict[str, float]:
            reserve = process.response.reserve(process.severity(_units(x, laws).damage))[:, 0]
            return {
                n: float(np.clip(r, 0.0, 1.0)) for n, r in zip(requirements, reserve, strict=True)
            }

        def threshold_met(self, x: Any) -> dict[str, bool]:
            reserve = process.response.reserve(process.severity(_units(x, laws).damage))[:, 0]
            return {n: bool(r < 0.0) for n, r in zip(requirements, reserve, strict=True)}

    return Actuator(process_noise=0.0, measurement_noise=0.0)


def to_samples(units: UnitPopulation, process: Process) -> object:
    """Return units as ``progpy.uncertain_data.UnweightedSamples`` of states.

    A fault that does not grow gets a growth of -700: the exponential of it is nothing.
    """
    from progpy.uncertain_data import UnweightedSamples

    return UnweightedSamples([_states(units, n, process.laws) for n in range(len(units))])


def from_samples(
    samples: Iterable[Mapping[str, float]], process: Process, *, usage: float = 0.0
) -> UnitPopulation:
    """Return ProgPy's samples of states as units; the inverse of `to_samples`.

    Raises
    ------
    InputError
        A state is missing.
    """
    samples = list(samples)
    wanted = [name for law in process.laws for name in _names(law)]
    missing = next((n for sample in samples for n in wanted if n not in sample), None)
    if missing is not None:
        raise InputError(f"a sample has no state {missing!r}")
    units = _population(samples, process.laws, usage)
    active = units.growth > _DORMANT
    return replace(units, growth=np.where(active, units.growth, 0.0), active=active)


_DORMANT = -600.0


def _names(law: Law) -> tuple[str, ...]:
    """Return the names of a law's states."""
    return tuple(f"{part} {law.key}" for part in ("damage", "growth", "row"))


def _units(x: Mapping[str, Any], laws: Sequence[Law]) -> UnitPopulation:
    """Return one unit of a state."""
    units = _population([x], laws)
    return replace(units, damage=np.maximum(units.damage, 0.0))


def _population(
    rows: Sequence[Mapping[str, Any]], laws: Sequence[Law], usage: float = 0.0
) -> UnitPopulation:
    """Return units of states; a growth of -700 as it is."""
    table = np.array(
        [
            [[float(np.asarray(row[name]).item()) for name in _names(law)] for law in laws]
            for row in rows
        ]
    )
    damage, growth, row = np.moveaxis(table, 2, 0)
    units = UnitPopulation.of(damage, growth, usage=usage)
    return replace(units, row=row.astype(np.intp))


def _states(units: UnitPopulation, n: int, laws: Sequence[Law]) -> dict[str, float]:
    out: dict[str, float] = {}
    for k, law in enumerate(laws):
        growth = units.growth[n, k] if units.active[n, k] else -700.0
        values = (units.damage[n, k], growth, units.row[n, k])
        out.update(zip(_names(law), map(float, values), strict=True))
    return out
