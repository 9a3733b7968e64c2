"""Information that a test is expected to give on which set of faults is there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.bench.loaded import loaded_setups, run_loaded
from elevon.bench.procedure import (
    POSITION,
    BrakeStep,
    ForceStep,
    Procedure,
    SettingsStep,
    TraceStep,
    load_procedure,
    standard_tests,
)
from elevon.bench.rig import setups
from elevon.bench.stand import stand_of
from elevon.bench.traces import first_trace, recorded, traced
from elevon.calibrate.door import turns
from elevon.diagnose.by_model import reading_of
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.case import LogCase
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.likelihood import Frame
from elevon.diagnose.engine.replay import replay
from elevon.logs.log import Log
from elevon.nexttest.belief import Belief, Possible
from elevon.scenario.compile import signal_records
from elevon.simulate import Run, simulate_batch
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elevon.actuator import Actuator


@dataclass(frozen=True)
class BenchProfile:
    """A test.

    Attributes
    ----------
    name : str
        ``PROCEDURE``, or ``PROCEDURE:VARIANT``.
    procedure : Procedure
        One trace.
    parameters : mapping of str to str
        What sets it: command and brake.
    standard : bool
        Whether it is the bench's own: a healthy log of it is taken to be at hand.
    """

    name: str
    procedure: Procedure
    parameters: Mapping[str, str] = field(default_factory=dict)
    standard: bool = True

    @property
    def duration(self) -> float:
        """Length of its log [s]."""
        return parse_quantity(self.procedure.traces[-1].duration, "s", "duration")


#: Variant to procedure, and values of its command and of its brake that differ. ASSUMED: within
#: the motor's 500 rpm, the stops and the brake's 5.5 N m.
_VARIANTS: Mapping[str, tuple[str, Mapping[str, str], Mapping[str, str]]] = {
    "backlash:slow": ("backlash", {"frequency": "0.1 Hz"}, {}),
    "backlash:fast": ("backlash", {"frequency": "0.45 Hz"}, {}),
    "loaded:heavy": ("loaded", {}, {"initial": "1 N m", "slope": "0.125 N m/s"}),
    "loaded:fast": ("loaded", {"frequency": "0.1 Hz", "amplitude": "25 deg"}, {}),
}
_STANDARD = ("backlash", "chirp", "loaded")


def profiles(actuator: Actuator | None = None) -> tuple[BenchProfile, ...]:
    """Return the tests in the order of the bench's list, variants after them.

    The bench's other procedures command a torque, not a position, or are there for temperatures:
    diagnosis does not read their logs.

    Parameters
    ----------
    actuator : Actuator, optional
        What stands on the bench; default: a turning servo, whose tests alone have variants.
    """
    if actuator is not None and not turns(actuator):
        return tuple(
            BenchProfile(test.name, test.procedure, _parameters(test.procedure))
            for test in standard_tests(actuator)
        )
    out = []
    for name in _STANDARD:
        procedure = first_trace(load_procedure(name))
        out.append(BenchProfile(name, procedure, _parameters(procedure)))
    for name, (base, command, brake) in _VARIANTS.items():
        procedure = _varied(first_trace(load_procedure(base)), command, brake)
        out.append(BenchProfile(name, procedure, _parameters(procedure), standard=False))
    return tuple(out)


def _varied(
    procedure: Procedure, command: Mapping[str, str], brake: Mapping[str, str]
) -> Procedure:
    data = procedure.model_dump(exclude_unset=True, mode="json")
    for step in data["step"]:
        if step["kind"] == "trace":
            step["command"]["terms"][0].update(command)
        elif step["kind"] == "brake":
            step["terms"][0].update(brake)
    return Procedure.model_validate(data)


def _parameters(procedure: Procedure) -> dict[str, str]:
    out: dict[str, str] = {}
    forces = [step for step in procedure.step if isinstance(step, ForceStep)]
    for step in procedure.step:
        if isinstance(step, TraceStep):
            if step.command.terms:
                out |= _stated("command", step.command.terms[0])
            for action in step.command.steps:
                out[f"action at {action.time}"] = str(action.action)
            out["duration"] = str(step.duration)
        elif isinstance(step, SettingsStep):
            out |= {path: str(value) for path, value in step.parameters.items()}
        elif isinstance(step, ForceStep) and step is forces[-1]:
            out |= _force(step)
        elif isinstance(step, BrakeStep) and step.terms:
            out |= _stated("brake", step.terms[0])
    return out


def _force(step: ForceStep) -> dict[str, str]:
    """What the load actuator is commanded."""
    out: dict[str, str] = {}
    if step.opposing:
        out["force.opposing"] = str(step.opposing)
    if step.stiffness:
        out["force.stiffness"] = str(step.stiffness)
    if step.forces:
        out["force.over the stroke"] = f"{min(step.forces):g} to {max(step.forces):g} N"
    if step.terms:
        out |= _stated("force", step.terms[0])
    return out


def _stated(prefix: str, term: object) -> dict[str, str]:
    values = term.model_dump(exclude_unset=True, mode="json")  # type: ignore[attr-defined]
    return {f"{prefix}.{name}": str(value) for name, value in values.items()}


_DRAWS = 200  # outcomes of a test
_SAMPLES = 64  # severities of a set of faults


def planned(
    profile: BenchProfile, actuator: Actuator, candidates: Sequence[CandidateFault]
) -> LogCase:
    """Return a test before it is run, as diagnosis by the model will see its log.

    A healthy log of a standard test is taken to be at hand; a variant's stands against the
    model alone.
    """
    item = reading_of(_healthy_log(profile, actuator), actuator)
    model = replay(item, candidates)
    names = [n for n in item.features.names if n in model.healthy.names]
    logged = item.features.only(names)
    unit = healthy(model, names, [logged] if profile.standard else [])
    return LogCase(profile.name, replace(logged, values=unit.mean), unit, model)


def _healthy_log(profile: BenchProfile, actuator: Actuator) -> Log:
    """Return what the healthy model's log of a test would be."""
    stand = stand_of(actuator.wiring)
    if stand.equipment != POSITION:
        loaded = loaded_setups(profile.procedure, actuator, stand, seed=0)[-1]
        return Log.of(run_loaded(loaded, "low")[0], profile.name)
    setup = setups(profile.procedure, actuator, seed=0)[0]
    record = recorded(list(signal_records(actuator.wiring, "low")))
    run = Run(setup.actuator, setup.scenario)
    return traced(setup, simulate_batch([run], fidelity="low", record=record)[0])


