"""A spall named by an accelerometer: whether, where, how long, how surely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import Cause, Diagnosis, Explanation, FaultPlace, Moved
from elevon.diagnose.signs import Sign, joined_signs
from elevon.experiment import Experiment, Inputs, Variant
from elevon.features.envelope import EnvelopeOrders, ball_passes, envelope_orders
from elevon.logs.command.curve import command_curve

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.features.envelope import EnvelopeOrders
    from elevon.logs.log import Log

KIND = "spall"
NEEDED = ("vibration", "motor_position", "command")
_FASTER = 4.0  # samples a period of the structure: a slower log is none of an accelerometer
_BAND = (0.6, 1.6)  # of the structure's frequency
_SMOOTH = 2e-3  # s over which a load is averaged for the model's run


def shows_passes(log: Log, actuator: Actuator) -> bool:
    """Tell whether a log has an accelerometer, fast enough, of a screw that may have a spall."""
    known = actuator.parameters
    if "screw.spall_nut" not in known or not log.has(*NEEDED):
        return False
    return 1.0 / log.period > _FASTER * known.value("vibration.frequency")


@dataclass(frozen=True)
class PassReading:
    """One log: its passes, those in the current, and its test on the model."""

    log: Log
    actuator: Actuator

    @property
    def orders(self) -> dict[str, float]:
        """Passes a turn of the motor by place."""
        value = self.actuator.parameters.value
        return ball_passes(
            value("screw.balls_per_turn"), value("screw.ball_diameter"),
            value("screw.pitch_diameter"), value("screw.contact_angle"), value("gear.ratio"),
        )  # fmt: skip

    def of(self, log: Log) -> EnvelopeOrders:
        """Return the accelerometer's passes of a log, or of a run on a log's channels."""
        frequency = self.actuator.parameters.value("vibration.frequency")
        band = (_BAND[0] * frequency, min(_BAND[1] * frequency, 0.45 / log.period))
        rate = 1.0 / log.period
        return envelope_orders(
            log["motor_position"], log["vibration"], rate, self.orders, band=band
        )

    def measured(self) -> EnvelopeOrders:
        """Return the log's own."""
        return self.of(self.log)

    def of_current(self) -> EnvelopeOrders | None:
        """Return the passes in the torque current, which has no structure to ring."""
        if not self.log.has("torque_current"):
            return None
        log = self.log
        return envelope_orders(
            log["motor_position"], log["torque_current"], 1.0 / log.period, self.orders
        )

    def simulated(self, place: str, sizes: Sequence[float]) -> list[EnvelopeOrders]:
        """Return what spalls of some lengths [m] show in the same test: runs of the model."""
        log = self.log
        loads = (
            {"output": (log.time, _averaged(log["load"], log.period))} if log.has("load") else {}
        )
        inputs = Inputs(
            log.duration, "position", command=command_curve(log).points, loads=loads,
            initial=_begin(log, self.actuator),
        )  # fmt: skip
        stand = {**log.stand.parameters, "vibration.model": "resonance"}
        ready = self.actuator.with_values(stand, source="stand of the log", place=log.name)
        shows = {"vibration": "vibration", "motor_position": "motor_position"}
        test = Experiment(log, ready, inputs, shows, period=log.period, fidelity="high")
        runs = test.run([Variant(faults=(f"{KIND}@{place}={size!r}",)) for size in sizes])
        return [self.of(run.log) for run in runs]


def _averaged(values: Floats, period: float) -> Floats:
    width = max(1, round(_SMOOTH / period))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _begin(log: Log, actuator: Actuator) -> dict[str, float]:
    value = actuator.parameters.value
    at = float(log["command"][0])
    turned = at * value("gear.ratio") / value("screw.lead")
    return {} if at == 0.0 else {"motor_position": turned, "output_position": at}


