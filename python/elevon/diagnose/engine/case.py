"""One log against its healthy unit: features, expectation, what each fault would do to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.detection import Detector
from elevon.diagnose.engine.healthy import Elsewhere, Healthy, healthy
from elevon.diagnose.engine.replay import Replay, logged_features, modelled, replay
from elevon.diagnose.positions.features import OWN_ERROR, SHARES, SIZES, FeatureVector
from elevon.diagnose.positions.log import RUN_IN

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

SUSPECT = 1e-3  # chance of a baseline below which it is called faulty
_SAME = 0.2  # relative difference of two logs' motion up to which they are one test
_NOTED = 0.02  # of two noted parameters
_SHARE = 3.0  # a unit's value over the model's, either way, that a shift is scaled by at most


#: Deviations that a fault moves the features by at least where its direction counts: what one
#: direction alone needs at 5 % of false alarms; a smaller fault is not called by itself.
_DIRECTED = 2.0


@dataclass(frozen=True)
class LogCase:
    """One log against its healthy unit, before whitening.

    Attributes
    ----------
    name : str
        The log.
    features : FeatureVector
        Of the log.
    unit : Healthy
        What a healthy unit would show.
    model : Replay
        What faults do to the features.
    findings : tuple of str
        What the log lacks, and baselines that were left out.
    """

    name: str
    features: FeatureVector
    unit: Healthy
    model: Replay
    findings: tuple[str, ...] = ()

    @property
    def covariance(self) -> Floats:
        """Of the healthy unit's features with this log's noise, shape (k, k)."""
        return self.unit.covariance + np.diag(self.features.std**2)

    @property
    def errors(self) -> Floats:
        """Model error of each number's shift on its own, as a share, shape (k,)."""
        return np.array([OWN_ERROR.get(name, 0.0) for name in self.unit.names])

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities, shape (m,), do to this unit's features, shape (m, k)."""
        at = [self.model.healthy.names.index(n) for n in self.unit.names]
        out = self.model.shift(key, severity)[:, at]
        for k, name in enumerate(self.unit.names):
            unit_value, modelled = float(self.unit.mean[k]), float(self.model.healthy.values[at[k]])
            if name in SIZES:
                out[:, k] = np.hypot(max(unit_value, 0.0), out[:, k]) - max(unit_value, 0.0)
            elif name in SHARES and unit_value * modelled > 0.0:
                out[:, k] *= min(max(unit_value / modelled, 1.0 / _SHARE), _SHARE)
        return out

    def uncertainty(self, key: str, severity: float) -> Floats:
        """Return the deviation that a severity gives this unit's features, shape (k,)."""
        at = [self.model.healthy.names.index(n) for n in self.unit.names]
        return self.model.uncertainty(key, severity)[at]


#: Features that only a measured torque current gives.
_OF_THE_CURRENT = frozenset(
    ["dry_current", "viscous_current", "inertia_current", "brake_current", "current_order_1",
     "current_order_2", "current_shaft", "current_sideband", "voltage_per_current"]
)  # fmt: skip


def case_of(
    item: Log,
    actuator: Actuator,
    candidates: Sequence[CandidateFault],
    baselines: Sequence[Log],
) -> LogCase:
    """Hold a log against the model and the baselines."""
    features = logged_features(item, actuator)
    same = [b for b in baselines if _same_test(item, b)]
    model = replay(item, actuator, candidates, same)
    references = [(b.name, _transferred(b, actuator, model.healthy)) for b in same]
    names = [n for n in features.names if n in model.healthy.names]
    names = [n for n in names if all(n in e.names for _, e in references)]
    if any(not log.has("torque_current") for log in (item, *same)):
        # A set point has the derivative's spikes, which the motor's current never follows.
        names = [n for n in names if n not in _OF_THE_CURRENT]
    elsewhere = [
        Elsewhere(logged_features(b, actuator), modelled(b, actuator))
        for b in baselines
        if all(b is not s for s in same) and b.has("torque_current") and not b.brake.unknown
    ]
    unknown = item.brake.unknown
    sound, findings = _sound(model, names, references, candidates, brake_unknown=unknown)
    findings += _lost(item, same)
    if features.floats:
        findings.append(
            f"{item.name}: the output is not carried through its backlash by friction but flies in "
            "it on its own; "
            "the backlash is read from the width of the two positions' difference"
        )
    unit = healthy(model, names, sound, elsewhere, brake_unknown=unknown)
    return LogCase(item.name, features.only(names), unit, model, tuple(findings))


