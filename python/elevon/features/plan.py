"""Which features of a run, at which rate: texts such as ``"all@400 Hz"`` become clocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from elevon.errors import InputError
from elevon.features.records import (
    ALL,
    FeatureRecord,
    assign_roles,
    comparable,
    feature_records,
    wanted_records,
)
from elevon.record_plan import period_of
from elevon.recording import Clock, Recording
from elevon.scenario.compile import signal_records, signal_units
from elevon.seam import CoreResult

#: Motor speed in rad/s above which the motor counts as moving, where nothing else is given.
MOVING_SPEED = 1.0

_PLACE = "features"


@dataclass(frozen=True)
class FeaturePlan:
    """Features on one clock.

    Attributes
    ----------
    name : str
        Of the clock, at the seam.
    period_steps : int
        Solver steps between two rows.
    names, units : tuple of str
        The features and their units.
    roles, signals : tuple of str
        Role of each column, and the signal that serves it.
    rate : float
        Hz.
    pole_pairs : float
        Of the motor: electrical angle over shaft angle.
    """

    name: str
    period_steps: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    roles: tuple[str, ...]
    signals: tuple[str, ...]
    rate: float
    pole_pairs: float

    def to_core(self) -> dict[str, object]:
        """Return the form that crosses the seam."""
        return {
            "clock": self.name,
            "period_steps": self.period_steps,
            "signals": list(self.signals),
            "features": core_plan(
                self.names, self.roles, rate=self.rate, pole_pairs=self.pole_pairs
            ),
        }

    def values(self, result: CoreResult) -> dict[str, float]:
        """Return the features in one result of the core; NaN where the motion gives none."""
        return dict(zip(self.names, result["features"][self.name].tolist(), strict=True))


def core_plan(
    names: Sequence[str],
    roles: Sequence[str],
    *,
    rate: float,
    pole_pairs: float,
    moving_speed: float = MOVING_SPEED,
) -> dict[str, object]:
    """Return the plan of features as it crosses the seam."""
    return {
        "names": list(names),
        "roles": list(roles),
        "rate": rate,
        "pole_pairs": pole_pairs,
        "moving_speed": moving_speed,
    }


def feature_plans(
    features: str | Sequence[str] | None,
    wiring: str,
    fidelity: str,
    *,
    command_unit: str,
    step: float,
    pole_pairs: float,
) -> tuple[FeaturePlan, ...]:
    """Resolve the features of a run.

    Parameters
    ----------
    features : str, sequence of str or None
        Texts ``FEATURES@RATE``: names, families (``level``, ``orders``, ...) or ``all`` separated
        by commas, and a rate with unit, or ``every`` for every solver step.
    wiring, fidelity : str
        Whose signals serve.
    command_unit : str
        Of the command in the run's control mode.
    step : float
        Solver step in s.
    pole_pairs : float
        Of the motor.

    Returns
    -------
    tuple of FeaturePlan
        One a text.

    Raises
    ------
    UnknownNameError
        No such feature or family.
    InputError
        A feature needs a signal that the model does not have, or a higher rate; or is wanted at
        two rates; or the rate is no whole number of steps.
    """
    texts = (features,) if isinstance(features, str) else tuple(features or ())
    return _plans(texts, _Model(wiring, fidelity, command_unit, step, pole_pairs))


class _Model(NamedTuple):
    wiring: str
    fidelity: str
    command_unit: str
    step: float
    pole_pairs: float

    def units(self) -> dict[str, str]:
        known = signal_units(self.wiring, self.fidelity)
        units = {name: unit or "1" for name, unit in known.items()}
        return {**units, "command": self.command_unit or units["command"]}

    def roles(self) -> dict[str, str]:
        known = signal_records(self.wiring, self.fidelity)
        return {item["role"]: name for name, item in known.items() if item["role"]}


@lru_cache(maxsize=64)
def _plans(texts: tuple[str, ...], model: _Model) -> tuple[FeaturePlan, ...]:
    """Resolve texts; the runs of a batch share what they resolve to."""
    plans = tuple(_plan(f"features_{i}", text, model) for i, text in enumerate(texts))
    owner: dict[str, str] = {}
    for text, plan in zip(texts, plans, strict=True):
        for name in plan.names:
            if owner.setdefault(name, text) != text:
                raise InputError(f"{_PLACE}: {name!r} is asked for by {owner[name]!r} and {text!r}")
    return plans


def _plan(clock: str, text: str, model: _Model) -> FeaturePlan:
    names, _, rate = text.partition("@")
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    if not wanted or not rate.strip():
        raise InputError(
            f"{_PLACE}: {text!r} is not of the form FEATURES@RATE, such as 'all@400 Hz' or "
            "'torque_current_rms,orders@2 kHz'"
        )
    period = period_of(rate.strip(), model.step, _PLACE)
    hertz = 1.0 / (period * model.step)
    units = model.units()
    roles = comparable(assign_roles(units, stated=model.roles()), units)
    records, lacking = wanted_records(wanted, roles, hertz, _PLACE)
    if lacking:
        raise InputError(f"{_PLACE}: {lacking_text(lacking[0], roles, hertz)}")
    needed = [role for role in roles if any(role in record.roles for record in records)]
    by_role = {role: units[roles[role]] for role in needed}
    return FeaturePlan(
        clock,
        period,
        tuple(record.name for record in records),
        tuple(record.unit_of(by_role) for record in records),
        tuple(needed),
        tuple(roles[role] for role in needed),
        hertz,
        model.pole_pairs,
    )


def lacking_text(name: str, roles: Mapping[str, str], rate: float) -> str:
    """Say why no feature of a name or family can be."""
    group = [r for r in feature_records().values() if name in (r.name, r.family)]
    missing = dict.fromkeys(role for record in group for role in record.roles if role not in roles)
    if missing:
        return f"{name!r} needs {', '.join(missing)}: no signal serves it here"
    least = min((record.minimum_rate for record in group), default=0.0)
    return f"{name!r} needs a rate of at least {least:g} Hz, {rate:g} Hz given"


#: Part of a period by which the instants of an even clock may differ from it.
_UNEVEN = 0.01


@dataclass(frozen=True)
class LogFeatures:
    """Features of one recording.

    Attributes
    ----------
    values : mapping of str to float
        Name to value in SI; NaN where the motion gives none (one direction only, too short, ...).
    units : mapping of str to str
        Name to unit.
    signals : mapping of str to str
        Role to the channel that served it.
    rate : float
        Hz.
    """

    values: Mapping[str, float]
    units: Mapping[str, str]
    signals: Mapping[str, str]
    rate: float


def recording_features(
    recording: Recording,
    features: str | Sequence[str] = ALL,
    *,
    roles: Mapping[str, str] | None = None,
    clock: str | None = None,
    pole_pairs: float | None = None,
    moving_speed: float = MOVING_SPEED,
) -> LogFeatures:
    """Compute features of a recording, by the code that computes them while simulating.

    The result equals that of a simulation to the last bit where the recording holds the same
    signals at the features' rate.

    Parameters
    ----------
    recording : Recording
        Simulated or measured.
    features : str or sequence of str
        Names, families or ``all``; the last leaves out what the recording does not allow.
    roles : mapping of str to str, optional
        Role to channel, where it is not one of `elevon.features.ROLES`.
    clock : str, optional
        The clock whose channels serve; default: the one with most roles.
    pole_pairs : float, optional
        Of the motor; without it features per electrical turn are left out.
    moving_speed : float
        Motor speed in rad/s above which the motor counts as moving.

    Raises
    ------
    UnknownNameError
        No such feature, role, channel or clock.
    InputError
        A feature lacks a channel; the clock is uneven or has gaps; a sample is missing.
    """
    base = _clock(recording, clock, roles)
    rate = _rate(base)
    units = {channel.name: channel.unit for channel in recording.on_clock(base.name)}
    served = comparable(assign_roles(units, roles, recording.roles), units)
    names = [features] if isinstance(features, str) else list(features)
    names = [part.strip() for name in names for part in name.split(",") if part.strip()]
    records, lacking = wanted_records(names, served, rate, "features")
    if lacking:
        raise InputError(f"features: {lacking_text(lacking[0], served, rate)}")
    if pole_pairs is None:
        records = [record for record in records if not _electrical(record, names)]
    served = {r: n for r, n in served.items() if any(r in record.roles for record in records)}
    by_role = {role: units[name] for role, name in served.items()}
    return LogFeatures(
        _values(
            recording,
            records,
            served,
            rate=rate,
            pole_pairs=pole_pairs or 1.0,
            moving_speed=moving_speed,
        ),
        {record.name: record.unit_of(by_role) for record in records},
        served,
        rate,
    )


def _electrical(record: FeatureRecord, names: Sequence[str]) -> bool:
    """Return whether a feature needs the number of pole pairs; an error if it was named itself."""
    needs = "electrical" in record.name or record.name in _TURNING
    if needs and record.name in names:
        raise InputError(f"features: {record.name!r} needs the motor's pole_pairs")
    return needs


_TURNING = ("phase_current_positive", "phase_current_negative")


def _clock(recording: Recording, name: str | None, roles: Mapping[str, str] | None) -> Clock:
    if name is not None:
        return recording.clock(name)
    for role, channel in (roles or {}).items():
        if channel not in recording:
            assign_roles(recording.names, {role: channel})
    if not recording.clocks:
        raise InputError("features: the recording has no channels")
    given = set((roles or {}).values())

    def served(clock: Clock) -> int:
        names = [channel.name for channel in recording.on_clock(clock.name)]
        return 100 * len(given.intersection(names)) + len(
            assign_roles(names, stated=recording.roles)
        )

    return max(recording.clocks.values(), key=served)


def _rate(clock: Clock) -> float:
    """Return the rate of an even clock without gaps."""
    if len(clock) < 2:
        raise InputError(f"features: clock {clock.name!r} has {len(clock)} sample(s)")
    if clock.gaps:
        first, last = clock.gap_intervals[0]
        raise InputError(
            f"features: samples are missing on clock {clock.name!r} between {first:g} s and "
            f"{last:g} s ({len(clock.gaps)} gaps); compute features of a part without gaps "
            "(Recording.window)"
        )
    steps = np.diff(clock.time)
    rate = clock.rate or float(1.0 / np.median(steps))
    worst = int(np.argmax(np.abs(steps * rate - 1.0)))
    if abs(steps[worst] * rate - 1.0) > _UNEVEN:
        raise InputError(
            f"features: clock {clock.name!r} is uneven: {steps[worst]:g} s between samples "
            f"{worst} and {worst + 1}, {1.0 / rate:g} s elsewhere; resample the log first"
        )
    return rate


def _values(
    recording: Recording,
    records: Sequence[FeatureRecord],
    served: Mapping[str, str],
    **settings: float,
) -> dict[str, float]:
    from elevon import _core

    columns = []
    for role, name in served.items():
        values = np.ascontiguousarray(recording[name].values)
        if not np.isfinite(values).all():
            index = int(np.flatnonzero(~np.isfinite(values))[0])
            raise InputError(
                f"features: {name} ({role}) is not a number at sample {index}; fill it in, or "
                "compute features of a part without it (Recording.window)"
            )
        columns.append(values)
    names = [record.name for record in records]
    plan = core_plan(names, list(served), **settings)
    try:
        values = _core.features(plan, columns)
    except ValueError as error:
        raise InputError(f"features: {error}") from error
    return dict(zip(names, values.tolist(), strict=True))