_SIZES = tuple(np.geomspace(1e-4, 5e-3, 24).tolist())
"""m; up to where the catalogue ends."""
_GRID = 400
_MODEL = 0.1
"""Deviation of each of the model's lines, as a share of their RMS: the structure; ASSUMED."""
_MOUNT = 0.15
"""The same, of all lines alike: how the sensor is mounted; ASSUMED."""
_PRIOR = 0.02
"""Of any spall, before the log; ASSUMED."""
_INTERVAL = (0.05, 0.5, 0.95)
_NAMED = 0.05  # probability from which on a place is told


@dataclass(frozen=True)
class PassEvidence:
    """What the logs say together: score, chance and probability by place."""

    scores: dict[str, float]
    chances: dict[str, float]
    probabilities: dict[str, float]

    @property
    def best(self) -> str:
        """The place whose passes stand out most."""
        return max(self.scores, key=self.scores.__getitem__)

    @property
    def chance(self) -> float:
        """How often noise alone gives one of the places as high a score."""
        least = min(self.chances.values())
        return float(1.0 - (1.0 - least) ** len(self.chances))


def evidence_of(measured: Sequence[EnvelopeOrders]) -> PassEvidence:
    """Return the evidence of logs.

    Under noise the score of a place over its lines is an F variable: the level is known from some
    lines only. A spall's line adds to it what its
    amplitudes are worth; of unknown amplitude it is the likelihood at the best one, with half a
    unit off for each line (as Akaike's).
    """
    from scipy.stats import f

    places = list(measured[0].power)
    count = sum(item.count for item in measured)
    scores = {place: sum(item.score(place) for item in measured) for place in places}
    freedom = 2.0 * sum(item.levels for item in measured)
    chances = {
        place: float(f.sf(score / count, 2.0 * count, freedom)) for place, score in scores.items()
    }
    gain = np.array([score - count * (1.0 + np.log(score / count)) for score in scores.values()])
    gain = np.where(np.array(list(scores.values())) > count, gain - 1.0, -np.inf)
    logs = np.concatenate(([np.log(1.0 - _PRIOR)], np.log(_PRIOR / len(places)) + gain))
    shares = np.exp(logs - np.logaddexp.reduce(logs))
    return PassEvidence(scores, chances, dict(zip(places, shares[1:].tolist(), strict=True)))


def size_of(
    measured: Sequence[EnvelopeOrders], simulated: Sequence[Sequence[EnvelopeOrders]], place: str
) -> tuple[float, float, float]:
    """Return 5 %, median and 95 % of a spall's length [m], flat before in its logarithm.

    Parameters
    ----------
    measured : sequence of EnvelopeOrders
        Logs.
    simulated : sequence of sequence of EnvelopeOrders
        The model's runs of each log's test, at `_SIZES`.
    place : str
        Where the spall is.
    """
    sizes = np.geomspace(_SIZES[0], _SIZES[-1], _GRID)
    total = np.zeros(_GRID)
    for log, runs in zip(measured, simulated, strict=True):
        table = np.array([run.amplitudes(place) for run in runs])
        model = np.array([np.interp(np.log(sizes), np.log(_SIZES), column) for column in table.T]).T
        total += _likelihood(log.amplitudes(place), model, log.deviations())
    weights = np.exp(total - total.max())
    low, middle, high = _quantiles(sizes, weights)
    return low, middle, high


def _likelihood(measured: Floats, model: Floats, noise: Floats) -> Floats:
    """Logarithm of the likelihood of amplitudes, shape (h,), under rows of a model's, (n, h).

    Deviations: noise, the model's own, and a factor on all lines alike (Sherman and Morrison).
    """
    size = np.linalg.norm(model, axis=1)[:, None] / np.sqrt(model.shape[1])
    deviation = np.hypot(noise, _MODEL * size)
    off, along = (measured - model) / deviation, _MOUNT * model / deviation
    stretch = 1.0 + np.sum(along**2, axis=1)
    square = np.sum(off**2, axis=1) - np.sum(off * along, axis=1) ** 2 / stretch
    volume = np.sum(np.log(deviation), axis=1) + 0.5 * np.log(stretch)
    return np.asarray(-0.5 * square - volume)


