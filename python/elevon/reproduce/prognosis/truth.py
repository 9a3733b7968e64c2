"""What the filter does not know: units, growth and diagnoses as they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.prognose.law import Law
from elevon.prognose.life import Life, run_to_failure
from elevon.prognose.observation import Inspection, Seen
from elevon.prognose.process import Process
from elevon.prognose.respond import respond

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.mission import Mission

__all__ = ["FAULTS", "UnitTruth", "inspections_of", "other_law", "true_unit"]

Floats = npt.NDArray[np.float64]
FAULTS = ("gear_wear", "lubricant_loss", "insulation")

#: Deviation from unit to unit (ASSUMED: series scatter) and of the calibration of one of them.
_UNITS: Mapping[str, tuple[float, float]] = {
    "friction.dynamic": (0.10, 0.01),
    "friction.viscous": (0.10, 0.02),
    "motor.emf_constant": (0.02, 0.005),
    "motor.inertia": (0.05, 0.02),
}
_FACTOR = (0.2, 0.5)  # median and deviation of the logarithm of a unit's growth over the law's
_GRAIN = 1.5  # of the truth's scatter over the law's
_FEEDBACK = 0.5  # greatest relative rise of a truth's growth up to the greatest severity, linear
_OWN_HEAT = (0.1, 0.3)  # median and deviation of the logarithm of a unit's over the law's

#: What a diagnosis errs by: relative and absolute deviation [the severity's unit] from one log to
#: the next, and absolute deviation common to all logs of a unit (its baselines). Measured on 32
#: logs of the high model, PWM, a day's spread, three baselines (docs/prognosis.md); friction as
#: from three logs an inspection and ten baselines, whose days are independent.
_ERRORS: Mapping[str, tuple[float, float, float]] = {
    "gear_wear": (0.01, 3e-5, 0.0),
    "lubricant_loss": (0.02, 0.035, 0.02),
    "insulation": (0.02, 0.003, 0.0),
}
#: Relative and absolute deviation that its intervals state: wider for play and shorts.
_STATED: Mapping[str, tuple[float, float]] = {
    "gear_wear": (0.04, 6e-5),
    "lubricant_loss": (0.02, 0.035),
    "insulation": (0.05, 0.005),
}
_SEEN: Mapping[str, float] = {"gear_wear": 2.5e-4, "lubricant_loss": 0.15, "insulation": 0.03}
"""Least severity that a diagnosis sees."""


@dataclass(frozen=True)
class UnitTruth:
    """One unit's life, as it is and as it is known.

    Attributes
    ----------
    number : int
        Of the history.
    law : str
        The law that ends it.
    life : Life
        Severity of that law's fault.
    calibrated : Actuator
        The healthy unit as its calibration says.
    """

    number: int
    law: str
    life: Life
    calibrated: Actuator


def true_unit(base: Actuator, mission: Mission, law: str, number: int, seed: int) -> UnitTruth:
    """Let one unit live on the high-fidelity model until it fails.

    The truth's tables come from thirteen runs at high fidelity along its own fault; its parameters,
    its growth factor, its law's form and its scatter differ from what the filter believes.
    """
    rng = np.random.default_rng([18, seed, number])
    unit, calibrated = {}, {}
    for path, (spread, error) in _UNITS.items():
        unit[path] = base.parameters.value(path) * float(np.exp(spread * rng.standard_normal()))
        calibrated[path] = unit[path] * float(np.exp(error * rng.standard_normal()))
    for values in (unit, calibrated):
        ratio = values["friction.dynamic"] / base.parameters.value("friction.dynamic")
        values["friction.static"] = ratio * base.parameters.value("friction.static")
    believed = {item.name: item for item in mission.laws()}[law]
    true = other_law(believed, rng)
    key = {"severity"}
    asked = mission.model_copy(
        update={
            "requirement": tuple(
                item
                for item in mission.requirement
                if item.measure not in key or item.fault == true.key
            )
        }
    )
    response = respond(base.with_values(unit, source="truth"), asked, laws=[true], fidelity="high")
    process = Process(response, drift=0.0)
    start = process.start(10, rng).picked(np.array([0]))
    factor = _FACTOR[0] + _FACTOR[1] * rng.standard_normal((1, 1))
    life = run_to_failure(
        process,
        replace(
            start, growth=factor, form=np.zeros((1, 1)), active=np.ones((1, 1), dtype=np.bool_)
        ),
        rng,
    )
    return UnitTruth(number, law, life, base.with_values(calibrated, source="calibration"))


def other_law(law: Law, rng: np.random.Generator) -> Law:
    """Return the law as it truly is in one unit: another form, another scatter."""
    if law.name == "insulation":
        heat = law.coefficients["own_heat"].value * float(np.exp(rng.normal(*_OWN_HEAT)))
        return replace(law.with_values({"own_heat": heat}), grain=_GRAIN * law.grain)
    believed, feedback = law.rate, rng.uniform(0.0, _FEEDBACK)

    def rate(damage: Floats, drivers: Mapping[str, Floats], c: Mapping[str, float]) -> Floats:
        return believed(damage, drivers, c) * (1.0 + feedback * damage / law.highest)

    return replace(law, rate=rate, grain=_GRAIN * law.grain)


def inspections_of(
    truth: UnitTruth, laws: tuple[Law, ...], interval: float, seed: int
) -> list[Inspection]:
    """Inspect a unit at irregular uses, with the diagnosis' errors.

    Part of the error is the same at all inspections of a unit.
    """
    rng = np.random.default_rng([19, seed, truth.number])
    common = {law.name: _ERRORS[law.name][2] * rng.standard_normal() for law in laws}
    out: list[Inspection] = []
    usage = 0.0
    while True:
        usage += interval * rng.uniform(0.6, 1.4)
        if usage >= truth.life.end:
            return out
        own = float(truth.life.at(usage)[0])
        seen = {
            law.key: _seen(law, own if law.name == truth.law else 0.0, common[law.name], rng)
            for law in laws
        }
        out.append(Inspection(usage, seen, name=f"{usage:.0f}"))


def _seen(law: Law, severity: float, common: float, rng: np.random.Generator) -> Seen:
    relative, absolute, _ = _ERRORS[law.name]
    limit = _SEEN[law.name]
    own = float(np.hypot(relative * severity, absolute))
    shown = severity + common + own * float(rng.standard_normal())
    if shown < limit:
        return Seen(None, limit / 3.0, limit / 3.0)
    stated = float(np.hypot(_STATED[law.name][0] * shown, _STATED[law.name][1]))
    return Seen(shown, stated, stated)
