"""What the filter does not know: units, growth and diagnoses as they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.demo.unit import other_law
from elevon.diagnose.engine.candidates import CANDIDATES
from elevon.prognose.future import Life, run_to_failure
from elevon.prognose.law import Law
from elevon.prognose.observation import SIGMAS, Inspection, Measured, Seen, inspection
from elevon.prognose.process import Process
from elevon.prognose.tabulate import respond
from studies.diagnosis_limits.unit import DAILY

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.mission import Mission
    from elevon.prognose.response import ResponseTables

__all__ = [
    "FAULTS",
    "INSPECTIONS",
    "VALUES",
    "InspectionError",
    "Inspector",
    "UnitTruth",
    "seen_as",
    "true_unit",
]

FAULTS = ("gear_wear", "lubricant_loss", "insulation")

#: Deviation from unit to unit (ASSUMED: series scatter) and of the calibration of one of them.
_UNITS: Mapping[str, tuple[float, float]] = {
    "friction.dynamic": (0.10, 0.01),
    "friction.viscous": (0.10, 0.02),
    "motor.emf_constant": (0.02, 0.005),
    "motor.inertia": (0.05, 0.02),
}
_OWN_HEAT = (0.1, 0.3)  # median and deviation of the logarithm of windings' over the law's
_GRAIN = 1.5  # of the windings' scatter over the law's
_FACTOR = (0.2, 0.5)  # median and deviation of the logarithm of a unit's growth over the law's
INSPECTION_DAYS = 3
"""Days on which an inspection's logs are taken, one a standard test."""
BASELINE_DAYS = 3
"""Days of the healthy logs, which the unit is calibrated on, too."""


@dataclass(frozen=True)
class InspectionError:
    """What an inspection of a fault errs by and states; see `INSPECTIONS`.

    Attributes
    ----------
    of_the_day : float
        Deviation of the logarithm of what the fault adds to, from day to day; 0 but for friction.
    offset : tuple of (float, float)
        True severity and mean error there, alike in all units: the diagnosing model's own.
    relative, absolute : float
        Deviation from one inspection of a unit to the next: share of the severity, and [its unit].
    common_relative, common_absolute : float
        Deviation of what all inspections of one unit err by alike.
    stated_relative, stated_absolute : float
        Deviation that the intervals state.
    seen : float
        Least severity that is seen.
    detectable : float
        Least severity that a diagnosis says it can see.
    """

    of_the_day: float
    offset: tuple[tuple[float, float], ...]
    relative: float
    absolute: float
    common_relative: float
    common_absolute: float
    stated_relative: float
    stated_absolute: float
    seen: float
    detectable: float

    def mean(self, severity: Floats) -> Floats:
        """Return the mean error, linear between the severities measured and from none at zero."""
        at, error = zip((0.0, 0.0), *self.offset, strict=True)
        return np.asarray(np.interp(severity, at, error))

    def per_visit(self, severity: Floats) -> Floats:
        """Return the deviation from one inspection to the next, its days' own included."""
        day = self.of_the_day / np.sqrt(INSPECTION_DAYS) * (1.0 + severity)
        return np.asarray(np.sqrt((self.relative * severity) ** 2 + self.absolute**2 + day**2))

    def common(self, severity: Floats) -> Floats:
        """Return the deviation of what is common to a unit, its baselines' days included."""
        day = self.of_the_day / np.sqrt(BASELINE_DAYS) * (1.0 + severity)
        part = self.common_relative * severity
        return np.asarray(np.sqrt(part**2 + self.common_absolute**2 + day**2))

    def estimate_of(
        self, severity: float, common: tuple[float, float, float], rng: np.random.Generator
    ) -> float:
        """Draw what an inspection says of a severity.

        `common`: of the unit, the parts of unit deviation in its own units and as a share, and the
        logarithm of the friction of its baselines' days.
        """
        normal = rng.standard_normal(2)
        day = self.of_the_day / np.sqrt(INSPECTION_DAYS) * normal[0]
        if self.of_the_day > 0.0:
            day -= common[2]
        share = self.common_relative * common[1]
        scatter = float(np.hypot(self.relative * severity, self.absolute)) * normal[1]
        error = float(self.mean(np.array(severity))) + self.common_absolute * common[0] + scatter
        return float((1.0 + severity) * np.exp(day) - 1.0 + share * severity + error)

    def stated(self, severity: Floats) -> Floats:
        """Return the deviation stated."""
        return np.hypot(self.stated_relative * severity, self.stated_absolute)


