"""The nominal runs of the test stand as an experiment: replicated, in blocks, in random order.

Every profile runs at both amplitudes and both rates under every load of the stand (N 2.3, 2.4). A
replicate is a block: another reassembly of the actuator, whose runs come in an order of their own
while the laboratory warms up. The effects of the factors come from the two-level part of the matrix
(`design`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.errors import RangeError
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report.checks import Check
from elevon.simulate import Run, completed, simulate_batch
from elevon_cases.nasa.baseline_rows import (
    DRIFT,
    MEASURES,
    BaselineResult,
    BaselineRow,
    FactorEffect,
    TwoLevelFactor,
    coverage,
    fit_effects,
    model_matrix,
    shuffled_blocks,
    time_histories,
)
from elevon_cases.nasa.population import CellStore, draw_units, made_of, work_key
from elevon_cases.nasa.profiles import (
    PROFILES,
    Capability,
    LoadKind,
    MotionProfile,
    corner_rows,
    profile_scenario,
)

Case = tuple[MotionProfile, float]

ACTUATOR = "nasa-ballscrew"
LOADS = (0.0, -500.0, -4500.0, -8500.0, 500.0, 4500.0, 8500.0)
"""N, positive compressive."""
AMPLITUDES = (0.05, 0.1)
RATES = (0.06, 0.12)
"""m and m/s: both ends of the printed ranges, each with each. A sweep ends at twice its rate."""
SETTLE = 2.0
"""Statistics begin here [s]."""
HISTORY = 30.0
"""Time at which every run's winding is read [s]: equal histories, whatever a run's length."""
RECORD = "command,output_position,current_a,current_b,current_c,winding_temperature,limited@1 kHz"
SOLVER = {"solver.step": 5e-6}
BATCH = 16
FACTORS = (
    TwoLevelFactor("profile", "sinusoidal", "triangular"),
    TwoLevelFactor("amplitude", "50 mm", "100 mm"),
    TwoLevelFactor("rate", "6 cm/s", "12 cm/s"),
    TwoLevelFactor("load", "500 N", "8500 N"),
    TwoLevelFactor("direction", "tensile", "compressive"),
)
RESPONSES = ("rms_current_a", "peak_current_a", "tracking_rms_mm", "winding_rise_k")


def baseline_matrix() -> list[Case]:
    """Return profile and load [N] of every cell; a still one of the rectangular profile as well."""
    cells = []
    for name in PROFILES:
        duration = 120.0 if name == "sweep" else HISTORY
        motions = [(a, v) for a in AMPLITUDES for v in RATES]
        if name == "rectangular":
            motions.insert(0, (0.0, RATES[0]))
        for amplitude, rate in motions:
            cells += [(MotionProfile(name, amplitude, rate, duration), load) for load in LOADS]
    return cells


def reproduce_baseline(
    actuator: Actuator | None = None,
    *,
    load_kind: LoadKind = "constant",
    cases: Sequence[Case] | None = None,
    replicates: int = 4,
    seed: int = 0,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> BaselineResult:
    """Run the matrix at high fidelity, once a block, and estimate the effects of its factors.

    Parameters
    ----------
    actuator : Actuator, optional
        Of the wiring ``ballscrew``; by default the stand's.
    load_kind : str
        How the load acts: ``constant``, ``step`` or ``spring``.
    cases : sequence of (MotionProfile, float), optional
        Profiles and loads [N] instead of the whole matrix, which alone has effects and histories.
    replicates : int
        Blocks, each with a reassembly of its own; at least 1.
    seed : int
        Of the reassemblies, the orders and the runs.
    folder : Path, optional
        Where finished runs are kept, so that an interrupted reproduction goes on.
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
    actuator = actuator or Actuator.load(ACTUATOR)
    able = Capability.of(actuator)
    cells = [
        (profile, load)
        for profile, load in (baseline_matrix() if cases is None else cases)
        if load_kind != "spring" or (profile.amplitude > 0.0 and load >= 0.0)
    ]
    refusals = [able.refusal(profile, load) for profile, load in cells]
    orders = shuffled_blocks(len(cells), replicates, seed)
    runs = _runs(actuator, cells, orders, load_kind, seed)
    meta = made_of(actuator)
    key = work_key(kind=load_kind, cells=len(cells), whole=cases is None, replicates=replicates,
                   seed=seed, **meta)  # fmt: skip
    able_runs = {place: run for place, run in runs.items() if refusals[place[1]] is None}
    whole = cases is None and load_kind == "constant"
    span = part(progress, 0.0, 0.9 if whole else 1.0)
    measured = _measure(able_runs, cells, CellStore(folder, key), span)
    rows = _rows(cells, refusals, measured, able)
    checks, sheet = _checks(rows, actuator), _sheet(cells, orders)
    if not whole:
        return BaselineResult(rows, checks, load_kind, seed, replicates, sheet=sheet, meta=meta)
    effects, effect_checks = _effects(rows, replicates, seed)
    checks += [*_order_checks(rows), *effect_checks]
    return BaselineResult(
        rows, checks, load_kind, seed, replicates, effects, sheet,
        time_histories(actuator, part(progress, 0.9, 0.97)),
        corner_rows(actuator, part(progress, 0.97, 1.0)), meta,
    )  # fmt: skip


