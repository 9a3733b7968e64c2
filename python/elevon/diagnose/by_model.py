"""Diagnosis by the model: what moved in a log, which fault moves it so, how far, how surely."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.door import turns
from elevon.diagnose.engine.candidates import chosen, not_candidates
from elevon.diagnose.engine.case import calibrated, case_of
from elevon.diagnose.engine.diagnosis import NEVER_SEEN, UNDECIDED, answer_of
from elevon.diagnose.engine.reading import ReplayUnit
from elevon.diagnose.pictures import Traces, named_faults
from elevon.diagnose.positions.closed_form import drive_signs
from elevon.diagnose.positions.reading import PositionReading
from elevon.diagnose.roles.log import role_log
from elevon.diagnose.signs import Sign, joined_signs, likely_signs
from elevon.diagnose.stand_sensors import stand_signs
from elevon.diagnose.vibration.answer import KIND, diagnose_spall, shows_passes, spall_sign
from elevon.errors import InputError
from elevon.experiment import Variant
from elevon.logs.clocks.clock_fit import clipped_share
from elevon.threads import one_blas_thread

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.diagnose.engine.reading import Reading
    from elevon.diagnose.engine.spread import LearnedSpread
    from elevon.logs.log import Log


_CURRENTS = ("torque_current", "current_ref", "supply_current")
_MISSING, _CLIPPED = 0.01, 0.05  # share of the samples
_TURN = 0.02  # s over which a position's change is held against a speed
_ALIKE = 0.95  # correlation of the same signal
_NEARER = 3.0  # times what a speed lacks of full correlation: another one is that speed
_PAIRS = 20_000  # samples that are held against each other, about
_APART = 10.0  # times the stated ratio of two positions, either way: beyond any sensor's gain


def check_sizes(log: Log, actuator: Actuator) -> None:
    """Refuse a log whose numbers cannot be this actuator's.

    Raises
    ------
    InputError
        More current than supply over resistance lets flow; positions whose ratio is another; a
        motor's speed that a current's column has.
    """
    _check_speed(log)
    known = actuator.parameters
    most = known.value("inverter.supply_voltage") / known.value("motor.winding_resistance")
    for role in _CURRENTS:
        size = float(np.nanmax(np.abs(log[role]), initial=0.0)) if log.has(role) else 0.0
        if size > most:
            raise InputError(
                f"{log.name}: {role} reaches {size:.4g} A, and no more than {most:.4g} A can flow "
                "(supply over the winding's resistance): another unit, or another column"
            )
    if log.has("motor_position", "output_position") and "screw.lead" in known:
        ratio = known.value("gear.ratio") if "gear.ratio" in known else 1.0
        stated = ratio / known.value("screw.lead")
        travels = [float(np.nanstd(log[r])) for r in ("motor_position", "output_position")]
        # A sensor that stands still is a fault for diagnosis, no column of another signal.
        seen = travels[0] / travels[1] if min(travels) > 0.0 else stated
        if not 1.0 / _APART < seen / stated < _APART:
            raise InputError(
                f"{log.name}: the motor turns {seen:.4g} rad a metre of the output, "
                f"{actuator.name} {stated:.4g}: swapped columns, or another unit"
            )


def _check_speed(log: Log) -> None:
    """Refuse a log whose motor speed is none, where a current is how its position changes."""
    place = next((r for r in ("motor_position", "output_position") if log.has(r)), None)
    if place is None or not log.has("motor_speed") or log.time[-1] - log.time[0] <= 2.0 * _TURN:
        return
    half = max(round(0.5 * _TURN / float(np.median(np.diff(log.time)))), 1)
    step = max(len(log.time) // _PAIRS, 1)
    at = np.arange(half, len(log.time) - half, step)
    rate = log[place][at + half] - log[place][at - half]
    alike = _correlation(rate, log["motor_speed"][at])
    if not alike:  # one that stands still is a fault for diagnosis
        return
    # A current that drives friction alone goes nearly as the speed does.
    least = max(_ALIKE, 1.0 - (1.0 - alike) / _NEARER)
    for role in _CURRENTS:
        if log.has(role) and _correlation(rate, log[role][at]) > least:
            raise InputError(
                f"{log.name}: {place} changes as {role} goes, not as motor_speed: swapped columns"
            )


def _correlation(a: Floats, b: Floats) -> float:
    """Of samples that both have; nought where one of them stands still."""
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both] - np.mean(a[both]), b[both] - np.mean(b[both])
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else 0.0


def unsound(log: Log) -> tuple[str, ...]:
    """Return findings: channels that are clipped or have samples missing."""
    out = []
    for role in log:
        values = log[role]
        missing = 1.0 - float(np.mean(np.isfinite(values)))
        if missing > _MISSING:
            out.append(f"{log.name}: {100 * missing:.0f} % of {role} are missing")
        if role in _CURRENTS and max(clipped_share(values)) > _CLIPPED:
            share = 100 * max(clipped_share(values))
            out.append(
                f"{log.name}: {share:.0f} % of {role} sit at its largest or smallest value: "
                "clipped, or at the drive's limit"
            )
    return tuple(out)


#: What regressions of both positions need.
_SERVO = ("output_position", "motor_position", "speed_ref", "motor_speed")


def reading_of(log: Log, actuator: Actuator) -> Reading:
    """Read a log as diagnosis sees it: of a turning servo by its positions, else by its roles.

    A servo's log that lacks what the regressions of both positions need is read by its roles, too,
    where it has a command.

    Raises
    ------
    InputError
        It cannot be diagnosed.
    """
    check_sizes(log, actuator)
    lost = [role for role in _SERVO if not log.has(role)]
    if not turns(actuator) or (lost and log.has("command")):
        return role_log(log, actuator)
    if lost:
        raise InputError(
            f"{log.name}: diagnosis of a servo needs {', '.join(lost)}, or a command and what "
            f"followed it; roles: {', '.join(log) or 'none'}"
        )
    return PositionReading(log, actuator)


@one_blas_thread()
def diagnose(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    baselines: Sequence[Log] = (),
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
    spread: LearnedSpread | None = None,
    unit_known: bool = False,
) -> Diagnosis:
    """Say what is wrong with the unit that wrote the logs: which fault or pair of faults.

    Parameters
    ----------
    logs : sequence of Log
        Of one unit in one condition.
    actuator : Actuator
        The healthy unit, calibrated.
    baselines : sequence of Log
        Of the healthy unit; those of the same test serve.
    faults : sequence of str, optional
        ``KIND@PLACE`` of the candidates; default: all.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.
    spread : LearnedSpread, optional
        Of healthy days and of the model's mismatch; default: what the package states.
    unit_known : bool
        Whether the actuator file is this unit by construction, as of a simulation of it. Else the
        unit is known by a calibration, by a healthy log or by a spread; without any of them the
        answer is ``undecided``.

    Raises
    ------
    InputError
        A log that cannot be diagnosed, no candidate, a rate outside 0 to 1.
    """
    begin = clock.perf_counter()
    check_request(logs, false_alarm)
    request = DiagnosisRequest(logs, baselines, actuator, faults, false_alarm, spread, unit_known)
    answer = request.answer()
    if not request.seen_healthy:
        answer = _undecided(answer)
    return replace(answer, seconds=clock.perf_counter() - begin)


@dataclass(frozen=True)
class DiagnosisRequest:
    """What a diagnosis by the model is asked for; attributes as the parameters of `diagnose`."""

    logs: Sequence[Log]
    baselines: Sequence[Log]
    actuator: Actuator
    faults: Sequence[str] | None = None
    false_alarm: float = 0.05
    spread: LearnedSpread | None = None
    unit_known: bool = False

    @property
    def seen_healthy(self) -> bool:
        """Whether a healthy state of the unit is known."""
        known = self.unit_known or bool(self.baselines) or self.spread is not None
        return known or calibrated(self.actuator)

    def answer(self) -> Diagnosis:
        """Return signs of the logs and the posterior over candidates in one answer."""
        signs, notes = self._drive_signs(), []
        try:
            items = [reading_of(log, self.actuator) for log in self.logs]
            healthy = [reading_of(log, self.actuator) for log in self.baselines]
        except InputError as error:
            if not signs:
                raise
            answer = joined_signs(self.logs, signs, self.false_alarm, None)
            return replace(answer, findings=(*answer.findings, f"nothing else is read: {error}"))
        signs += self._stand_signs(items, healthy)
        if self._hears_spalls:
            if not self.baselines:
                return self._spall_alone()
            heard, note = self._spall()
            signs, notes = [*signs, *heard], [note]
        remaining = self._by_candidates(signs, items, healthy, notes)
        if not signs:
            assert remaining is not None
            return remaining
        return joined_signs(self.logs, signs, self.false_alarm, remaining)

    def _drive_signs(self) -> list[Sign]:
        if self.faults or not turns(self.actuator):
            return []
        return likely_signs(drive_signs(self.logs, self.baselines, self.actuator))

    def _stand_signs(self, items: Sequence[Reading], healthy: Sequence[Reading]) -> list[Sign]:
        """Return what most logs say of the stand's sensors, each against its own test's baselines.

        A sensor that fails does so in all of them; what one test alone shows is the actuator's.
        """
        if self.faults:
            return []
        of_logs = []
        for log, item in zip(self.logs, items, strict=True):
            same = [b for b, x in zip(self.baselines, healthy, strict=True) if item.same(x)]
            of_logs.append(likely_signs(stand_signs(log, same)))
        named = [signs for signs in of_logs if signs]
        return named[0] if 2 * len(named) > len(self.logs) else []

    @property
    def _hears_spalls(self) -> bool:
        """Whether a spall is a candidate and all logs have an accelerometer fast enough."""
        wanted = self.faults is None or any(text.startswith(f"{KIND}@") for text in self.faults)
        return wanted and all(shows_passes(log, self.actuator) for log in self.logs)

    def _spall_alone(self) -> Diagnosis:
        try:
            return diagnose_spall(self.logs, self.actuator, self.false_alarm)
        except ValueError as error:
            raise InputError(f"accelerometer: {error}") from None

    def _spall(self) -> tuple[list[Sign], str]:
        """Return what an accelerometer hears, at half of the false alarms, and a finding."""
        try:
            sign, note = spall_sign(self.logs, self.actuator, 0.5 * self.false_alarm)
        except ValueError as error:
            return [], f"accelerometer: {error}"
        return ([] if sign is None else [sign]), note

    def _by_candidates(
        self,
        signs: Sequence[Sign],
        items: Sequence[Reading],
        healthy: Sequence[Reading],
        notes: Sequence[str],
    ) -> Diagnosis | None:
        """Return the posterior over candidates by what no sign moves; None: nothing is left."""
        left_out = [name for sign in signs for name in sign.moves]
        if "" in left_out:
            return None
        candidates = chosen(self.faults, self.actuator)
        cases = [case_of(item, candidates, healthy, self.spread, left_out) for item in items]
        cases = [case for case in cases if case.unit.names or not signs]
        if not cases:
            return None
        spread = self.spread
        if spread is not None and not any(
            n in spread.features for c in cases for n in c.unit.names
        ):
            raise InputError(
                f"--model: the spread was learnt of {spread.actuator}; none of its features is in "
                "these logs"
            )
        rate = self.false_alarm
        result = answer_of(cases, candidates, rate, spread, unit_known=self.unit_known)
        if spread is not None:
            notes = [*notes, *_of_the_spread(spread, self.actuator, rate, len(self.logs))]
        blind = () if self.faults else not_candidates(self.actuator)
        bad = (text for log in self.logs for text in unsound(log))
        return replace(
            result, unobservable=(*result.unobservable, *blind),
            findings=(*bad, *result.findings, *notes),
        )  # fmt: skip

    def traces(self, result: Diagnosis) -> list[Traces]:
        """Return each log's signals beside the healthy model's and those with what is named.

        Behind them each baseline's of the same test as a log, beside the healthy model's in its
        place.
        """
        texts = tuple(f"{key}={value!r}" for key, value in named_faults(result).items())
        units = [ReplayUnit(), *([ReplayUnit(Variant(faults=texts))] if texts else [])]
        items = [reading_of(log, self.actuator) for log in self.logs]
        healthy = [reading_of(log, self.actuator) for log in self.baselines]
        same = [b for b in healthy if any(item.same(b) for item in items)]
        out = [_traces(item, units) for item in items]
        return out + [replace(_traces(b, units[:1]), baseline=True) for b in same]


def _traces(item: Reading, units: Sequence[ReplayUnit]) -> Traces:
    return Traces(item.name, item.log.time[item.log.good], item.drawn(units))


def _undecided(answer: Diagnosis) -> Diagnosis:
    """Return an answer for a unit whose healthy state is not known: no cause is named."""
    from elevon.diagnose.engine.page import ALONE, verdict

    if answer.status == UNDECIDED:
        return answer
    seen = ALONE + (verdict(answer).partition(": ")[2] or "no fault stands out")
    return replace(
        answer, status=UNDECIDED, faults=(), best=(), hypotheses=(), alternatives=(),
        findings=tuple(dict.fromkeys((seen, *answer.findings, NEVER_SEEN))),
    )  # fmt: skip


def _of_the_spread(
    spread: LearnedSpread, actuator: Actuator, rate: float, logs: int
) -> tuple[str, ...]:
    """What the threshold stands on, and whether that is another actuator's."""
    out = (spread.threshold_text(rate, logs),)
    if spread.actuator in ("", actuator.name):
        return out
    return (*out, f"the spread was learnt of {spread.actuator}, this is {actuator.name}: it holds "
            "as far as they are alike")  # fmt: skip


def check_request(logs: Sequence[Log], rate: float) -> None:
    """Refuse what no method can answer."""
    if not logs:
        raise InputError("diagnosis needs at least one log")
    if not 0.0 < rate < 1.0:
        raise InputError(f"false-alarm rate {rate:g} must be between 0 and 1")