def _transferred(item: Log, actuator: Actuator, here: FeatureVector) -> FeatureVector:
    """Return a baseline's features, moved by what the model says of the two logs' commands."""
    features, there = logged_features(item, actuator), modelled(item, actuator)
    values = features.values.copy()
    for k, name in enumerate(features.names):
        if name in here.names and name in there.names and name not in SIZES:
            values[k] += float((here.only([name]).values - there.only([name]).values)[0])
    return replace(features, values=values)


def _same_test(a: Log, b: Log) -> bool:
    """Whether two logs are of one test: by their notes, else by brake, motion and speed."""
    if a.brake.measured != b.brake.measured or a.brake.unknown != b.brake.unknown:
        return False
    notes = (a.note, b.note)
    if notes[0] is not None and notes[1] is not None and notes[0].waveform and notes[1].waveform:
        if notes[0].waveform != notes[1].waveform:
            return False
        first, second = notes[0].parameters, notes[1].parameters
        return all(_near(first[n], second[n], _NOTED) for n in first.keys() & second.keys())
    pairs = []
    for item in (a, b):
        pairs.append((float(np.std(item.output)), float(np.sqrt(np.mean(item.speed**2)))))
    return all(_near(x, y, _SAME) for x, y in zip(*pairs, strict=True))


def _near(a: float, b: float, share: float) -> bool:
    return abs(a - b) <= share * max(abs(a), abs(b))


def _sound(
    model: Replay,
    names: Sequence[str],
    references: Sequence[tuple[str, FeatureVector]],
    candidates: Sequence[CandidateFault],
    *,
    brake_unknown: bool,
) -> tuple[list[FeatureVector], list[str]]:
    """Leave out baselines that deviate from the model and from the other baselines, and say so.

    One that a candidate explains no better than none or another thing is not faulty: it shows
    how far the unit deviates from the model.
    """
    sound: list[FeatureVector] = []
    findings: list[str] = []
    for k, (name, features) in enumerate(references):
        others = [e for j, (_, e) in enumerate(references) if j != k]
        alone = _chance(model, names, features, [], candidates, brake_unknown=brake_unknown)
        pooled = alone
        if others:
            pooled = _chance(
                model, names, features, others, candidates, brake_unknown=brake_unknown
            )
        if max(alone, pooled) >= SUSPECT:
            sound.append(features)
            continue
        if not _faulty(model, names, features, candidates, brake_unknown=brake_unknown):
            sound.append(features)
            findings.append(
                f"baseline {name} deviates from the model by more than is assumed of a calibrated "
                "actuator file, and no fault explains it: it is taken as the healthy unit's"
            )
            continue
        reason = "it is unlike the other baselines"
        if not others:
            reason = "the actuator file is not calibrated to this unit"
        findings.append(
            f"baseline {name} looks faulty itself, or {reason} "
            f"(a healthy unit deviates as much in less than {100 * SUSPECT:g} % of logs); "
            "it is left out"
        )
    return sound, findings