def _air(place: int, count: int) -> float:
    """Rise of the laboratory's temperature at a place in the order of a block, K."""
    return DRIFT * place / max(count - 1, 1)


def _runs(
    actuator: Actuator,
    cells: Sequence[Case],
    orders: npt.NDArray[np.int64],
    kind: LoadKind,
    seed: int,
) -> dict[tuple[int, int], Run]:
    """Every run by block and cell."""
    from elevon.scenario import Scenario

    runs = {}
    nominal = actuator.with_values(SOLVER)
    scenarios = [Scenario.from_dict(profile_scenario(p, load, kind)) for p, load in cells]
    for block, order in enumerate(orders):
        unit = draw_units(nominal, f"block {block}", 1, seed)[0]
        for place, cell in enumerate(order.tolist()):
            warm = unit.parameters.value("thermal.ambient") + _air(place, len(cells))
            values = {"thermal.ambient": warm}
            profile, load = cells[cell]
            label = f"{profile.name} {1e3 * profile.amplitude:g} mm {load:g} N, block {block + 1}"
            runs[block, cell] = Run(
                unit.with_values(values), scenarios[cell], seed, label, block * len(cells) + place
            )
    return runs


def _sheet(cells: Sequence[Case], orders: npt.NDArray[np.int64]) -> list[dict[str, Any]]:
    """Return the run sheet: what was done in which order."""
    return [
        {
            "block": block + 1,
            "order": place + 1,
            "profile": cells[cell][0].name,
            "amplitude_mm": 1e3 * cells[cell][0].amplitude,
            "rate_mm_s": 1e3 * cells[cell][0].rate,
            "load_n": cells[cell][1],
        }
        for block, order in enumerate(orders)
        for place, cell in enumerate(order.tolist())
    ]


def _measure(
    runs: dict[tuple[int, int], Run],
    cells: Sequence[Case],
    store: CellStore,
    progress: Progress | None,
) -> dict[tuple[int, int], tuple[float, ...]]:
    """Return `MEASURES` of every run; runs that share a batch go together."""
    alike: dict[tuple[bool, float], list[tuple[int, int]]] = {}
    for place in runs:
        profile = cells[place[1]][0]
        wave = profile.name in ("sinusoidal", "sweep")
        alike.setdefault((wave, profile.duration), []).append(place)
    groups = [g[i : i + BATCH] for g in alike.values() for i in range(0, len(g), BATCH)]
    done, total = 0.0, sum(float(run.scenario.duration) for run in runs.values())
    measured: dict[tuple[int, int], tuple[float, ...]] = {}
    for number, group in enumerate(groups):
        spent = sum(float(runs[place].scenario.duration) for place in group)
        values = store.get(f"group {number}")
        if values is None:
            span = part(progress, min(done / total, 1.0), min((done + spent) / total, 1.0))
            chosen = [runs[place] for place in group]
            recordings = simulate_batch(chosen, fidelity="high", record=RECORD, progress=span)
            periods = [cells[place[1]][0].period for place in group]
            values = np.array(list(map(_measures, completed(recordings), periods)))
            store.put(f"group {number}", values)
        done += spent
        measured |= {place: tuple(v) for place, v in zip(group, values.tolist(), strict=True)}
    return measured


def _measures(recording: Recording, period: float) -> list[float]:
    label, meta = recording.meta["label"], recording.meta
    time = recording["command"].time
    late = time >= SETTLE
    if math.isfinite(period) and time[-1] >= SETTLE + period:
        # Whole cycles: the half that the load opposes then weighs as much as the other.
        cycles = math.floor((time[-1] - SETTLE) / period + 1e-9)
        late &= time < SETTLE + cycles * period
    if not np.any(late):
        raise RangeError(
            f"{label}: ended at {meta['sim_s']:g} s, before the statistics begin at {SETTLE:g} s"
        )
    currents = np.stack([recording[f"current_{phase}"].values[late] for phase in "abc"])
    error = recording["command"].values[late] - recording["output_position"].values[late]
    winding = recording["winding_temperature"].values
    read = min(int(np.searchsorted(time, HISTORY - 1e-6)), time.size - 1)
    return [
        float(np.sqrt(np.mean(currents**2))),
        float(np.max(np.abs(currents))),
        1e3 * float(np.sqrt(np.mean(error**2))),
        1e3 * float(np.max(np.abs(error))),
        float(winding[read] - winding[0]),
        float(np.mean(recording["limited"].values[late])),
    ]


