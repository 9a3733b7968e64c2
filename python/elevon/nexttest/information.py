"""Information that a test is expected to give on which set of faults is there."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.bench.virtual import traced
from elevon.diagnose.engine.candidates import CANDIDATES, CandidateFault
from elevon.diagnose.engine.case import LogCase
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.likelihood import Frame
from elevon.diagnose.engine.replay import replay
from elevon.diagnose.positions.reading import PositionReading
from elevon.nexttest.belief import Belief, Possible

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elevon.actuator import Actuator
    from elevon.nexttest.profiles import BenchProfile

_DRAWS = 200  # outcomes of a test
_SAMPLES = 64  # severities of a set of faults
_KNOWN = {c.key: c for c in CANDIDATES}


def planned(
    profile: BenchProfile, actuator: Actuator, candidates: Sequence[CandidateFault]
) -> LogCase:
    """Return a test before it is run, as diagnosis by the model will see its log.

    A healthy log of a standard test is taken to be at hand; a variant's stands against the
    model alone.
    """
    from elevon.bench.rig import setups
    from elevon.bench.traces import recorded
    from elevon.scenario.compile import signal_records
    from elevon.simulate import Run, simulate_batch

    setup = setups(profile.procedure, actuator, seed=0)[0]
    record = recorded(list(signal_records(actuator.wiring, "low")))
    run = Run(setup.actuator, setup.scenario)
    recording = simulate_batch([run], fidelity="low", record=record)[0]
    item = PositionReading(traced(setup, recording), actuator)
    model = replay(item, candidates)
    names = [n for n in item.features.names if n in model.healthy.names]
    logged = item.features.only(names)
    unit = healthy(model, names, [logged] if profile.standard else [])
    return LogCase(profile.name, replace(logged, values=unit.mean), unit, model)


def _frame(case: LogCase, possible: Possible, severity: Floats) -> Frame:
    """Return what whitens the features under a set of faults: the model's own errors with it."""
    plain = Frame(
        np.zeros(len(case.unit.names)), case.covariance, case.unit.degrees, case.shift,
        case.errors, case.uncertainty,
    )  # fmt: skip
    typical = [
        (_KNOWN[key], centre if np.isfinite(deviation) else float(np.mean(severity[:, k])))
        for k, (key, centre, deviation) in enumerate(
            zip(possible.keys, possible.centre, possible.deviation, strict=True)
        )
    ]
    return plain.loosened(typical) if typical else plain


def _seen(
    case: LogCase, possible: Possible, count: int, seed: int
) -> tuple[Frame, Floats, list[Floats]]:
    """Frame, whitened shift of drawn severities, shape (count, k), and each fault's model error."""
    severity = possible.severities(count, np.random.default_rng([seed, len(possible.keys)]))
    frame = _frame(case, possible, severity)
    total, errors = np.zeros((count, len(case.unit.names))), []
    for k, key in enumerate(possible.keys):
        moved = frame.shift(key, severity[:, k])
        total += moved
        errors.append(_KNOWN[key].error * moved)
    return frame, total, errors


def _likelihoods(case: LogCase, belief: Belief, outcomes: Floats) -> Floats:
    """Log likelihood of outcomes less the healthy unit, shape (n, k), per set, shape (n, sets)."""
    columns = []
    for number, possible in enumerate(belief.possible):
        count = _SAMPLES if possible.keys else 1
        frame, shift, errors = _seen(case, possible, count, number)
        rows = [frame.log((frame.root @ y)[None, :] - shift, *errors) for y in outcomes]
        columns.append(np.logaddexp.reduce(np.array(rows), axis=1) - np.log(count))
    return np.stack(columns, axis=1)


def expected_information(case: LogCase, belief: Belief, seed: int = 0) -> float:
    """Return the information [bit] that a test is expected to give on the set of faults.

    Mutual information of set and outcome, by drawing outcomes: sets, severities, the unit's spread
    and the model's error.
    """
    rng = np.random.default_rng([seed, 15])
    weights = np.array([p.weight for p in belief.possible])
    drawn = rng.choice(len(weights), _DRAWS, p=weights)
    outcomes, sets = [], []
    for number in np.unique(drawn):
        count = int((drawn == number).sum())
        draw_seed = int(rng.integers(2**31))
        frame, shift, errors = _seen(case, belief.possible[number], count, draw_seed)
        chi = np.sqrt(rng.chisquare(case.unit.degrees, count) / case.unit.degrees)
        noise = rng.standard_normal(shift.shape) / chi[:, None]
        outcome = shift + noise + sum(e * rng.standard_normal((count, 1)) for e in errors)
        outcomes.append(np.linalg.solve(frame.root, outcome.T).T)
        sets += [number] * count
    log = _likelihoods(case, belief, np.vstack(outcomes))
    mixed = np.logaddexp.reduce(log + np.log(weights), axis=1)
    own_log = log[np.arange(len(sets)), sets]
    return float(np.mean(own_log - mixed) / np.log(2.0))


def likelihoods(case: LogCase, belief: Belief, values: Floats) -> Floats:
    """Return the log likelihood of each set, from values by `case.unit.names`."""
    return np.asarray(_likelihoods(case, belief, (values - case.unit.mean)[None, :])[0])


def updated(case: LogCase, belief: Belief, values: Floats) -> Belief:
    """Return what is believed after a test that showed these values, by `case.unit.names`."""
    log = likelihoods(case, belief, values)
    weights = np.array([p.weight for p in belief.possible]) * np.exp(log - log.max())
    return Belief.of(
        [replace(p, weight=float(w)) for p, w in zip(belief.possible, weights, strict=True)]
    )