def _quantiles(sizes: Floats, weights: Floats) -> list[float]:
    share = np.cumsum(weights) / np.sum(weights)
    return [float(np.interp(q, share, sizes)) for q in _INTERVAL]


def spall_sign(logs: Sequence[Log], actuator: Actuator, rate: float) -> tuple[Sign | None, str]:
    """Return the sign of a spall, or None where the accelerometer hears none, and a finding.

    Parameters
    ----------
    logs : sequence of Log
        Each with an accelerometer (`shows_passes`).
    actuator : Actuator
        The healthy unit.
    rate : float
        At which a healthy unit may be called spalled.

    Raises
    ------
    ValueError
        A log without two turns in one direction.
    """
    readings = [PassReading(log, actuator) for log in logs]
    measured = [reading.measured() for reading in readings]
    evidence = evidence_of(measured)
    if evidence.chance > rate:
        return None, f"accelerometer: no spall (chance of noise alone {evidence.chance:.2g})"
    place = evidence.best
    simulated = [reading.simulated(place, _SIZES) for reading in readings]
    low, size, high = size_of(measured, simulated, place)
    probability = evidence.probabilities[place]
    cause = Cause(KIND, place, "m", probability, size, (low, high), _ambiguous(evidence, place))
    present = sum(evidence.probabilities.values())
    note = _current(readings, place)
    return Sign(cause, present, ("vibration",), note), note


def diagnose_spall(logs: Sequence[Log], actuator: Actuator, rate: float) -> Diagnosis:
    """Return the answer of an accelerometer alone; parameters as those of `spall_sign`.

    Raises
    ------
    ValueError
        A log without two turns in one direction.
    """
    sign, note = spall_sign(logs, actuator, rate)
    heard = [(log, PassReading(log, actuator).measured()) for log in logs]
    evidence = evidence_of([orders for _, orders in heard])
    features = _features(heard, "" if sign is None else sign.cause.place)
    if sign is not None:
        joined = joined_signs(logs, [sign], rate, None)
        findings = (*joined.findings, _ONLY)
        return replace(joined, features=features, chance=evidence.chance, findings=findings)
    share = sum(evidence.probabilities.values())
    return Diagnosis(
        logs=tuple(log.name for log in logs), status="healthy", p_fault=share, false_alarm=rate,
        chance=evidence.chance, faults=(), best=(), p_best=1.0 - share, unobservable=(),
        detectable={}, features=features, findings=(note, _ONLY), seconds=0.0,
        hypotheses=(Explanation((), 1.0 - share),),
        severity_units={f"{KIND}@{place}": "m" for place in evidence.scores},
    )  # fmt: skip


def _ambiguous(evidence: PassEvidence, place: str) -> tuple[FaultPlace, ...]:
    return tuple(
        FaultPlace(KIND, other)
        for other, share in evidence.probabilities.items()
        if other != place and share > _NAMED
    )


_ONLY = (
    "only the accelerometer was asked: for other faults diagnose the stand's slow logs, or give "
    "baselines of this test"
)


def _features(heard: Sequence[tuple[Log, EnvelopeOrders]], named: str) -> tuple[Moved, ...]:
    """The first line of each place, against noise."""
    rows = []
    for log, orders in heard:
        for place in orders.power:
            value, spread = float(orders.amplitudes(place)[0]), float(orders.deviations()[0])
            left = value if place == named else 0.0
            name = f"envelope at the passes of {place}"
            rows.append(Moved(log.name, name, "m/s2", value, 0.0, spread, left))
    return tuple(rows)


def _current(readings: Sequence[PassReading], place: str) -> str:
    currents = [orders for orders in (r.of_current() for r in readings) if orders is not None]
    if not currents:
        return "no torque current in the log"
    chance = evidence_of(currents).chances[place]
    verb = "shows" if chance < 0.01 else "does not show"
    return f"the torque current {verb} the passes of {place} (chance of noise alone {chance:.2g})"