def _rows(
    cells: Sequence[Case],
    refusals: Sequence[str | None],
    measured: Mapping[tuple[int, int], tuple[float, ...]],
    able: Capability,
) -> list[BaselineRow]:
    rows = []
    for place, ((profile, load), reason) in enumerate(zip(cells, refusals, strict=True)):
        runs = tuple(run for (_, cell), run in sorted(measured.items()) if cell == place)
        status = "limited" if able.limited(profile, load) else "ok"
        rows.append(BaselineRow(profile, load, "refused" if reason else status, reason or "", runs))
    return rows


def _level(row: BaselineRow) -> list[float] | None:
    """Levels of the factors of a row, or None where it is not of the two-level part."""
    sets: tuple[tuple[object, object, object], ...] = (
        (row.profile.name, FACTORS[0].low, FACTORS[0].high),
        (row.profile.amplitude, *AMPLITUDES),
        (row.profile.rate, *RATES),
        (abs(row.load), 500.0, 8500.0),
        (row.direction, FACTORS[4].low, FACTORS[4].high),
    )
    if not all(value in {low, high} for value, low, high in sets):
        return None
    return [1.0 if value == high else -1.0 for value, _, high in sets]


def _effects(
    rows: Sequence[BaselineRow], replicates: int, seed: int
) -> tuple[dict[str, list[FactorEffect]], list[Check]]:
    """Effects of each response, and the recovery of known effects through the same design."""
    chosen = [(level, row) for row in rows if row.runs and (level := _level(row)) is not None]
    levels = np.array([level for level, _ in chosen for _ in range(replicates)])
    block = np.tile(np.arange(replicates), len(chosen))
    fitted = {}
    for name in RESPONSES:
        column = list(MEASURES).index(name)
        response = np.array([run[column] for _, row in chosen for run in row.runs])
        fitted[name] = fit_effects(FACTORS, levels, block, response)
    column = list(MEASURES).index(RESPONSES[0])
    current = np.array([run[column] for _, row in chosen for run in row.runs])
    matrix = model_matrix(FACTORS, levels, block)
    weights, *_ = np.linalg.lstsq(matrix, current, rcond=None)
    truth = {
        "effects": [effect.effect for effect in fitted[RESPONSES[0]]],
        "block": float(np.std(weights[:replicates])),
        "scatter": float(np.std(current - matrix @ weights)),
    }
    share, bias = coverage(FACTORS, levels, block, truth, seed=seed)
    return fitted, [
        Check("known effects held by their intervals, at least", 100 * share, 85.0, "%", True),
        Check("known effects held by their intervals, at most", 100 * share, 97.0, "%"),
        Check("known effects: mean error over its deviation", bias, 0.25, "1"),
    ]


def _checks(rows: Sequence[BaselineRow], actuator: Actuator) -> list[Check]:
    value = actuator.parameters.value
    ran = [row for row in rows if row.runs]
    ramped = [row for row in ran if row.profile.ramped]
    sines = [row for row in ran if row.profile.name == "sinusoidal"]
    checks = [
        Check("cells that were refused", float(len(rows) - len(ran)), 0.0),
        Check("largest rms phase current", _worst(ran, "rms_current_a"),
              value("rating.current") / math.sqrt(2.0), "A"),
    ]  # fmt: skip
    if ramped:
        worst = _worst(ramped, "tracking_max_mm")
        checks.append(Check("largest tracking error of a ramp", worst, 10.0, "mm"))
    if sines:
        worst = _worst(sines, "tracking_rms_mm")
        checks.append(Check("largest rms tracking error of a sine", worst, 0.3, "mm"))
    return checks


def _worst(rows: Sequence[BaselineRow], name: str) -> float:
    return max((row.mean(name) for row in rows), default=float("nan"))


def _order_checks(rows: Sequence[BaselineRow]) -> list[Check]:
    """Tensile and compressive runs are mirror images but for the start; more load, more current."""
    currents = {
        (row.profile, row.load): row.mean("rms_current_a")
        for row in rows
        if row.profile.amplitude > 0.0 and row.runs
    }
    mirrored = [
        abs(current / currents[profile, -load] - 1.0)
        for (profile, load), current in currents.items()
        if load > 0.0 and (profile, -load) in currents
    ]
    falls = 0
    for (profile, load), current in currents.items():
        larger = {500.0: 4500.0, 4500.0: 8500.0}.get(abs(load))
        if larger is not None:
            falls += currents[profile, float(np.copysign(larger, load))] <= current
    return [
        Check("rms current, compressive against tensile", 100.0 * max(mirrored), 6.0, "%"),
        Check("loads whose increase does not raise the current", float(falls), 0.0),
    ]
