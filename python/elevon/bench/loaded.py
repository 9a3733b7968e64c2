"""Logs of a stand with a load actuator: each run set up, carried out and recorded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.bench.acquisition import acquire, acquired
from elevon.bench.procedure import (
    ForceStep,
    Procedure,
    RigStep,
    SensorStep,
    SettingsStep,
    TraceStep,
)
from elevon.bench.rig import BenchSetup, Conditions, draw_conditions, moved, moved_command
from elevon.bench.stand import ForceSpec, Stand
from elevon.errors import DivergedError, InputError, unknown
from elevon.faults import Fault
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.recording.formats import files_of
from elevon.scenario import Scenario
from elevon.scenario.scenario import Term
from elevon.simulate import Run, simulate, simulate_batch, solver_step
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.arrays import Floats


#: Of what the drive holds at its current limit. ASSUMED: the rest accelerates and overcomes
#: friction, and a continuous thrust is about half of the peak.
SHARE = 0.5
_LIMITS = ("control.current_limit", "control.torque_constant", "gear.ratio", "screw.lead")


def holds(actuator: Actuator) -> float:
    """Return the thrust at the current limit without losses [N]; infinite where no limit is known.

    The screw's lead is in m/rad.
    """
    known = actuator.parameters
    if any(path not in known for path in _LIMITS):
        return float("inf")
    current, constant, ratio, lead = (known.value(path) for path in _LIMITS)
    return float(current * constant * ratio / lead)


def rated_factor(step: ForceStep, terms: Floats, command: Floats, most: float) -> float:
    """Return by what the forces of a step are multiplied so that they stay within `most`.

    Parameters
    ----------
    step : ForceStep
        What the procedure asks for.
    terms, command : ndarray, shape (n,)
        Its waveforms [N], the commanded positions [m].
    most : float
        N.
    """
    spring = parse_quantity(step.stiffness, "N/m", "stiffness") * command
    if step.positions:
        spring = spring + np.interp(command, step.positions, step.forces)
    against = abs(parse_quantity(step.opposing, "N", "opposing"))
    largest = float(np.max(np.abs(terms + spring))) + against
    return min(1.0, most / largest) if largest > 0.0 else 1.0


_AT_REST = 1e-3  # m/s below which a direction fades: rest has none


@dataclass(frozen=True, slots=True)
class ForceLoop:
    """The loop in SI; see `elevon.bench.stand.ForceSpec`."""

    limit: float
    omega: float
    damping: float
    friction: float
    mass: float

    @classmethod
    def of(cls, spec: ForceSpec) -> ForceLoop:
        """Return the loop a stand's file describes."""
        return cls(
            parse_quantity(spec.limit, "N", "force.limit"),
            2.0 * math.pi * parse_quantity(spec.bandwidth, "Hz", "force.bandwidth"),
            spec.damping,
            parse_quantity(spec.friction, "N", "force.friction"),
            parse_quantity(spec.mass, "kg", "force.mass"),
        )

    def achieved(self, time: Floats, target: Floats, speed: Floats) -> Floats:
        """Return the force on the rod [N] for a commanded force and the rod's speed.

        Raises
        ------
        InputError
            More is commanded than the load actuator has.
        """
        most = float(np.abs(target).max())
        if most > self.limit:
            raise InputError(f"force of {most:.5g} N: the load actuator has {self.limit:.5g} N")
        period = float(time[1] - time[0])
        acceleration = np.gradient(speed, period)
        other = self.friction * np.tanh(speed / _AT_REST) + self.mass * acceleration
        return self._closed(target, period) + other - self._closed(other, period)

    def _closed(self, values: Floats, period: float) -> Floats:
        """Return what the closed loop makes of a signal that was steady before."""
        from scipy.signal import bilinear, lfilter, lfilter_zi

        w = self.omega
        numerator, denominator = bilinear([w**2], [1.0, 2.0 * self.damping * w, w**2], 1.0 / period)
        state = lfilter_zi(numerator, denominator) * values[0]
        return np.asarray(lfilter(numerator, denominator, values, zi=state)[0], dtype=np.float64)