def _faulty(
    model: Replay,
    names: Sequence[str],
    features: FeatureVector,
    candidates: Sequence[CandidateFault],
    *,
    brake_unknown: bool,
) -> bool:
    """Whether one fault is more probable than none, or than one that is no candidate."""
    from elevon.diagnose.engine.posterior import posterior

    case = LogCase(
        "", features.only(names), healthy(model, names, [], brake_unknown=brake_unknown), model
    )
    residual, covariance = joined([case])
    result = posterior(
        residual,
        covariance,
        case.unit.degrees,
        candidates,
        case.shift,
        errors=case.errors,
        uncertainty=case.uncertainty,
        pairs=False,
        other=True,
    )
    return result.faulty - result.other > 0.5


def _chance(
    model: Replay,
    names: Sequence[str],
    features: FeatureVector,
    others: Sequence[FeatureVector],
    candidates: Sequence[CandidateFault],
    *,
    brake_unknown: bool,
) -> float:
    case = LogCase(
        "", features.only(names), healthy(model, names, others, brake_unknown=brake_unknown), model
    )
    residual, root, detector = detector_of([case], candidates)
    return detector.chance(float(detector.score((root @ residual)[None, :])[0]))


def _lost(item: Log, same: Sequence[Log]) -> list[str]:
    """What a log lacks and what it costs."""
    findings = []
    if not same:
        findings.append(
            f"{item.name}: no baseline of this test: how far a healthy unit deviates from the "
            "model is assumed, small faults are not seen"
        )
    if not item.has("torque_current"):
        findings.append(
            f"{item.name}: no measured torque current (r78): friction, current ripple and faults "
            "of the drive's current loop and of current sensors are not seen"
        )
    if item.brake.unknown:
        findings.append(
            f"{item.name}: the brake acted and its torque is not known (no load-cell file, or no "
            "arm): friction is held against baselines of this test only"
        )
    if not item.has("torque_voltage"):
        findings.append(
            f"{item.name}: no voltage (r1733): shorts, eccentricity and lost flux are judged by "
            "the current's ripple alone"
        )
    if item.gain is None:
        findings.append(
            f"{item.name}: no waveform explains the command: drift of the position gain is not seen"
        )
    missing = 1.0 - float(np.mean(item.good[item.time >= RUN_IN]))
    if missing > 0.01:
        findings.append(f"{item.name}: {100 * missing:.0f} % of the samples are missing; left out")
    return findings


def detector_of(
    cases: Sequence[LogCase], candidates: Sequence[CandidateFault], anywhere: float = 0.0
) -> tuple[Floats, Floats, Detector]:
    """Return the deviation from healthy, what whitens it, and the test of healthy or not.

    `anywhere` is the share of the false alarms for what no candidate does. A shift shorter than
    `_SHOWN` has no direction that is known: the runs' rounding is as large, and another in each.
    """
    residual, covariance = joined(cases)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    rows, both = [], []
    for c in candidates:
        at = cases[0].model.severities[c.key]
        moved = shift_of(cases, c.key, at[at != 0.0]) @ root.T
        rows.append(moved[np.linalg.norm(moved, axis=1) >= _DIRECTED])
        both += [False] * len(rows[-1])
    degrees = min(case.unit.degrees for case in cases)
    return residual, root, Detector(np.vstack(rows), both, degrees, anywhere)


def joined(cases: Sequence[LogCase]) -> tuple[Floats, Floats]:
    """Stack the logs; what changes from run to run is independent between them."""
    from scipy.linalg import block_diag

    residual = np.concatenate([case.features.values - case.unit.mean for case in cases])
    return residual, np.asarray(block_diag(*[case.covariance for case in cases]))


def shift_of(cases: Sequence[LogCase], key: str, severity: Floats) -> Floats:
    """Return what severities, shape (m,), do to the features of all logs, shape (m, k)."""
    return np.hstack([case.shift(key, severity) for case in cases])


def uncertainty_of(cases: Sequence[LogCase], key: str, severity: float) -> Floats:
    """Return the deviation that a severity gives the features of all logs, shape (k,)."""
    return np.concatenate([case.uncertainty(key, severity) for case in cases])