def _frame(
    case: LogCase, known: Mapping[str, CandidateFault], possible: Possible, severity: Floats
) -> Frame:
    """Return what whitens the features under a set of faults: the model's own errors with it."""
    plain = Frame(
        np.zeros(len(case.unit.names)), case.covariance, case.unit.degrees, case.shift,
        case.errors, case.uncertainty,
    )  # fmt: skip
    typical = [
        (known[key], centre if np.isfinite(deviation) else float(np.mean(severity[:, k])))
        for k, (key, centre, deviation) in enumerate(
            zip(possible.keys, possible.centre, possible.deviation, strict=True)
        )
    ]
    return plain.loosened(typical) if typical else plain


def _seen(
    case: LogCase, belief: Belief, number: int, count: int, seed: int
) -> tuple[Frame, Floats, list[Floats]]:
    """Frame, whitened shift of drawn severities, shape (count, k), and each fault's model error.

    `number` is that of the set of faults.
    """
    possible = belief.possible[number]
    rng = np.random.default_rng([seed, len(possible.keys)])
    severity = possible.severities(count, rng, belief.known)
    frame = _frame(case, belief.known, possible, severity)
    total, errors = np.zeros((count, len(case.unit.names))), []
    for k, key in enumerate(possible.keys):
        moved = frame.shift(key, severity[:, k])
        total += moved
        errors.append(belief.known[key].error * moved)
    return frame, total, errors


def _likelihoods(case: LogCase, belief: Belief, outcomes: Floats) -> Floats:
    """Log likelihood of outcomes less the healthy unit, shape (n, k), per set, shape (n, sets)."""
    columns = []
    for number, possible in enumerate(belief.possible):
        count = _SAMPLES if possible.keys else 1
        frame, shift, errors = _seen(case, belief, number, count, number)
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
    outcomes, sets, exact = [], [], []
    for number in np.unique(drawn):
        count = int((drawn == number).sum())
        draw_seed = int(rng.integers(2**31))
        frame, shift, errors = _seen(case, belief, int(number), count, draw_seed)
        chi = np.sqrt(rng.chisquare(case.unit.degrees, count) / case.unit.degrees)
        noise = rng.standard_normal(shift.shape) / chi[:, None]
        outcome = shift + noise + sum(e * rng.standard_normal((count, 1)) for e in errors)
        outcomes.append(np.linalg.solve(frame.root, outcome.T).T)
        exact.append(frame.log(outcome - shift, *errors))
        sets += [number] * count
    log = _likelihoods(case, belief, np.vstack(outcomes))
    # Severities drawn anew may all miss the one of an outcome whose numbers leap with it.
    at = np.arange(len(sets)), np.array(sets)
    log[at] = np.logaddexp(log[at] + np.log(_SAMPLES), np.concatenate(exact)) - np.log(_SAMPLES + 1)
    mixed = np.logaddexp.reduce(log + np.log(weights), axis=1)
    return float(np.mean(log[at] - mixed) / np.log(2.0))


def likelihoods(case: LogCase, belief: Belief, values: Floats) -> Floats:
    """Return the log likelihood of each set, from values by `case.unit.names`."""
    return np.asarray(_likelihoods(case, belief, (values - case.unit.mean)[None, :])[0])


def updated(case: LogCase, belief: Belief, values: Floats) -> Belief:
    """Return what is believed after a test that showed these values, by `case.unit.names`."""
    log = likelihoods(case, belief, values)
    weights = np.array([p.weight for p in belief.possible]) * np.exp(log - log.max())
    return Belief.of(
        [replace(p, weight=float(w)) for p, w in zip(belief.possible, weights, strict=True)],
        belief.candidates,
    )