def target_force(step: ForceStep, terms: Floats, position: Floats, speed: Floats) -> Floats:
    """Return the commanded force [N]: of time, direction and position.

    Parameters
    ----------
    step : ForceStep
        What the operator set.
    terms : ndarray, shape (n,)
        Values of its terms.
    position, speed : ndarray, shape (n,)
        Of the output [m], [m/s].
    """
    against: Any = parse_quantity(step.opposing, "N", "opposing")
    spring = parse_quantity(step.stiffness, "N/m", "stiffness")
    total = terms + against * np.tanh(speed / _AT_REST) + spring * position
    if step.positions:
        total = total + np.interp(position, step.positions, step.forces)
    return np.asarray(total, dtype=np.float64)


_GRID = 1e-3  # s of the force table
_FINE = 0.25  # of it between two samples of the motion
_PASSES = 2  # runs of the reduced-order model from which the force is computed


@dataclass(frozen=True)
class LoadedSetup(BenchSetup):
    """One log under a load actuator about to be recorded; the load is added when it is known.

    Attributes
    ----------
    stand : Stand
        Where it stands.
    force : ForceStep or None
        What the load actuator is commanded; None: nothing, or the rig moves the output.
    settings : dict
        What the operator set, by parameter.
    sensors : tuple of SensorStep
        What is wrong with the stand's own sensors.
    """

    stand: Stand
    force: ForceStep | None
    settings: dict[str, Any]
    sensors: tuple[SensorStep, ...] = ()

    @cached_property
    def factor(self) -> float:
        """Factor on the commanded force: below one where the drive could not hold it."""
        force, command, most = self.force, self.trace.command, SHARE * holds(self.actuator)
        if force is None or command.mode != "position" or not np.isfinite(most):
            return 1.0
        times = np.arange(0.0, parse_quantity(self.trace.duration, "s", "duration"), 10.0 * _GRID)
        terms = waveform_values(force.terms, times, self.conditions.start)
        return rated_factor(force, terms, waveform_values(command.terms, times, 0.0, "m"), most)

    @property
    def scaled(self) -> dict[str, object]:
        """The factor, where it is below one."""
        return {} if self.factor == 1.0 else {"force_factor": self.factor}

    @property
    def message(self) -> str:
        """What the operator changed of the procedure."""
        if self.factor == 1.0:
            return ""
        return (
            f"loads times {self.factor:.3g}: {self.actuator.name} holds "
            f"{holds(self.actuator):.4g} N, and is loaded by {100 * SHARE:g} % of it at most"
        )

    def truth(self) -> dict[str, object]:
        """Return what the log does not state."""
        return super().truth() | {
            "stand": self.stand.name,
            "force": None if self.force is None else self.force.model_dump(mode="json"),
            "rate": self.stand.hertz(self.trace.rate),
            **self.scaled,
        }


def loaded_setups(
    procedure: Procedure,
    actuator: Actuator,
    stand: Stand,
    *,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
) -> list[LoadedSetup]:
    """Go through a procedure's steps and return its logs, ready to be run.

    Raises
    ------
    InputError
        A step that the stand has no equipment for; a setting that does not exist.
    """
    settings: dict[str, Any] = dict(stand.settings)
    force: ForceStep | None = None
    rig: tuple[Term, ...] = ()
    sensors: dict[str, SensorStep] = {}
    logs: list[LoadedSetup] = []
    for step in procedure.step:
        if isinstance(step, ForceStep):
            force = step
        elif isinstance(step, RigStep):
            rig = step.terms
        elif isinstance(step, SettingsStep):
            settings = {**settings, **step.parameters}
        elif isinstance(step, SensorStep):
            if step.channel not in stand.channels:
                raise unknown("channel", step.channel, stand.channels, f"{procedure.name}: sensor")
            sensors[step.channel] = step
        elif isinstance(step, TraceStep):
            conditions = draw_conditions(seed, len(logs))
            ready = actuator.with_values(settings, source="set on the bench", place=step.name)
            logs.append(
                LoadedSetup(
                    step, ready, _scenario(step, ready, rig, conditions, faults), conditions, stand,
                    None if rig else force, dict(settings), tuple(sensors.values()),
                )
            )  # fmt: skip
        else:
            raise InputError(
                f"{procedure.name}: the stand {stand.name} has no {step.kind!r}; it has force, "
                f"{'rig, ' if 'rig_speed' in stand.ports else ''}settings, sensor, trace"
            )
    return logs


