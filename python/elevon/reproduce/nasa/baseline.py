"""The nominal runs of the test stand: every profile under every load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.errors import RangeError, SimulationError
from elevon.progress import part
from elevon.report.checks import Check, all_passed
from elevon.reproduce.nasa.capability import Capability
from elevon.reproduce.nasa.profiles import PROFILES, LoadKind, Profile, profile_scenario

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress
    from elevon.recording import Recording

__all__ = ["BaselineResult", "BaselineRow", "baseline_matrix", "reproduce_baseline"]

ACTUATOR = "nasa-ballscrew"
LOADS = (0.0, -500.0, -4500.0, -8500.0, 500.0, 4500.0, 8500.0)
"""N, positive compressive."""
RATES = {0.05: 0.06, 0.1: 0.12, 0.0: 0.06}
"""Peak rate of each amplitude, m/s over m: both ends of the printed range. A sweep runs through
the whole range."""
SETTLE = 2.0
"""Statistics begin here [s]."""
RECORD = "command,user_position,current_a,current_b,current_c,winding_temperature,limited@2 kHz"
BATCH = 16


@dataclass(frozen=True, slots=True)
class BaselineRow:
    """One run of the matrix; statistics after the first 2 s, at the load's side of the joint."""

    profile: Profile
    load: float
    status: str
    reason: str = ""
    rms_current: float = float("nan")
    peak_current: float = float("nan")
    tracking_rms: float = float("nan")
    tracking_max: float = float("nan")
    winding: float = float("nan")
    at_limit: float = float("nan")

    @property
    def direction(self) -> str:
        """Which way the load pushes."""
        if self.load == 0.0:
            return "none"
        return "compressive" if self.load > 0.0 else "tensile"

    def to_dict(self) -> dict[str, Any]:
        """Return one row of the command's JSON object."""
        numbers = {
            "rms_current_a": self.rms_current,
            "peak_current_a": self.peak_current,
            "tracking_rms_mm": 1e3 * self.tracking_rms,
            "winding_k": self.winding,
        }
        return {
            "profile": self.profile.name,
            "amplitude_mm": 1e3 * self.profile.amplitude,
            "load_n": abs(self.load),
            "direction": self.direction,
            **{name: None if np.isnan(value) else value for name, value in numbers.items()},
            "status": self.status,
            "reason": self.reason,
        }


