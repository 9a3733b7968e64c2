"""The stage of model runs: what the regressions cannot see, and what absorbs the model's misfit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.calibrate.candidates import ParameterCandidate, candidates, start_values, within_inertia
from elevon.calibrate.estimate import Estimate, quantile
from elevon.calibrate.fit import (
    DynamicFit,
    blocks_of,
    fit_dynamic,
    refresh_scales,
    step_sizes,
)
from elevon.calibrate.identify import Identifiability, choose
from elevon.calibrate.log import BenchLog
from elevon.calibrate.problem import Problem, values_of
from elevon.errors import Interrupted
from elevon.parameters.relations import constant_is_tied, static_following
from elevon.progress import Progress

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Dynamic", "dynamic_stage"]

Bools = npt.NDArray[np.bool_]
_ABSORBS = 0.02  # relative difference to the direct estimate that is worth a name
_SIGMAS = 2.0  # deviations it must also exceed
_MOST = 12  # evaluations: the regressions start it close by


@dataclass(frozen=True)
class Dynamic:
    """Result of the stage.

    Attributes
    ----------
    ranking : Identifiability
        Of the candidates, before the fit.
    fit : DynamicFit
        With every determined candidate free.
    drive : str
        Kind of drive whose model explains the logs better.
    absorbed : tuple of (str, float, float)
        Parameter, value of the model runs, direct value: where they part, the parameter absorbs
        what the model lacks.
    rms : tuple of (str, float, float)
        Log, RMS of speed [rad/s] and current [A] of the fitted model runs.
    runs : int
        Model runs.
    """

    ranking: Identifiability
    fit: DynamicFit
    drive: str
    absorbed: tuple[tuple[str, float, float], ...]
    rms: tuple[tuple[str, float, float], ...]
    runs: int

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {
            "drive": self.drive,
            "values": self.fit.values,
            "cost": self.fit.cost,
            "converged": self.fit.converged,
            "at_bound": list(self.fit.at_bound),
            "exact_derivatives": list(self.fit.exact),
            "evaluations": self.fit.evaluations,
            "runs": self.runs,
            "absorbed": [{"path": p, "simulation": a, "direct": b} for p, a, b in self.absorbed],
            "rms": [{"log": n, "speed": s, "current": c} for n, s, c in self.rms],
        }

    def estimates(
        self, actuator: Actuator, known: Sequence[str], free: Sequence[str] | None
    ) -> list[Estimate]:
        """Estimates of what has no direct one."""
        std = np.sqrt(np.maximum(np.diag(self.fit.covariance), 0.0))
        estimates = []
        for item, x, s in zip(self.fit.free, self.fit.x, std, strict=True):
            if item.path in known or (item.kind == "parameter" and not _wanted(item.path, free)):
                continue
            half = quantile(self.fit.degrees) * float(s)
            value = item.outer(float(x))
            ends = (item.outer(float(x) - half), item.outer(float(x) + half))
            in_set = item.kind == "parameter"
            estimates.append(
                Estimate(
                    item.path,
                    value,
                    value * float(s) if item.log_scale else float(s),
                    ends,
                    item.unit,
                    item.register,
                    actuator.parameters.value(item.path) if in_set else None,
                    "simulation",
                    (),
                    "ended at its bound" if item.path in self.fit.at_bound else "",
                    in_set,
                )
            )
        return [item for item in estimates if np.isfinite(item.std)]


def _wanted(path: str, free: Sequence[str] | None) -> bool:
    return free is None or path in free


def dynamic_stage(
    logs: Sequence[BenchLog],
    keeps: Sequence[Bools],
    actuator: Actuator,
    known: Sequence[Estimate],
    free: Sequence[str] | None,
    *,
    fidelity: str,
    progress: Progress | None,
) -> Dynamic | None:
    """Rank, choose and fit on model runs that start from the direct estimates.

    Returns
    -------
    Dynamic or None
        None where the logs determine nothing of what could be freed.
    """

    def check() -> bool:
        return progress is None or progress(state[0])

    state = [0.0]
    required = [p for p in free or () if p not in {item.path for item in known}]
    chosen = candidates(actuator, logs, free)
    start = start_values(actuator, logs)
    start |= {item.path: item.value for item in known if item.value != 0.0}
    problem = _best_drive(logs, keeps, actuator, chosen, start, fidelity=fidelity, check=check)
    x = _point(chosen, start, problem.actuator)
    refresh_scales(problem, values_of(chosen, x))
    state[0] = 0.1
    residual = problem.residual(problem.simulate([values_of(chosen, x)])[0])
    jac = problem.jacobian(chosen, x, step_sizes(chosen))
    determined, ranking = choose(chosen, jac, residual, blocks_of(problem, residual), required)
    state[0] = 0.3
    if not determined:
        return None

    def advance(fraction: float) -> None:
        state[0] = 0.3 + 0.7 * fraction
        if not check():
            raise Interrupted("calibration stopped")

    fit = fit_dynamic(
        problem,
        [chosen[k] for k in determined],
        x[determined],
        most=_MOST,
        finite=[part[:, :, determined] for part in jac],
        advance=advance,
    )
    return Dynamic(
        ranking=ranking,
        fit=fit,
        drive=str(problem.actuator.parameters["drive.kind"].value),
        absorbed=_absorbed(fit, known),
        rms=_rms(problem, fit),
        runs=problem.runs,
    )


def _point(
    free: Sequence[ParameterCandidate], start: dict[str, float], actuator: Actuator
) -> npt.NDArray[np.float64]:
    x = []
    for item in free:
        value = start.get(item.path)
        if value is None:
            value = actuator.parameters.value(item.path) if item.kind == "parameter" else 0.0
            value = max(value, item.low) if item.log_scale else value
        if item.log_scale:
            value = min(max(value, item.low), item.high)
        x.append(item.inner(value))
    return np.array(x)


def _best_drive(
    logs: Sequence[BenchLog],
    keeps: Sequence[Bools],
    actuator: Actuator,
    free: Sequence[ParameterCandidate],
    start: dict[str, float],
    *,
    fidelity: str,
    check: Any,
) -> Problem:
    """The file's drive, or the carrier PWM of a real one, whichever explains the logs better."""
    nominal = str(actuator.parameters["drive.kind"].value)
    kinds = [nominal, *(kind for kind in ("pwm",) if kind != nominal)]
    problems = []
    for kind in kinds:
        changed = actuator.with_values({**_fixed(start, actuator, free), "drive.kind": kind})
        problem = Problem(
            changed,
            logs,
            fidelity,
            check,
            constant_is_tied(actuator.parameters, 0.01),
            masks=[keep.copy() for keep in keeps],
        )
        values = values_of(free, _point(free, start, changed))
        misfit = problem.residual(problem.simulate([values])[0])
        cost = sum(float(np.sum(np.minimum(np.abs(r), 10.0))) for r in misfit)
        problems.append((cost, problem))
    best, other = problems[0], problems[-1]
    return other[1] if other[0] < best[0] else best[1]


