"""Which profile shows which fault best: an experiment on a population of healthy and faulty units.

The features are named beforehand, one a fault. A healthy population (`population`) gives the
scale; every group of faulty units is a fresh draw from the same population with the fault seeded.
Effects have intervals that hold together over the whole table, and a profile is called the best
only where its interval lies above those of all others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.progress import Progress, part
from elevon.report import Report, ReportTable
from elevon.report.checks import Check
from elevon.report.figures import new_figure
from elevon.simulate import Run, completed, simulate_batch
from elevon_cases.nasa.features import (
    FEATURES,
    GAP,
    PEAK,
    RECORD,
    RMS,
    UNITS,
    ImpactTrace,
    compared,
    features,
    gap_impacts,
    gap_traces,
    impact_checks,
)
from elevon_cases.nasa.population import CellStore, draw_units, made_of, spread_rows, work_key
from elevon_cases.nasa.profiles import ACCELERATION, MotionProfile, profile_scenario
from elevon_cases.nasa.separation_rows import (
    POWER,
    Effect,
    EffectScale,
    GroupComparison,
    Seeded,
    SeparationResult,
    SeparationRow,
    compare_profiles,
    null_p,
)
from elevon_cases.page import BLUE, GREEN, GREY, ORANGE, RED, VIOLET, Column, table_of, with_end

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ACTUATOR = "nasa-ballscrew"
ROUNDED = ", rounded"
SHAPES = (
    "trapezoidal", "trapezoidal" + ROUNDED, "sinusoidal",
    "triangular", "triangular" + ROUNDED, "sweep",
)  # fmt: skip
"""The paper's profiles, which have sharp corners, and the two with corners at `ACCELERATION`."""
LOADS = (0.0, 500.0, 4500.0, 8500.0)
"""N of the stand (N 2.4), as forces that oppose motion of either direction."""
HALF_LOAD = 4500.0
"""Load at which half the severity is run, too."""
DURATION = 5.0
"""Time of every run [s]: every profile has the same time to show a fault."""
SOLVER = {"solver.step": 6.25e-6}
FAMILY = 0.05
"""Probability that any interval of a whole table misses."""
SPLITS = 400
CHUNK = 64


FAULTS = (
    Seeded("jam of 2 of 4 circuits", "return_jam@screw.return_channel", 2, "", RMS),
    Seeded("lubricant lost 0.8", "lubrication_loss@screw", 0.8, "", RMS),
    Seeded("debris 1 %", "contamination@screw", 0.01, "", RMS),
    Seeded("turn short 20 %", "short@motor.phase_a", 0.2, "", FEATURES[3]),
    Seeded("resistor 25 %", "resistor_short@motor.phase_a", 0.25, "", FEATURES[3]),
    Seeded("dynamic eccentricity 10 %", "eccentricity_dynamic@motor", 0.1, "", FEATURES[5]),
    Seeded("unbalance 7.27 kg cm2", "unbalance@motor.rotor", 7.27, "kg cm2", FEATURES[1]),
    Seeded("spall 2 mm", "spall@screw.groove", 2.0, "mm", FEATURES[4]),
    Seeded("resolver channel 0.95", "mismatch@sensor.resolver", 0.05, "", FEATURES[2]),
    Seeded(GAP, "adapter_gap@adapter", 0.5, "mm", PEAK),
)
"""One severity of each fault; half of it is run at `HALF_LOAD`."""