@dataclass(frozen=True)
class BaselineResult:
    """Everything `elevon reproduce nasa-baseline` reports."""

    rows: list[BaselineRow]
    checks: list[Check]
    load_kind: LoadKind
    seed: int
    meta: dict[str, Any] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of the command."""
        return {
            "status": "pass" if all_passed(self.checks) else "fail",
            "load_kind": self.load_kind,
            "rows": [row.to_dict() for row in self.rows],
            "checks": [check.to_dict() for check in self.checks],
            "seed": self.seed,
            **self.meta,
        }


def baseline_matrix() -> list[tuple[Profile, float]]:
    """Return profile and load [N] of every run; a still one of the rectangular profile as well."""
    cases = []
    for name in PROFILES:
        amplitudes = (0.0, 0.05, 0.1) if name == "rectangular" else (0.05, 0.1)
        duration = 120.0 if name == "sweep" else 30.0
        for amplitude in amplitudes:
            rate = 0.06 if name == "sweep" else RATES[amplitude]
            profile = Profile(name, amplitude, rate, duration)
            cases += [(profile, load) for load in LOADS]
    return cases


def reproduce_baseline(
    actuator: Actuator | None = None,
    *,
    load_kind: LoadKind = "constant",
    cases: Sequence[tuple[Profile, float]] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> BaselineResult:
    """Run the matrix at high fidelity.

    Parameters
    ----------
    actuator : Actuator, optional
        Of the wiring ``ballscrew``; by default the stand's.
    load_kind : str
        How the load acts: ``constant``, ``step`` or ``spring``.
    cases : sequence of (Profile, float), optional
        Profiles and loads [N] instead of the whole matrix.
    seed : int
        Of every run.
    progress : callable, optional
        As for `simulate_batch`.

    Returns
    -------
    BaselineResult
        One row a case, in order. A ramped profile that the actuator cannot follow is not run: its
        status is ``refused`` and its reason names the limit.

    Raises
    ------
    InputError
        The actuator has no screw.
    SimulationError
        A run diverged.
    """
    from elevon.actuator import Actuator

    actuator = actuator or Actuator.load(ACTUATOR)
    able = Capability.of(actuator)
    chosen = list(baseline_matrix() if cases is None else cases)
    if load_kind == "spring":
        chosen = [(p, load) for p, load in chosen if p.amplitude > 0.0 and load >= 0.0]
    rows: dict[int, BaselineRow] = {}
    runnable = []
    for index, (profile, load) in enumerate(chosen):
        reason = able.refusal(profile, load)
        if reason is None:
            runnable.append(index)
        else:
            rows[index] = BaselineRow(profile, load, "refused", reason)
    meta: dict[str, Any] = {}
    for group in _groups(runnable, chosen):
        span = (min(rows_done(rows, runnable) / max(len(runnable), 1), 1.0),)
        stop = min(span[0] + len(group) / len(runnable), 1.0)
        recordings = _run(actuator, [chosen[i] for i in group], load_kind, seed,
                          part(progress, span[0], stop))  # fmt: skip
        for index, recording in zip(group, recordings, strict=True):
            rows[index] = _row(*chosen[index], recording, able)
            meta = {key: recording.meta[key] for key in ("parameter_hash", "version")}
    ordered = [rows[index] for index in range(len(chosen))]
    whole = cases is None and load_kind == "constant"
    return BaselineResult(ordered, _checks(ordered, actuator, whole), load_kind, seed, meta)


def rows_done(rows: dict[int, BaselineRow], runnable: Sequence[int]) -> int:
    """Return how many of the runnable cases have their row."""
    return sum(index in rows for index in runnable)


def _groups(runnable: Sequence[int], cases: Sequence[tuple[Profile, float]]) -> list[list[int]]:
    """Cases that share lanes, few enough at once to bound the memory of their recordings."""
    alike: dict[tuple[bool, float], list[int]] = {}
    for index in runnable:
        profile = cases[index][0]
        wave = profile.name in ("sinusoidal", "sweep")
        alike.setdefault((wave, profile.duration), []).append(index)
    return [
        group[start : start + BATCH]
        for group in alike.values()
        for start in range(0, len(group), BATCH)
    ]


def _run(
    actuator: Actuator,
    cases: Sequence[tuple[Profile, float]],
    kind: LoadKind,
    seed: int,
    progress: Progress | None,
) -> list[Recording]:
    from elevon.scenario import Scenario
    from elevon.simulate import Run, simulate_batch

    runs = [
        Run(
            actuator,
            Scenario.from_dict(profile_scenario(profile, load, kind)),
            seed,
            f"{profile.name} {1e3 * profile.amplitude:g} mm {load:g} N",
        )
        for profile, load in cases
    ]
    return simulate_batch(runs, fidelity="high", record=RECORD, progress=progress)


def _row(profile: Profile, load: float, recording: Recording, able: Capability) -> BaselineRow:
    if recording.status == "diverged":
        raise SimulationError(f"{recording.meta['label']}: {recording.meta['message']}")
    late = recording["command"].time >= SETTLE
    if not np.any(late):
        raise RangeError(
            f"{recording.meta['label']}: ended at {recording.meta['sim_s']:g} s, before the "
            f"statistics begin at {SETTLE:g} s"
        )
    currents = np.stack([recording[f"current_{phase}"].values[late] for phase in "abc"])
    error = recording["command"].values[late] - recording["user_position"].values[late]
    status = "limited" if able.limited(profile, load) else "ok"
    return BaselineRow(
        profile,
        load,
        status if recording.status == "ok" else recording.status,
        "" if recording.status == "ok" else str(recording.meta["message"]),
        rms_current=float(np.sqrt(np.mean(currents**2))),
        peak_current=float(np.max(np.abs(currents))),
        tracking_rms=float(np.sqrt(np.mean(error**2))),
        tracking_max=float(np.max(np.abs(error))),
        winding=float(recording["winding_temperature"].values[-1]),
        at_limit=float(np.mean(recording["limited"].values[late])),
    )


def _checks(rows: Sequence[BaselineRow], actuator: Actuator, whole: bool) -> list[Check]:
    value = actuator.parameters.value
    ran = [row for row in rows if row.status in ("ok", "limited")]
    ramped = [row for row in ran if row.profile.ramped]
    sines = [row for row in ran if row.profile.name == "sinusoidal"]
    refused_wrongly = [row for row in rows if row.status not in ("ok", "limited")]
    checks = [
        Check("rows that were refused or tripped", len(refused_wrongly), 0.0),
        Check("largest rms phase current", _worst(ran, "rms_current"),
              value("rating.current") / np.sqrt(2.0), "A"),
        Check("hottest winding", _worst(ran, "winding"), value("thermal.warning"), "K"),
    ]  # fmt: skip
    if ramped:
        worst = 1e3 * _worst(ramped, "tracking_max")
        checks.append(Check("largest tracking error of a ramp", worst, 10.0, "mm"))
    if sines:
        worst = 1e3 * _worst(sines, "tracking_rms")
        checks.append(Check("largest rms tracking error of a sine", worst, 0.3, "mm"))
    if whole:
        checks.append(Check("rows", len(rows), 77.0, at_least=True))
        checks += _order_checks(ran)
    return checks


def _worst(rows: Sequence[BaselineRow], name: str) -> float:
    return max((float(getattr(row, name)) for row in rows), default=float("nan"))


def _order_checks(rows: Sequence[BaselineRow]) -> list[Check]:
    """Tensile and compressive runs are mirror images but for the start; more load, more current."""
    found = {
        (row.profile.name, row.profile.amplitude, row.load): row.rms_current
        for row in rows
        if row.profile.amplitude > 0.0
    }
    mirrored = [
        abs(current / found[name, a, -load] - 1.0)
        for (name, a, load), current in found.items()
        if load > 0.0 and (name, a, -load) in found
    ]
    falls = 0
    for (name, a, load), current in found.items():
        larger = {500.0: 4500.0, 4500.0: 8500.0}.get(abs(load))
        if larger is not None:
            falls += found[name, a, float(np.copysign(larger, load))] <= current
    return [
        Check("rms current, compressive against tensile", 100.0 * max(mirrored), 6.0, "%"),
        Check("loads whose increase does not raise the current", falls, 0.0),
    ]
