"""Which features of a run, at which rate: texts such as ``"all@400 Hz"`` become clocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from elevon.errors import InputError
from elevon.features.records import feature_records, wanted_records
from elevon.features.roles import assign_roles, comparable
from elevon.record_plan import period_of
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