def reproduce_separation(
    *,
    faults: Sequence[Seeded] = FAULTS,
    shapes: Sequence[str] = SHAPES,
    loads: Sequence[float] = LOADS,
    reassemblies: int = 16,
    healthy: int = 240,
    seed: int = 0,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> SeparationResult:
    """Run healthy and faulty units in every profile under every load and compare one feature each.

    Parameters
    ----------
    faults : sequence of Seeded
        Faults with their severities and features.
    shapes, loads : sequence
        Profiles, and opposing loads [N].
    reassemblies, healthy : int
        Units of each fault, and healthy ones; at least 4 and twice as many.
    seed : int
        Of the draws and the runs.
    folder : Path, optional
        Where finished cells are kept, so that an interrupted run goes on.
    progress : callable, optional
        As for `simulate_batch`.

    Returns
    -------
    SeparationResult

    Raises
    ------
    Interrupted
        `progress` returned False; what was finished is in the folder.
    SimulationError
        A run did not reach its end.
    """
    actuator = Actuator.load(ACTUATOR)
    meta = made_of(actuator)
    key = work_key(seed=seed, faults=[f.text() for f in faults], healthy=healthy,
                   reassemblies=reassemblies, **meta)  # fmt: skip
    store = CellStore(folder, key)
    nominal = actuator.with_values(SOLVER)
    units = {"healthy": draw_units(nominal, "healthy", healthy, seed)}
    units |= {f.name: draw_units(nominal, f.name, reassemblies, seed) for f in faults}
    cells = [(shape, load) for load in loads for shape in shapes]
    simulated: dict[tuple[str, float], dict[str, Floats]] = {}
    for index, (shape, load) in enumerate(cells):
        span = part(progress, index / len(cells), (index + 1) / len(cells))
        simulated[shape, load] = _cell(
            units, faults, (shape, load), seed=seed, store=store, progress=span
        )
    level = 1.0 - FAMILY / (len(faults) * len(cells))
    rows = _rows(simulated, faults, EffectScale(healthy, reassemblies, level), level)
    rate, tables = _null(simulated, reassemblies, level, seed)
    seeded = any(fault.name == GAP for fault in faults)
    impacts = gap_impacts(simulated) if seeded else []
    traces = gap_traces(nominal) if seeded else []
    checks = [*null_checks(rate, tables, level), *_checks(rows), *impact_checks(simulated)]
    return SeparationResult(rows, impacts, checks, rate, tables, seed, healthy, reassemblies, level,
                            traces, meta)  # fmt: skip


def _profile(shape: str) -> MotionProfile:
    name, rounded, _ = shape.partition(ROUNDED)
    return MotionProfile(name, 0.05, 0.06, DURATION, ACCELERATION if rounded else 0.0)


def _conditions(faults: Sequence[Seeded], load: float) -> dict[str, tuple[str, list[str]]]:
    """Every condition of a load: its group of units and its faults."""
    conditions: dict[str, tuple[str, list[str]]] = {"healthy": ("healthy", [])}
    for fault in faults:
        conditions[fault.name] = (fault.name, [fault.text()])
        if load == HALF_LOAD:
            # The same units: the fault has grown in them from half to whole.
            conditions[f"half {fault.name}"] = (fault.name, [fault.text(0.5)])
    return conditions


def _cell(
    units: Mapping[str, Sequence[Actuator]],
    faults: Sequence[Seeded],
    case: tuple[str, float],
    *,
    seed: int,
    store: CellStore,
    progress: Progress | None,
) -> dict[str, Floats]:
    """Features of every unit of one profile and load, by condition; shape (units, features)."""
    from elevon.scenario import Scenario

    shape, load = case
    plain = Scenario.from_dict(profile_scenario(_profile(shape), opposing=load))
    conditions = _conditions(faults, load)
    runs = [
        Run(unit, plain.with_faults(texts) if texts else plain, seed + index,
            f"{name}, {shape}, {load:g} N, unit {index}", place)
        for place, (name, (group, texts)) in enumerate(conditions.items())
        for index, unit in enumerate(units[group])
    ]  # fmt: skip
    values = _simulated(runs, f"{shape} {load:g}", store, progress)
    counts = [len(units[group]) for group, _ in conditions.values()]
    parts = np.split(values, np.cumsum(counts)[:-1])
    return dict(zip(conditions, parts, strict=True))


def _simulated(
    runs: Sequence[Run], name: str, store: CellStore, progress: Progress | None
) -> Floats:
    """Features of all runs, a few at a time to bound the memory of their recordings."""
    chunks = []
    for start in range(0, len(runs), CHUNK):
        values = store.get(f"{name} {start}")
        if values is None:
            span = part(progress, start / len(runs), min((start + CHUNK) / len(runs), 1.0))
            recordings = simulate_batch(
                runs[start : start + CHUNK], fidelity="high", record=RECORD, progress=span
            )
            values = np.array([features(recording) for recording in completed(recordings)])
            store.put(f"{name} {start}", values)
        chunks.append(values)
    return np.concatenate(chunks)


def _rows(
    simulated: Mapping[tuple[str, float], Mapping[str, Floats]],
    faults: Sequence[Seeded],
    scale: EffectScale,
    level: float,
) -> list[SeparationRow]:
    """Every fault under every load: the effects of all profiles, and whether one is the best."""
    rows = []
    loads = dict.fromkeys(load for _, load in simulated)
    for fault, load in product(faults, loads):
        cells = {shape: cell for (shape, at), cell in simulated.items() if at == load}
        column = FEATURES.index(fault.feature)
        whole = [_effect(scale, cell, fault.name, column) for cell in cells.values()]
        best = compare_profiles(whole, level)
        drawn = next(iter(cells.values()))[fault.name].shape[0]
        for place, (shape, cell) in enumerate(cells.items()):
            half = f"half {fault.name}"
            rows.append(
                SeparationRow(
                    fault=fault.name,
                    feature=fault.feature,
                    unit=UNITS[fault.feature],
                    profile=shape,
                    load=load,
                    healthy=float(cell["healthy"][:, column].mean()),
                    faulty=float(cell[fault.name][:, column].mean()),
                    effect=whole[place],
                    half=_effect(scale, cell, half, column) if half in cell else None,
                    winner=None if best.winner is None else place == best.winner,
                    power=best.power,
                    draws=_draws(best, whole, drawn),
                )
            )
    return rows


def _effect(scale: EffectScale, cell: Mapping[str, Floats], name: str, column: int) -> Effect:
    return scale.effect(compared(cell["healthy"])[:, column], compared(cell[name])[:, column])


def _draws(best: GroupComparison, effects: Sequence[Effect], drawn: int) -> int | None:
    if best.winner is not None or not any(effect.significant for effect in effects):
        return None
    needed = best.factor * drawn
    return math.ceil(needed) if needed < 1e9 else None


def _null(
    cells: Mapping[tuple[str, float], Mapping[str, Floats]], group: int, level: float, seed: int
) -> tuple[float, float]:
    """Compare healthy units with healthy units over random splits of the population.

    Returns the share of comparisons above the threshold and the share of tables that hold any.
    """
    rng = np.random.default_rng([seed, 1])
    pool = np.concatenate([compared(cell["healthy"]) for cell in cells.values()], axis=1)
    pool = pool[:, np.all(np.isfinite(pool), axis=0)]
    above = []
    for _ in range(SPLITS):
        order = rng.permutation(pool.shape[0])
        p = null_p(pool[order[group:]], pool[order[:group]])
        above.append(p < 1.0 - level)
    exceeded = np.array(above)
    return float(exceeded.mean()), float(exceeded.any(axis=1).mean())


def null_checks(rate: float, tables: float, level: float) -> list[Check]:
    """Hold comparisons of healthy with healthy to their own level, and tables to the family's."""
    return [
        Check("healthy against healthy: comparisons above the threshold", rate,
              _sampled(1.0 - level), "1"),
        Check("healthy against healthy: tables with any", tables, _sampled(FAMILY), "1"),
    ]  # fmt: skip


def _sampled(share: float) -> float:
    """Return a share plus its one-sided 95 % sampling error over the splits.

    That of whole tables: the comparisons of one table may all go together.
    """
    return share + 1.645 * math.sqrt(share * (1.0 - share) / SPLITS)


def _checks(rows: Sequence[SeparationRow]) -> list[Check]:
    halved = [row for row in rows if row.half is not None and row.effect.significant]
    wrong = sum(abs(row.half.size) >= abs(row.effect.size) for row in halved if row.half)
    return [
        Check("faults of half severity that rank above the whole", float(wrong), 0.0),
        Check("rows in which half the severity was compared", float(len(halved)), 1.0,
              at_least=True),
    ]  # fmt: skip


SHAPE_COLOURS = {
    "trapezoidal": BLUE,
    "sinusoidal": ORANGE,
    "triangular": GREEN,
    "sweep": VIOLET,
}


def separation_page(result: SeparationResult, date: str | None = None) -> Report:
    """Return the report: best profiles, effects, the gap's impact, the population, every row."""
    report = Report(
        "Which profile shows which fault",
        f"{result.healthy} healthy units and {result.reassemblies} of each fault, every one in "
        "every profile under every load. One feature a fault, named beforehand. A profile is "
        "called the best only where its interval lies above all others and another such experiment "
        f"would find that again with a probability of {100 * POWER:.0f} %. Rounded corners have "
        f"{ACCELERATION:g} m/s2, all others are sharp as in the paper.",
        date=date,
    )
    winners = list(result.winners().values())
    named = sum(winner is not None for winner in winners)
    report.fact("Best profile named", f"{named} of {len(winners)}", "pairs of fault and load")
    report.fact("Null rate", f"{100 * result.null_rate:.2g} %", "healthy against healthy")
    level = f"{100 * result.level:.3f} %"
    report.fact("Level", level, "of each interval; 95 % for the table")
    report.section("Best profiles").figure(
        _power_map(result),
        "Largest distance from healthy, in healthy standard deviations, of each fault under each "
        "load by profile; a frame: the best, named.",
    ).table(_winners(result))
    report.section("Effect sizes").figure(
        _effects_figure(result),
        "Distance from healthy in healthy standard deviations, with the intervals that hold "
        "together over the table. The load opposes motion.",
    )
    if result.impacts:
        _add_impacts(report, result)
    spread = (("Property", "property"), ("Deviation", "deviation"), ("Why this much", "reason"))
    report.section(
        "Healthy population",
        "Nothing of it is printed: every spread is ASSUMED. Deviations are in SI units or shares "
        "of the actuator file's value; all groups, healthy and faulty, are drawn from it.",
    ).table(table_of(spread_rows(), spread))
    report.section("All rows").table(
        table_of(result.rows, _ROWS, "Every fault, load and profile.", digits=4)
    )
    command = (
        f"nasa-separation --reassemblies {result.reassemblies} --healthy {result.healthy} "
        f"--seed {result.seed}"
    )
    made = {"Parameter hash": result.meta["parameter_hash"], "Seed": result.seed,
            "Core": result.meta["version"]}  # fmt: skip
    return with_end(report, result.checks, command, made)


_ROWS: tuple[Column, ...] = (
    ("Fault", "fault"),
    ("Profile", "profile"),
    ("Load [N]", "load", ".0f"),
    ("Feature", "feature"),
    ("Unit", "unit"),
    ("Healthy", "healthy"),
    ("Faulty", "faulty"),
    ("Effect", "effect.size", "+.2f"),
    ("from", "effect.low", "+.2f"),
    ("to", "effect.high", "+.2f"),
    ("Half severity", lambda row: row.half.size if row.half else None, "+.2f"),
    ("Best", lambda row: "yes" if row.winner else ""),
)


def _add_impacts(report: Report, result: SeparationResult) -> None:
    """Add what the gap does to the load cell."""
    columns = (
        ("Profile", "profile"),
        ("Load [N]", "load", ".0f"),
        ("Excess of the peak [N]", "excess", ".0f"),
        ("from [N]", "low", ".0f"),
        ("to [N]", "high", ".0f"),
    )
    caption = "Peak of the load cell with the gap less without, 95 % intervals."
    report.section(
        "The gap's impact",
        "The paper calls the triangular profile well suited for backlash. That holds without load; "
        "under a load that opposes motion the trapezoid, whose rest lets the joint relax, hits "
        "harder.",
    ).figure(
        _impacts_figure(result.traces),
        "Load cell of the nominal actuator about the first reversal, healthy and with a gap of "
        "0.5 mm; time from the corner of the command.",
    ).table(table_of(result.impacts, columns, caption))


def _impacts_figure(traces: Sequence[ImpactTrace]) -> Figure:
    places = dict.fromkeys((trace.load, trace.profile) for trace in traces)
    with new_figure(2, 2, height=4.6, sharex=True) as (figure, axes):
        for panel, (load, shape) in zip(axes.flat, places, strict=False):
            for trace in traces:
                if (trace.load, trace.profile) == (load, shape):
                    colour, label = (RED, "gap 0.5 mm") if trace.gap else (GREY, "healthy")
                    panel.plot(1e3 * trace.time, trace.force, lw=1, color=colour, label=label)
            panel.set_title(f"{shape}, {load:.0f} N", fontsize=9)
        for panel in axes[1]:
            panel.set(xlabel="Time [ms]")
        for panel in axes[:, 0]:
            panel.set(ylabel="Load cell [N]")
        axes[0, 0].legend(fontsize=8)
    return figure


def _groups(result: SeparationResult) -> dict[tuple[str, float], list[SeparationRow]]:
    groups: dict[tuple[str, float], list[SeparationRow]] = {}
    for row in result.rows:
        groups.setdefault((row.fault, row.load), []).append(row)
    return groups


def _winners(result: SeparationResult) -> ReportTable:
    """Return the best profile of each fault and load, and what would name one."""
    rows = []
    for (fault, load), group in _groups(result).items():
        largest = max(group, key=lambda row: abs(row.effect.size))
        winner = next((row.profile for row in group if row.winner), None)
        if winner is None and not any(row.effect.significant for row in group):
            verdict = "not shown by any"
        else:
            verdict = winner or "none named"
        rows.append(
            [fault, f"{load:.0f}", largest.feature.replace("current reference", "current"),
             verdict, f"{abs(largest.effect.size):.3g}", f"{100 * largest.power:.0f} %",
             _draws_needed(largest, verdict)]
        )  # fmt: skip
    headings = ("Fault", "Load [N]", "Feature", "Best profile", "Largest effect", "Power",
                "Draws that would name one")  # fmt: skip
    return ReportTable(
        headings,
        rows,
        "Features: lines and rms of the current reference, peak of the load cell. Power: "
        "probability that the intervals of the two largest effects part in another such "
        f"experiment, were they as estimated; named from {100 * POWER:.0f} % on. Draws: of each "
        "fault, with as many times more healthy units.",
    )


def _power_map(result: SeparationResult) -> Figure:
    groups = _groups(result)
    shapes = list(dict.fromkeys(row.profile for row in result.rows))
    sizes = np.zeros((len(groups), len(shapes)))
    best: list[tuple[int, int]] = []
    for line, group in enumerate(groups.values()):
        for row in group:
            column = shapes.index(row.profile)
            sizes[line, column] = max(sizes[line, column], abs(row.effect.size))
            if row.winner:
                best.append((line, column))
    with new_figure(width=8.0, height=0.24 * len(groups) + 1.6) as (figure, axes):
        picture = axes.imshow(np.log10(np.maximum(sizes, 0.1)), aspect="auto", cmap="viridis")
        axes.grid(visible=False)
        axes.set_xticks(range(len(shapes)), shapes, rotation=20, ha="right", fontsize=8)
        names = [f"{fault}, {load:.0f} N" for fault, load in groups]
        axes.set_yticks(range(len(names)), names, fontsize=7)
        for line, column in best:
            axes.plot(column, line, "s", mfc="none", mec="white", ms=11, mew=1.5)
        figure.colorbar(picture, label="log10 of the effect size")
    return figure


def _draws_needed(row: SeparationRow, verdict: str) -> str:
    if row.draws is not None:
        return f"{row.draws:d}"
    return "over 1e9" if verdict == "none named" else ""


def _effects_figure(result: SeparationResult) -> Figure:
    faults = list(dict.fromkeys(row.fault for row in result.rows))
    loads = sorted({row.load for row in result.rows})
    shapes = list(dict.fromkeys(row.profile for row in result.rows))
    lines = (len(faults) + 1) // 2
    height = 1.9 * lines + 0.5
    with new_figure(lines, 2, width=8.0, height=height, sharex=True, squeeze=False) as (
        figure,
        grid,
    ):
        for axes, fault in zip(grid.flat, faults, strict=False):
            for place, shape in enumerate(shapes):
                rows = [r for r in result.rows if r.fault == fault and r.profile == shape]
                x = np.array([loads.index(r.load) for r in rows])
                _bars(axes, x + (place - 0.5 * (len(shapes) - 1)) * 0.7 / len(shapes), rows)
            axes.axhline(0.0, color=GREY, lw=0.8)
            axes.set_title(fault, fontsize=9)
            axes.set_xticks(range(len(loads)), [f"{load:.0f} N" for load in loads])
        for axes in grid[:, 0]:
            axes.set_ylabel("Effect size")
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure


def _bars(axes: Axes, x: np.ndarray, rows: list[SeparationRow]) -> None:
    """Draw the effects of one profile with their intervals; rounded corners have open marks."""
    shape = rows[0].profile
    name, rounded, _ = shape.partition(ROUNDED)
    size = np.array([row.effect.size for row in rows])
    ends = np.array([[row.effect.low, row.effect.high] for row in rows]).T
    axes.errorbar(
        x, size, np.abs(ends - size), fmt="o", ms=3.5, lw=1, mew=1,
        color=SHAPE_COLOURS.get(name, GREY), label=shape,
        mfc="none" if rounded else None,
    )  # fmt: skip