def _scenario(
    step: TraceStep,
    actuator: Actuator,
    rig: tuple[Term, ...],
    conditions: Conditions,
    faults: Sequence[Fault | str],
) -> Scenario:
    data: dict[str, Any] = {
        "duration": parse_quantity(step.duration, "s", "duration"),
        "command": moved_command(step, conditions.start),
        "initial": dict(step.initial) or _begin(step, actuator, conditions.start),
    }
    if rig:
        terms = [term.model_dump(exclude_unset=True, mode="json") for term in rig]
        data["load"] = {"rig_speed": {"terms": terms}}
    scenario = Scenario.from_dict(data, f"trace {step.name}")
    return scenario.with_faults(list(faults)) if faults else scenario


def _begin(step: TraceStep, actuator: Actuator, start: float) -> dict[str, Any]:
    """Where a commanded position begins: the operator has brought the output there."""
    known = actuator.parameters
    if step.command.mode != "position" or "screw.lead" not in known:
        return {}
    at = float(waveform_values(step.command.terms, np.zeros(1), start, "m")[0])
    turned = at * known.value("gear.ratio") / known.value("screw.lead")
    return {} if at == 0.0 else {"motor_position": turned, "output_position": at}


def run_loaded(
    setup: LoadedSetup, fidelity: str, progress: Progress | None = None
) -> tuple[Recording, Recording]:
    """Carry out one log.

    Returns
    -------
    (Recording, Recording)
        What the recorder kept, with its roles, and the run itself.
    """
    return run_loaded_batch([setup], fidelity, progress)[0]


def run_loaded_batch(
    setups: Sequence[LoadedSetup], fidelity: str, progress: Progress | None = None
) -> list[tuple[Recording, Recording]]:
    """Carry out several logs of one stand and rate together, as a batch; each as alone.

    Raises
    ------
    InputError
        Logs of different rates.
    DivergedError
        A run left the finite numbers.
    """
    rates = {setup.stand.hertz(setup.trace.rate) for setup in setups}
    if len(rates) != 1:
        raise InputError(f"a batch of logs needs one rate, not {sorted(rates)}")
    rate, first = rates.pop(), setups[0]
    seconds = max(setup.scenario.seconds for setup in setups)
    roles, record = acquired(first.actuator, fidelity, first.stand, rate, seconds)
    forces = _forces(setups)
    runs = _simulated(setups, [s for _, _, s in forces], fidelity, record, progress)
    out = []
    for setup, run, (times, force, _) in zip(setups, runs, forces, strict=True):
        log = acquire(
            run, roles, (times, force), setup.stand, rate=rate, seed=setup.conditions.seed,
            sensors=setup.sensors,
        )  # fmt: skip
        out.append((log.with_meta(**_meta(setup, run)), run))
    return out


def _simulated(
    setups: Sequence[LoadedSetup],
    scenarios: Sequence[Scenario],
    fidelity: str,
    record: str,
    progress: Progress | None = None,
) -> list[Recording]:
    """Run the setups' actuators through scenarios; one that diverges is an error."""
    runs = [
        Run(setup.actuator, scenario, setup.conditions.seed)
        for setup, scenario in zip(setups, scenarios, strict=True)
    ]
    if len(runs) == 1:
        return [
            simulate(
                runs[0].actuator, runs[0].scenario, fidelity=fidelity, record=record,
                seed=runs[0].seed, progress=progress,
            )
        ]  # fmt: skip
    recordings = simulate_batch(runs, fidelity=fidelity, record=record, progress=progress)
    for setup, recording in zip(setups, recordings, strict=True):
        if recording.status == "diverged":
            raise DivergedError(
                f"{setup.trace.name}: the run stopped: {recording.meta['message']}",
                time=recording.meta["sim_s"],
                signal=recording.meta.get("signal", ""),
            )
    return recordings