def _fixed(
    start: dict[str, float], actuator: Actuator, free: Sequence[ParameterCandidate]
) -> dict[str, str | float]:
    """Known values of parameters the model runs keep fixed."""
    taken = {item.path for item in free}
    values: dict[str, str | float] = {
        p: v for p, v in start.items() if p in actuator.parameters and p not in taken
    }
    if "friction.dynamic" in start:
        static = static_following(actuator.parameters, start["friction.dynamic"])
        values.setdefault("friction.static", static)
        values.setdefault("friction.dynamic", start["friction.dynamic"])
    fixed = {
        p: v for p, v in values.items() if p not in {"backlash.total", "sensor.encoder.offset"}
    }
    return fixed | within_inertia(actuator, fixed)


def _absorbed(fit: DynamicFit, known: Sequence[Estimate]) -> tuple[tuple[str, float, float], ...]:
    direct = {item.path: item for item in known}
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    absorbed = []
    for item, x, s in zip(fit.free, fit.x, std, strict=True):
        other = direct.get(item.path)
        if other is None or not item.log_scale or not other.value > 0.0:
            continue
        gap = float(x) - item.inner(other.value)
        noise = float(np.hypot(s, other.std / other.value))
        if abs(gap) > _ABSORBS and abs(gap) > _SIGMAS * noise:
            absorbed.append((item.path, item.outer(float(x)), other.value))
    return tuple(sorted(absorbed, key=lambda row: -abs(np.log(row[1] / row[2]))))


def _rms(problem: Problem, fit: DynamicFit) -> tuple[tuple[str, float, float], ...]:
    rows = []
    runs = problem.simulate([fit.values])[0]
    for log, run, mask in zip(problem.logs, runs, problem.masks, strict=True):
        if run is not None:
            speed = float(np.sqrt(np.mean((run.speed - log.speed)[mask] ** 2)))
            current = float(np.sqrt(np.mean((run.current - log.current)[mask] ** 2)))
            rows.append((log.name, speed, current))
    return tuple(rows)
