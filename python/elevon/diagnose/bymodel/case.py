"""One log against its healthy unit: evidence, expectation, what each fault would do to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.bymodel.candidates import Candidate
from elevon.diagnose.bymodel.detection import Detector
from elevon.diagnose.bymodel.evidence import OWN_ERROR, SHARES, SIZES, Evidence
from elevon.diagnose.bymodel.healthy import Elsewhere, Healthy, healthy
from elevon.diagnose.bymodel.log import TestLog
from elevon.diagnose.bymodel.replay import Replay, logged_evidence, modelled, replay

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Case", "case_of", "detector_of", "doubt_of", "joined", "shift_of"]

SUSPECT = 1e-3  # chance of a baseline below which it is called faulty
_SAME = 0.2  # relative difference of two logs' motion up to which they are one test
_NOTED = 0.02  # of two noted parameters
_SHARE = 3.0  # a unit's value over the model's, either way, that a shift is scaled by at most


#: Deviations that a fault moves the evidence by at least where its direction counts: what one
#: direction alone asks at 5 % of false alarms; a smaller fault is not called by itself.
_SHOWN = 2.0


@dataclass(frozen=True)
class Case:
    """One log against its healthy unit, before whitening.

    Attributes
    ----------
    name : str
        The log.
    shown : Evidence
        Of the log.
    unit : Healthy
        What a healthy unit would show.
    model : Replay
        What faults do to the evidence.
    """

    name: str
    shown: Evidence
    unit: Healthy
    model: Replay

    @property
    def covariance(self) -> Floats:
        """Of the healthy unit's evidence with this log's noise, shape (k, k)."""
        return self.unit.covariance + np.diag(self.shown.std**2)

    @property
    def errors(self) -> Floats:
        """Model error of each number's shift on its own, as a share, shape (k,)."""
        return np.array([OWN_ERROR.get(name, 0.0) for name in self.unit.names])

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities, shape (m,), do to this unit's evidence, shape (m, k)."""
        at = [self.model.healthy.names.index(n) for n in self.unit.names]
        out = self.model.shift(key, severity)[:, at]
        for k, name in enumerate(self.unit.names):
            own, modelled = float(self.unit.mean[k]), float(self.model.healthy.values[at[k]])
            if name in SIZES:
                out[:, k] = np.hypot(max(own, 0.0), out[:, k]) - max(own, 0.0)
            elif name in SHARES and own * modelled > 0.0:
                out[:, k] *= min(max(own / modelled, 1.0 / _SHARE), _SHARE)
        return out

    def doubt(self, key: str, severity: float) -> Floats:
        """Return the deviation that a severity gives this unit's evidence, shape (k,)."""
        at = [self.model.healthy.names.index(n) for n in self.unit.names]
        return self.model.doubt(key, severity)[at]


#: Evidence that only a measured torque current gives.
_OF_THE_CURRENT = frozenset(
    ["dry_current", "viscous_current", "inertia_current", "brake_current", "current_order_1",
     "current_order_2", "current_shaft", "current_sideband", "voltage_per_current"]
)  # fmt: skip


def case_of(
    item: TestLog,
    actuator: Actuator,
    candidates: Sequence[Candidate],
    baselines: Sequence[TestLog],
    findings: list[str],
) -> Case:
    """Hold a log against the model and the baselines; what it lacks goes to the findings."""
    shown = logged_evidence(item, actuator)
    same = [b for b in baselines if _same_test(item, b)]
    model = replay(item, actuator, candidates, same)
    proofs = [(b.name, _as_here(b, actuator, model.healthy)) for b in same]
    names = [n for n in shown.names if n in model.healthy.names]
    names = [n for n in names if all(n in e.names for _, e in proofs)]
    if any(log.log.current_signal == "current_ref" for log in (item, *same)):
        # A set point has the derivative's spikes, which the motor's current never follows.
        names = [n for n in names if n not in _OF_THE_CURRENT]
    elsewhere = [
        Elsewhere(logged_evidence(b, actuator), modelled(b, actuator))
        for b in baselines
        if all(b is not s for s in same) and b.log.current_signal != "current_ref" and not b.held
    ]
    sound = _sound(model, names, proofs, candidates, findings, held=item.held)
    _lost(item, same, findings)
    if shown.floats:
        findings.append(
            f"{item.name}: the output is not carried through its backlash by friction but flies in "
            "it on its own; "
            "the backlash is read from the width of the two positions' difference"
        )
    unit = healthy(model, names, sound, elsewhere, held=item.held)
    return Case(item.name, shown.only(names), unit, model)


def _as_here(item: TestLog, actuator: Actuator, here: Evidence) -> Evidence:
    """Return a baseline's evidence, moved by what the model says of the two logs' commands."""
    shown, there = logged_evidence(item, actuator), modelled(item, actuator)
    values = shown.values.copy()
    for k, name in enumerate(shown.names):
        if name in here.names and name in there.names and name not in SIZES:
            values[k] += float((here.only([name]).values - there.only([name]).values)[0])
    return replace(shown, values=values)


def _same_test(a: TestLog, b: TestLog) -> bool:
    """Whether two logs are of one test: by their notes, else brake, travel and speed alike."""
    if a.braked != b.braked or a.held != b.held:
        return False
    notes = (a.log.note, b.log.note)
    if notes[0] is not None and notes[1] is not None and notes[0].waveform and notes[1].waveform:
        if notes[0].waveform != notes[1].waveform:
            return False
        first, second = notes[0].parameters, notes[1].parameters
        return all(_near(first[n], second[n], _NOTED) for n in first.keys() & second.keys())
    pairs = []
    for item in (a, b):
        assert item.log.output is not None
        pairs.append((float(np.std(item.log.output)), float(np.sqrt(np.mean(item.log.speed**2)))))
    return all(_near(x, y, _SAME) for x, y in zip(*pairs, strict=True))