#: An inspection is one log in each of the three standard tests, each of a day of its own, diagnosed
#: together by a reduced-order model that the bench is unlike, against healthy logs of three days.
#: Measured by `python -m studies inspection-error --seed 31` on six units; rounded up.
INSPECTIONS: Mapping[str, InspectionError] = {
    "gear_wear": InspectionError(
        of_the_day=0.0,
        offset=((3e-4, -1e-5), (2e-3, -4e-5), (0.01, -1e-5), (0.025, 0.0)),
        relative=0.002,
        absolute=6.5e-5,
        common_relative=0.0,
        common_absolute=2e-5,
        stated_relative=0.013,
        stated_absolute=3.5e-5,
        seen=2.5e-4,
        detectable=2e-4,
    ),
    "lubricant_loss": InspectionError(
        of_the_day=DAILY["friction.dynamic"],
        offset=((0.2, -0.002), (0.6, -0.011), (1.1, -0.008), (1.5, -0.007)),
        relative=0.0,
        absolute=0.008,
        common_relative=0.007,
        common_absolute=0.005,
        stated_relative=0.084,
        stated_absolute=0.022,
        seen=0.15,
        detectable=0.11,
    ),
    "insulation": InspectionError(
        of_the_day=0.0,
        offset=((0.05, 0.007), (0.1, 0.016), (0.2, 0.016), (0.4, -0.014)),
        relative=0.02,
        absolute=0.008,
        common_relative=0.008,
        common_absolute=0.0,
        stated_relative=0.081,
        stated_absolute=0.007,
        seen=0.03,
        detectable=0.032,
    ),
}


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
    response : ResponseTables, optional
        What its fault does to the requirements.
    """

    number: int
    law: str
    life: Life
    calibrated: Actuator
    response: ResponseTables | None = None


def _true_law(law: Law, rng: np.random.Generator) -> Law:
    """Return the law as it truly is in one unit: windings heat themselves at another rate."""
    if law.name != "insulation":
        return other_law(law, rng)
    heat = law.coefficients["own_heat"].value * float(np.exp(rng.normal(*_OWN_HEAT)))
    return replace(law.with_values({"own_heat": heat}), grain=_GRAIN * law.grain)


def true_unit(base: Actuator, mission: Mission, law: str, number: int, seed: int) -> UnitTruth:
    """Let one unit live on the switching model until it fails.

    The truth's tables come from thirteen runs at high fidelity along its own fault; its parameters,
    its growth factor, its law's form and its scatter differ from what the filter believes.
    """
    rng = np.random.default_rng([18, seed, number])
    unit, calibrated = {}, {}
    for path, (spread, error) in _UNITS.items():
        unit[path] = base.parameters.value(path) * float(np.exp(spread * rng.standard_normal()))
        calibrated[path] = unit[path] * float(np.exp(error * rng.standard_normal()))
    calibrated["friction.dynamic"] *= float(np.exp(_of_the_baselines(number, seed)))
    for values in (unit, calibrated):
        ratio = values["friction.dynamic"] / base.parameters.value("friction.dynamic")
        values["friction.static"] = ratio * base.parameters.value("friction.static")
    believed = {item.name: item for item in mission.laws()}[law]
    true = _true_law(believed, rng)
    key = {"severity"}
    reduced = mission.model_copy(
        update={
            "requirement": tuple(
                item
                for item in mission.requirement
                if item.measure not in key or item.fault == true.key
            )
        }
    )
    acting = [replace(true, dormant=0.0)]
    response = respond(
        base.with_values(unit, source="truth"), reduced, laws=acting, fidelity="high"
    )
    process = Process(response, wander=False)
    start = process.start(10, rng).picked(np.array([0]))
    factor = _FACTOR[0] + _FACTOR[1] * rng.standard_normal((1, 1))
    life = run_to_failure(
        process,
        replace(start, growth=factor, row=0 * start.row, active=np.ones((1, 1), dtype=np.bool_)),
        rng,
    )
    known = base.with_values(calibrated, source="calibration")
    return UnitTruth(number, law, life, known, response)


def _of_the_baselines(number: int, seed: int) -> float:
    """Return the logarithm of the friction of a unit's healthy days over that of its mean day.

    Calibration and diagnosis share those days: what is said of friction is said against them, and
    the set in which it is looked at has their friction.
    """
    rng = np.random.default_rng([23, seed, number])
    deviation = INSPECTIONS["lubricant_loss"].of_the_day / np.sqrt(BASELINE_DAYS)
    return float(deviation * rng.standard_normal())


#: Deviation of what a unit shows of a requirement from day to day, over its value: on the bench of
#: `inspection-error`, four units, six days, this mission, the largest of three conditions.
VALUES: Mapping[str, float] = {"tracking_error": 0.002, "current": 0.024}


class Inspector:
    """Inspects a unit at any uses, with the diagnosis' errors.

    Part of the error is the same at all inspections of a unit, and of that part the days of its
    baselines are also in its calibrated set.

    Parameters
    ----------
    truth : UnitTruth
        The unit.
    laws : tuple of Law
        What is looked for.
    seed : int
        Of chance.
    measured : bool
        Whether inspections carry what the unit showed of its requirements in a mission, too.
    """

    def __init__(
        self, truth: UnitTruth, laws: tuple[Law, ...], seed: int, *, measured: bool = False
    ) -> None:
        self.truth, self._laws, self._measured = truth, laws, measured
        self.rng = np.random.default_rng([19, seed, truth.number])
        self._of_values = np.random.default_rng([24, seed, truth.number])
        healthy = _of_the_baselines(truth.number, seed)
        self._common = {law.name: (*self.rng.standard_normal(2).tolist(), healthy) for law in laws}

    def at(self, usage: float) -> Inspection:
        """Return what an inspection at a use says."""
        severity = float(self.truth.life.at(usage)[0])
        seen = {
            law.key: seen_as(
                law,
                severity if law.name == self.truth.law else 0.0,
                self._common[law.name],
                self.rng,
            )
            for law in self._laws
        }
        values = self._values(usage) if self._measured else {}
        return Inspection(usage, seen, name=f"{usage:.0f}", measured=values)

    def _values(self, usage: float) -> dict[str, Measured]:
        """Return what the unit shows of its requirements on that day."""
        assert self.truth.response is not None
        response = self.truth.response
        values = response.measured(np.atleast_1d(self.truth.life.at(usage))[None, :])[:, 0]
        measured = {}
        for requirement, value in zip(response.requirements, values, strict=True):
            day = VALUES.get(requirement.measure, 0.0) * float(value)
            if day > 0.0:
                drawn = float(value + day * self._of_values.standard_normal())
                measured[requirement.name] = Measured(drawn, day)
        return measured


def seen_as(
    law: Law, severity: float, common: tuple[float, float, float], rng: np.random.Generator
) -> Seen:
    """Return what a diagnosis says, read as `elevon predict` reads it, its edges included."""
    drawn = INSPECTIONS[law.name]
    estimate = drawn.estimate_of(severity, common, rng)
    data: dict[str, Any] = {"faults": [], "detectable": {law.key: drawn.detectable}}
    if estimate >= drawn.seen:
        edge = max(c.high for c in CANDIDATES if c.kind == law.kind)
        value = min(estimate, edge)
        half = SIGMAS * float(drawn.stated(np.array(estimate)))
        cause = {"kind": law.kind, "place": law.place, "probability": 1.0, "severity": value,
                 "interval": [max(value - half, 0.0), min(value + half, edge)]}  # fmt: skip
        data["faults"].append(cause)
    return inspection(data, [law], usage=0.0).seen[law.key]
