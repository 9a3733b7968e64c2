"""An actuator's growth of faults as a model of ProgPy, and samples both ways (extra ``progpy``).

ProgPy's licence is the NASA Open Source Agreement, so it is never part of a default installation.
Its models step in time; here time is use, in the mission's unit. Growth is the mean one: their
filters and predictors add noise of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from elevon.errors import InputError
from elevon.prognose.process import Population, Process

__all__ = ["from_samples", "progpy_model", "to_samples"]


def progpy_model(process: Process, *, load: float = 1.0, step: float = 1.0) -> Any:
    """Return a ``progpy.PrognosticsModel``.

    States are ``damage KIND@PLACE``, ``growth KIND@PLACE`` (logarithm of the factor on the law's
    rate) and ``form KIND@PLACE``; outputs the severities; events the requirements, whose event
    states are their reserve (1: untouched, 0: failed).

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
    keys = [law.key for law in process.laws]
    names = [f"{part} {key}" for part in ("damage", "growth", "form") for key in keys]
    requirements = [item.name for item in process.response.requirements]
    starts = [law.start for law in process.laws]

    class Actuator(PrognosticsModel):  # type: ignore[misc,unused-ignore]
        inputs: list[str] = []  # noqa: RUF012 - ProgPy's own form
        states = names
        outputs = keys
        events = requirements
        is_vectorized = False

        def initialize(self, _u: Any = None, _z: Any = None) -> Any:
            zeros = [0.0] * len(keys)
            return self.StateContainer(dict(zip(names, [*starts, *zeros, *zeros], strict=True)))

        def next_state(self, x: Any, _u: Any, dt: float) -> Any:
            units = _units(x, keys)
            count = max(1, round(dt / step))
            for _ in range(count):
                units = process.advance(units, dt / count, None, np.full(1, load))
            return self.StateContainer(_states(units, 0, keys))

        def output(self, x: Any) -> Any:
            severity = process.severity(_units(x, keys).damage)[0]
            return self.OutputContainer(dict(zip(keys, map(float, severity), strict=True)))

        def event_state(self, x: Any) -> dict[str, float]:
            reserve = process.response.reserve(process.severity(_units(x, keys).damage))[:, 0]
            return {
                n: float(np.clip(r, 0.0, 1.0)) for n, r in zip(requirements, reserve, strict=True)
            }

        def threshold_met(self, x: Any) -> dict[str, bool]:
            reserve = process.response.reserve(process.severity(_units(x, keys).damage))[:, 0]
            return {n: bool(r < 0.0) for n, r in zip(requirements, reserve, strict=True)}

    return Actuator(process_noise=0.0, measurement_noise=0.0)


def to_samples(units: Population, process: Process) -> Any:
    """Return units of equal weight as ``progpy.uncertain_data.UnweightedSamples`` of states.

    A fault that does not grow gets a growth of -700: the exponential of it is nothing.
    """
    from progpy.uncertain_data import UnweightedSamples

    keys = [law.key for law in process.laws]
    return UnweightedSamples([_states(units, n, keys) for n in range(len(units.weight))])


def from_samples(samples: Any, process: Process, *, usage: float = 0.0) -> Population:
    """Return ProgPy's samples of states as units; the inverse of `to_samples`.

    Raises
    ------
    InputError
        A state is missing.
    """
    keys = [law.key for law in process.laws]
    rows = []
    for sample in samples:
        missing = [n for key in keys for n in _names(key) if n not in sample]
        if missing:
            raise InputError(f"a sample has no state {missing[0]!r}")
        rows.append([[float(sample[name]) for name in _names(key)] for key in keys])
    table = np.array(rows)
    growth = table[:, :, 1]
    active = growth > _DORMANT
    return Population(
        damage=table[:, :, 0],
        growth=np.where(active, growth, 0.0),
        form=table[:, :, 2],
        weight=np.full(len(table), 1.0 / len(table)),
        active=active,
        misfit=np.zeros_like(growth),
        usage=usage,
    )


_DORMANT = -600.0


def _names(key: str) -> tuple[str, str, str]:
    return f"damage {key}", f"growth {key}", f"form {key}"


def _units(x: Mapping[str, Any], keys: list[str]) -> Population:
    """Return one unit of a state."""
    rows = np.array([[float(np.asarray(x[name]).item()) for name in _names(key)] for key in keys])
    growth = rows[None, :, 1]
    return Population(
        damage=np.maximum(rows[None, :, 0], 0.0),
        growth=growth,
        form=rows[None, :, 2],
        weight=np.ones(1),
        active=np.ones_like(growth, dtype=np.bool_),
        misfit=np.zeros_like(growth),
    )


def _states(units: Population, n: int, keys: list[str]) -> dict[str, float]:
    out: dict[str, float] = {}
    for k, key in enumerate(keys):
        growth = units.growth[n, k] if units.active[n, k] else -700.0
        values = (units.damage[n, k], growth, units.form[n, k])
        out.update(zip(_names(key), map(float, values), strict=True))
    return out
