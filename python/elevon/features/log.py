"""Features of a recording, simulated or measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.errors import InputError
from elevon.features.plan import MOVING_SPEED, core_plan, lacking_text
from elevon.features.records import ALL, FeatureRecord, wanted_records
from elevon.features.roles import assign_roles, comparable
from elevon.recording import Clock, Recording

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
