"""Diagnosis of logs of any actuator, by roles."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.diagnose.bymodel.case import Case
from elevon.diagnose.bymodel.diagnosis import answer_of
from elevon.diagnose.bymodel.evidence import Evidence
from elevon.diagnose.bymodel.healthy import DEGREES, Healthy
from elevon.diagnose.bymodel.replay import Replay
from elevon.diagnose.byroles.candidates import candidates_of, declined_of
from elevon.diagnose.byroles.log import RoleLog, evidence_of, role_log, same_test
from elevon.diagnose.byroles.runs import modelled, replay_by_roles
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.bymodel.answer import Diagnosis
    from elevon.diagnose.bymodel.candidates import Candidate
    from elevon.recording import Recording

__all__ = ["RoleCase", "diagnose_by_roles", "healthy_of"]

Floats = npt.NDArray[np.float64]
#: ASSUMED. Least deviation from day to day, and how far a healthy unit stands off the model
#: without a baseline: shares of a number, and of the largest number of its channel.
FLOOR, MISMATCH, LEAST = 0.01, 0.10, 0.002
#: Numbers of noise and of single moments repeat less well.
ROUGH, _ROUGH_ONES = 3.0, ("band_", "ripple", "kurtosis", "peak", "moving", "last")
OWN_ERROR = 0.30  # of what a fault does to one number: the low model shows sizes, not waveforms


@dataclass(frozen=True)
class RoleCase(Case):
    """A log's features against a healthy unit's."""

    @property
    def errors(self) -> Floats:
        """Model error of each number's shift on its own, as a share, shape (k,)."""
        return np.full(len(self.unit.names), OWN_ERROR, dtype=np.float64)

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities, shape (m,), do to the evidence, shape (m, k)."""
        at = [self.model.healthy.names.index(n) for n in self.unit.names]
        return np.asarray(self.model.shift(key, severity)[:, at], dtype=np.float64)


def diagnose_by_roles(
    logs: Sequence[tuple[str, Recording]],
    actuator: Actuator,
    *,
    baselines: Sequence[tuple[str, Recording]] = (),
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
) -> Diagnosis:
    """Say what is wrong with the unit that wrote the logs; single faults only.

    Parameters
    ----------
    logs, baselines : sequence of (str, Recording)
        Name and recording with roles: of one unit in one condition, and of the healthy unit.
    actuator : Actuator
        The healthy unit.
    faults : sequence of str, optional
        ``KIND@PLACE`` of the candidates; default: the catalogue, as far as the low model has it.
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
    _check_wiring(actuator)
    candidates = candidates_of(actuator, faults)
    findings: list[str] = []
    healthy = [role_log(recording, name) for name, recording in baselines]
    cases = [
        _case(role_log(recording, name), actuator, candidates, healthy, findings)
        for name, recording in logs
    ]
    result = answer_of(cases, candidates, false_alarm, findings, pairs=False)
    blind = (*result.unobservable, *(declined_of(actuator) if not faults else ()))
    return replace(result, unobservable=blind, seconds=clock.perf_counter() - begin)


def _check_wiring(actuator: Actuator) -> None:
    """Refuse an actuator that is asked by actions: its logs differ by when each action came."""
    from elevon import _core

    wiring = next(w for w in _core.wirings() if w["name"] == actuator.wiring)
    if wiring["actions"]:
        raise InputError(
            f"{actuator.name}: diagnosis by roles needs a position command; "
            f"{actuator.wiring!r} is commanded by actions ({', '.join(wiring['actions'])})"
        )


def _case(
    item: RoleLog,
    actuator: Actuator,
    candidates: Sequence[Candidate],
    baselines: Sequence[RoleLog],
    findings: list[str],
) -> RoleCase:
    shown = evidence_of(item.channels, item, actuator)
    model = replay_by_roles(item, actuator, candidates)
    same = [_moved(b, actuator, model) for b in baselines if same_test(item, b)]
    names = [
        name
        for name in model.healthy.names
        if name in shown.names and all(name in e.names for e in same)
    ]
    if not same:
        findings.append(
            f"{item.name}: no baseline of this test: how far a healthy unit stands off the model "
            "is assumed, small faults are not seen"
        )
    if item.lost:
        findings.append(f"{item.name}: too many samples missing, left out: {', '.join(item.lost)}")
    return RoleCase(
        item.name,
        shown.only(names),
        healthy_of(model, names, same, ["tracking_error", *item.channels]),
        model,
    )


def _moved(baseline: RoleLog, actuator: Actuator, model: Replay) -> Evidence:
    """Return a baseline's evidence, moved to the log's command by what the model shows of both."""
    shown = evidence_of(baseline.channels, baseline, actuator)
    own = modelled(baseline, actuator)
    names = [n for n in model.healthy.names if n in shown.names and n in own.names]
    step = model.healthy.only(names).values - own.only(names).values
    return Evidence(tuple(names), shown.only(names).values + step, np.zeros(len(names)))


def healthy_of(
    model: Replay, names: Sequence[str], same: Sequence[Evidence], roles: Sequence[str]
) -> Healthy:
    """Return the unit's expectation: the baselines' mean where there are any, else the model's."""
    at = [model.healthy.names.index(n) for n in names]
    draws = model.draws[:, at]
    mean = draws.mean(axis=0)
    if same:
        mean = np.array([e.only(names).values for e in same]).mean(axis=0)
    size = _sizes(names, mean, roles)
    own = np.cov(draws.T).reshape(len(at), len(at)) + np.diag((FLOOR * size) ** 2)
    more = own / len(same) if same else np.diag((MISMATCH * size) ** 2)
    return Healthy(tuple(names), mean, own + more, DEGREES, len(same), np.ones(len(at)))


def _sizes(names: Sequence[str], mean: Floats, roles: Sequence[str]) -> Floats:
    """Each number's own size, no less than a part of the largest of its channel.

    What has no unit of a channel (a kurtosis) is no smaller than one.
    """
    size = np.abs(mean)
    for role in roles:
        own = np.array([name.startswith(role) and "kurtosis" not in name for name in names])
        if own.any():
            size[own] = np.maximum(size[own], LEAST / FLOOR * size[own].max())
    plain = np.array(["kurtosis" in name for name in names])
    size[plain] = np.maximum(size[plain], 1.0)
    rough = np.array([any(word in name for word in _ROUGH_ONES) for name in names])
    return np.asarray(np.maximum(size, 1e-12) * np.where(rough, ROUGH, 1.0), dtype=np.float64)