def _meta(setup: LoadedSetup, run: Recording) -> dict[str, Any]:
    """What the operator knows."""
    return {
        "status": "measured",
        "ended": str(run.meta["status"]),
        "log": setup.trace.name,
        "stand": {
            "name": setup.stand.name,
            "text": setup.stand.text,
            "parameters": setup.settings,
            **setup.scaled,
            "initial": dict(setup.trace.initial),
            "rig_moves": bool(setup.scenario.loads.rig_speed.terms),
        },
    }


def _forces(setups: Sequence[LoadedSetup]) -> list[tuple[Floats, Floats, Scenario]]:
    """Force on the rod over time and the scenario with it: motion and force in turn."""
    grids = [np.arange(0.0, s.scenario.seconds + _GRID, _GRID) for s in setups]
    out = [(t, np.zeros_like(t), s.scenario) for t, s in zip(grids, setups, strict=True)]
    at = [k for k, s in enumerate(setups) if s.force is not None and s.stand.force is not None]
    deaf = [_without_accelerometer(setups[k]) for k in at]
    for _ in range(_PASSES if at else 0):
        record = _motion(setups[at[0]].actuator)
        runs = _simulated(deaf, [out[k][2] for k in at], "low", record)
        for k, run in zip(at, runs, strict=True):
            force = _force(setups[k], run, grids[k])
            table = {"kind": "table", "times": grids[k].tolist(), "values": force.tolist()}
            loaded = setups[k].scenario.replaced(load={"output": {"terms": [table]}})
            out[k] = (grids[k], force, loaded)
    return out


def _without_accelerometer(setup: LoadedSetup) -> LoadedSetup:
    """Return a setup for the reduced-order model, which has none: the motion is the same."""
    known = setup.actuator.parameters
    if "vibration.model" not in known or known["vibration.model"].value == "off":
        return setup
    actuator = setup.actuator.with_values({"vibration.model": "off"}, request=False)
    return replace(setup, actuator=actuator)


def _motion(actuator: Actuator) -> str:
    """What the force is computed from, a few times in each of its steps."""
    step = solver_step(actuator, "low")
    return (
        f"output_position,output_speed@{1.0 / (max(1, int(_FINE * _GRID / step)) * step):.12g} Hz"
    )


def _force(setup: LoadedSetup, run: Recording, times: Floats) -> Floats:
    """What the load actuator makes of a motion."""
    assert setup.force is not None
    assert setup.stand.force is not None
    clock = run.clock().time
    position, speed = (
        np.interp(times, clock, run[name].values) for name in ("output_position", "output_speed")
    )
    terms = waveform_values(setup.force.terms, times, setup.conditions.start)
    force_step = setup.factor * target_force(setup.force, terms, position, speed)
    return ForceLoop.of(setup.stand.force).achieved(times, force_step, speed)


def waveform_values(
    terms: Sequence[Term], times: Floats, start: float = 0.0, unit: str = "N"
) -> Floats:
    """Return the sum of waveforms at instants, shape of `times`, begun at `start` [s]."""
    from elevon import _core
    from elevon.scenario.compile import compile_term

    total = np.zeros_like(times)
    for term in terms:
        data = moved(term.model_dump(exclude_unset=True, mode="json"), start)
        core = compile_term(type(term).model_validate(data), unit, "term")
        if core["kind"] == "table":
            total += np.interp(times, core["times"], core["values"])
        else:
            total += np.asarray(_core.waveform(core["kind"], core["parameters"], times))
    return total


def write_loaded(folder: Path, name: str, log: Recording, *, force: bool) -> list[Path]:
    """Write one log as a recording in text, its roles in the file beside it; return both."""
    path = folder / f"{name}.csv"
    log.save(path, force=force)
    return files_of(path)
