"""Diagnosis of logs of any actuator, by roles."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.case import SUSPECT, LogCase
from elevon.diagnose.engine.diagnosis import answer_of
from elevon.diagnose.positions.features import FeatureVector
from elevon.diagnose.roles.ambiguous import with_ambiguous
from elevon.diagnose.roles.candidates import candidates_of, not_modelled_of
from elevon.diagnose.roles.channels import driven, numbers_of_log
from elevon.diagnose.roles.healthy import healthy_of
from elevon.diagnose.roles.log import role_log
from elevon.diagnose.roles.noise import noise_of
from elevon.diagnose.roles.role_test import RoleTest, same_test
from elevon.diagnose.roles.runs import RoleReplay, replay_by_roles
from elevon.errors import InputError
from elevon.threads import one_blas_thread

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.diagnose.engine.candidates import CandidateFault
    from elevon.logs.log import Log

PAIRS = 16  # of faults at once that are scored
OWN_ERROR = (
    0.15  # of what a fault does to one number: the reduced-order model shows sizes, not waveforms
)


@dataclass(frozen=True)
class RoleCase(LogCase):
    """A log's numbers against a healthy unit's."""

    @property
    def errors(self) -> Floats:
        """Model error of each number's shift on its own, as a share, shape (k,)."""
        return np.full(len(self.unit.names), OWN_ERROR, dtype=np.float64)

    @cached_property
    def _places(self) -> list[int]:
        there = {name: k for k, name in enumerate(self.model.healthy.names)}
        return [there[name] for name in self.unit.names]

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities, shape (m,), do to the features, shape (m, k)."""
        return np.asarray(self.model.shift(key, severity)[:, self._places], dtype=np.float64)


@one_blas_thread()
def diagnose_by_roles(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    baselines: Sequence[Log] = (),
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
) -> Diagnosis:
    """Say what is wrong with the unit that wrote the logs: which fault or pair of faults.

    Parameters
    ----------
    logs, baselines : sequence of Log
        Of one unit in one condition, and of the healthy unit.
    actuator : Actuator
        The healthy unit.
    faults : sequence of str, optional
        ``KIND@PLACE`` of the candidates; default: the catalogue, as far as the reduced-order model
        has it.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.

    Raises
    ------
    InputError
        No log, a log without command or too short, a rate outside 0 to 1.
    """
    begin = clock.perf_counter()
    if not logs:
        raise InputError("diagnosis needs at least one log")
    if not 0.0 < false_alarm < 1.0:
        raise InputError(f"false-alarm rate {false_alarm:g} must be between 0 and 1")
    candidates = candidates_of(actuator, faults)
    healthy = [role_log(log, actuator) for log in baselines]
    cases = [_case(role_log(log, actuator), actuator, candidates, healthy) for log in logs]
    result = answer_of(cases, candidates, false_alarm, most=PAIRS)
    result = with_ambiguous(result, cases, candidates)
    blind = (*result.unobservable, *(not_modelled_of(actuator) if not faults else ()))
    return replace(result, unobservable=blind, seconds=clock.perf_counter() - begin)


def _case(
    item: RoleTest,
    actuator: Actuator,
    candidates: Sequence[CandidateFault],
    baselines: Sequence[RoleTest],
) -> RoleCase:
    """Hold a log against its baselines, each read as far as the shortest of them goes."""
    same = [b for b in baselines if same_test(item, b)]
    seconds = min(log.seconds for log in (item, *same))
    item, *same = [log.within(seconds) for log in (item, *same)]
    model = replay_by_roles(same[0] if same else item, actuator, candidates)
    features = _features(item, actuator)
    references = [(b.name, _features(b, actuator)) for b in same]
    names = [
        name
        for name in model.healthy.names
        if name in features.names and all(name in e.names for _, e in references)
    ]
    findings = list(item.findings)
    if driven(item, actuator):
        findings.append(
            f"{item.name}: the load drives the output part of the time and holds it at one end of "
            "its backlash, where the reduced-order model has it carried by friction: backlash may "
            "be named as something else, "
            "and its limit does not hold"
        )
    if not same:
        findings.append(
            f"{item.name}: no baseline of this test, commanded and loaded alike and about as long "
            "at least: how far a healthy unit deviates from the model is assumed, small faults are "
            "not seen"
        )
    sound, left_out = _sound(model, names, references)
    unit = healthy_of(model, names, sound)
    return RoleCase(item.name, features.only(names), unit, model, (*findings, *left_out))


def _features(item: RoleTest, actuator: Actuator) -> FeatureVector:
    """Numbers of a log, and their deviation by its noise."""
    features = numbers_of_log(item, actuator, item.seen).values
    std = noise_of(item, actuator, features)
    return FeatureVector(tuple(features), np.array(list(features.values())), std)


def _sound(
    model: RoleReplay,
    names: Sequence[str],
    references: Sequence[tuple[str, FeatureVector]],
) -> tuple[list[FeatureVector], list[str]]:
    """Leave out baselines that deviate from the model and from the other baselines, and say so."""
    sound: list[FeatureVector] = []
    findings: list[str] = []
    for k, (name, features) in enumerate(references):
        others = [e for j, (_, e) in enumerate(references) if j != k]
        chance = _chance(model, names, features, [])
        if chance < SUSPECT and others:
            chance = _chance(model, names, features, others)
        if chance >= SUSPECT:
            sound.append(features)
            continue
        findings.append(
            f"baseline {name} looks faulty itself, or the actuator file is not calibrated to this "
            f"unit (a healthy unit deviates as much in less than {100 * SUSPECT:g} % of logs); "
            "it is left out"
        )
    return sound, findings


def _chance(
    model: RoleReplay,
    names: Sequence[str],
    features: FeatureVector,
    others: Sequence[FeatureVector],
) -> float:
    """How often a healthy unit deviates as much, in all numbers together or in one of them."""
    from scipy.special import fdtrc, stdtr

    unit = healthy_of(model, names, others)
    residual = features.only(names).values - unit.mean
    wide = unit.covariance + np.diag(features.only(names).std ** 2)
    square = float(residual @ np.linalg.solve(wide, residual)) / len(residual)
    together = float(fdtrc(len(residual), unit.degrees, square))
    most = float(np.max(np.abs(residual) / np.sqrt(np.diag(wide))))
    alone = 1.0 - (1.0 - 2.0 * float(stdtr(unit.degrees, -most))) ** len(residual)
    return min(2.0 * min(together, alone), 1.0)