def _near(a: float, b: float, share: float) -> bool:
    return abs(a - b) <= share * max(abs(a), abs(b))


def _sound(
    model: Replay,
    names: Sequence[str],
    proofs: Sequence[tuple[str, Evidence]],
    candidates: Sequence[Candidate],
    findings: list[str],
    *,
    held: bool,
) -> list[Evidence]:
    """Leave out baselines that stand off the model and off the other baselines alike.

    One that a weighed fault explains no better than none or another thing is not faulty: it says
    how far the unit stands off the model.
    """
    sound = []
    for k, (name, shown) in enumerate(proofs):
        others = [e for j, (_, e) in enumerate(proofs) if j != k]
        alone = _chance(model, names, shown, [], candidates, held=held)
        beside = alone
        if others:
            beside = _chance(model, names, shown, others, candidates, held=held)
        if max(alone, beside) >= SUSPECT:
            sound.append(shown)
            continue
        if not _faulty(model, names, shown, candidates, held=held):
            sound.append(shown)
            findings.append(
                f"baseline {name} stands off the model further than is assumed of a calibrated "
                "set, and no fault explains it: what it shows is held to be the healthy unit's"
            )
            continue
        findings.append(
            f"baseline {name} looks faulty itself, or {'' if others else 'the set is not '}"
            f"{'unlike the other baselines' if others else 'calibrated to this unit'} "
            f"(a healthy unit deviates as much in less than {100 * SUSPECT:g} % of logs); "
            "it is left out"
        )
    return sound


def _faulty(
    model: Replay,
    names: Sequence[str],
    shown: Evidence,
    candidates: Sequence[Candidate],
    *,
    held: bool,
) -> bool:
    """Whether one fault is more probable than none, or than one that is not weighed."""
    from elevon.diagnose.bymodel.posterior import posterior

    case = Case("", shown.only(names), healthy(model, names, [], held=held), model)
    rest, covariance = joined([case])
    result = posterior(
        rest,
        covariance,
        case.unit.degrees,
        candidates,
        case.shift,
        errors=case.errors,
        doubt=case.doubt,
        pairs=False,
        other=True,
    )
    return result.faulty - result.other > 0.5


def _chance(
    model: Replay,
    names: Sequence[str],
    shown: Evidence,
    others: Sequence[Evidence],
    candidates: Sequence[Candidate],
    *,
    held: bool,
) -> float:
    case = Case("", shown.only(names), healthy(model, names, others, held=held), model)
    rest, root, detector = detector_of([case], candidates)
    return detector.chance(float(detector.score((root @ rest)[None, :])[0]))


def _lost(item: TestLog, same: Sequence[TestLog], findings: list[str]) -> None:
    """Say what a log lacks and what it costs."""
    if not same:
        findings.append(
            f"{item.name}: no baseline of this test: how far a healthy unit stands off the model "
            "is assumed, small faults are not seen"
        )
    if item.log.current_signal == "current_ref":
        findings.append(
            f"{item.name}: no measured torque current (r78): friction, current ripple and faults "
            "of the drive's current loop and of current sensors are not seen"
        )
    if item.held:
        findings.append(
            f"{item.name}: the brake acted and its torque is not known (no load-cell file, or no "
            "arm): friction is held against baselines of this test only"
        )
    if item.voltage is None:
        findings.append(
            f"{item.name}: no voltage (r1733): shorts, eccentricity and lost flux are judged by "
            "the current's ripple alone"
        )
    if item.gain is None:
        findings.append(
            f"{item.name}: no waveform explains the command: drift of the position gain is not seen"
        )
    missing = 1.0 - float(np.mean(item.log.good))
    if missing > 0.01:
        findings.append(f"{item.name}: {100 * missing:.0f} % of the samples are missing; left out")


def detector_of(
    cases: Sequence[Case], candidates: Sequence[Candidate], anywhere: float = 0.0
) -> tuple[Floats, Floats, Detector]:
    """Return the deviation from healthy, what whitens it, and the test of healthy or not.

    `anywhere` is the share of the false alarms for what no candidate does. A shift shorter than
    `_SHOWN` has no direction that is known: the runs' rounding is as large, and another in each.
    """
    rest, covariance = joined(cases)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    rows, both = [], []
    for c in candidates:
        at = cases[0].model.severities[c.key]
        moved = shift_of(cases, c.key, at[at != 0.0]) @ root.T
        rows.append(moved[np.linalg.norm(moved, axis=1) >= _SHOWN])
        both += [False] * len(rows[-1])
    degrees = min(case.unit.degrees for case in cases)
    return rest, root, Detector(np.vstack(rows), both, degrees, anywhere)


def joined(cases: Sequence[Case]) -> tuple[Floats, Floats]:
    """Stack the logs; what changes from run to run is independent between them."""
    from scipy.linalg import block_diag

    rest = np.concatenate([case.shown.values - case.unit.mean for case in cases])
    return rest, np.asarray(block_diag(*[case.covariance for case in cases]))


def shift_of(cases: Sequence[Case], key: str, severity: Floats) -> Floats:
    """Return what severities, shape (m,), do to the evidence of all logs, shape (m, k)."""
    return np.hstack([case.shift(key, severity) for case in cases])


def doubt_of(cases: Sequence[Case], key: str, severity: float) -> Floats:
    """Return the deviation that a severity gives the evidence of all logs, shape (k,)."""
    return np.concatenate([case.doubt(key, severity) for case in cases])
