"""Error against the step of every drive and both models: ``accuracy.py [--draws 64] [--json]``.

The judge is a program of its own that locates every event (`tests/oracle`): relays by an adaptive
Runge-Kutta pair of tolerance 1e-9, the carrier from edge to edge. Relays are chaotic: one run
counts transitions by chance. Each relay case is therefore drawn many times, with bands within 2 %
of the case's own, the same for the judge; means are compared, the scatter of a mean is printed
beside it.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import elevon
from tests.oracle import carrier, rotary
from tests.oracle.test_carrier import AMPLITUDE as SINE
from tests.oracle.test_carrier import FREQUENCY as RATE
from tests.oracle.test_carrier import NUMBERS as CARRIER
from tests.oracle.test_carrier import SETTINGS as CARRIER_SETTINGS
from tests.oracle.test_whole_loop import AMPLITUDE, FREQUENCY, HALF_BAND, SETTINGS, numbers
from tests.physics.rig import RATIO, R, actuator, constant, make_scenario, term

RELAYS = {
    "sampled": ({}, (0.25e-6, 1e-6, 2e-6, 4e-6)),
    "located": ({"inverter.relay_crossing": "located"}, (1e-6, 2e-6, 4e-6, 8e-6)),
}
CARRIER_STEPS = (1e-6, 5e-6, 12.5e-6, 25e-6)
DURATION, SETTLED = 0.2, 0.01
BRAKE = 0.5
#: Runs kept in memory at a time.
SOME = 32
SIGNALS = "current_a,current_b,current_c,output_position,energy_copper"


def figures(
    time: np.ndarray, phases: np.ndarray, output: np.ndarray, transitions: float
) -> dict[str, Any]:
    """RMS current, copper's heat and output of one run; `phases` holds a column for each phase."""
    late = time > SETTLED
    squares = np.sum(phases[late] ** 2, axis=1)
    heat = R * float(np.sum(0.5 * (squares[1:] + squares[:-1]) * np.diff(time[late])))
    return {
        "rms": float(np.sqrt(np.mean(squares) / 3.0)),
        "heat": heat,
        "transitions": transitions,
        "output": output,
    }


def relay_bands(count: int) -> list[float]:
    """Half bands within 2 % of the case's own."""
    return [HALF_BAND * (0.98 + 0.04 * (k + 0.5) / count) for k in range(count)]


def judged_relays(band: float) -> dict[str, Any]:
    """The judge's run."""
    trace = rotary.simulate(
        replace(numbers(0.0), half_band=band),
        lambda t: AMPLITUDE * math.sin(2 * math.pi * FREQUENCY * t),
        DURATION,
        sample=8e-6,
        rtol=1e-9,
    )
    return figures(trace.time, trace.currents, trace.output, trace.transitions)


def ours(
    settings: list[dict[str, Any]], sine: tuple[float, float], brake: float, **options: Any
) -> Iterator[Any]:
    """Runs of the package, sampled as the judge samples, some at a time."""
    scene = make_scenario(
        duration=DURATION,
        mode="position",
        command=[term("sine", amplitude=sine[0], frequency=sine[1])],
        extra={"load": {"brake": {"terms": [constant(brake)]}}} if brake else {},
    )
    runs = [elevon.Run(actuator(values), scene) for values in settings]
    for k in range(0, len(runs), SOME):
        yield from elevon.simulate_batch(runs[k : k + SOME], **options)


def switching(rec: Any) -> dict[str, Any]:
    """Figures of a recording of the switching model, at its instants."""
    phases = np.stack([rec[f"current_{x}"].values for x in "abc"], axis=1)
    output = rec["output_position"].values
    found = figures(rec["current_a"].time, phases, output, rec.final["leg_transitions"])
    return found | {"heat": heat_after(rec)}


def heat_after(rec: Any) -> float:
    """The package's own account of the copper's heat."""
    channel = rec["energy_copper"]
    kept = channel.values[channel.time > SETTLED]
    return float(kept[-1] - kept[0])


def reduced(
    settings: list[dict[str, Any]], sine: tuple[float, float], brake: float
) -> list[dict[str, Any]]:
    """Figures of the reduced-order model: its quadrature current is that of three sines."""
    rows = []
    signals = ["current_q,output_position@1 kHz"]
    for rec in ours(settings, sine, brake, fidelity="low", record=signals):
        late = rec["current_q"].time > SETTLED
        rms = float(np.sqrt(np.mean(rec["current_q"].values[late] ** 2) / 2.0))
        heat = 3.0 * R * rms**2 * (DURATION - SETTLED)
        output = rec["output_position"].values
        rows.append({"rms": rms, "heat": heat, "transitions": math.nan, "output": output})
    return rows


def compared(found: list[dict[str, Any]], judged: list[dict[str, Any]]) -> dict[str, float]:
    """Relative errors of the means, their scatter, and the RMS error of the output's position."""
    row: dict[str, float] = {}
    for name in ("rms", "heat", "transitions"):
        mine, theirs = (np.array([x[name] for x in rows]) for rows in (found, judged))
        row[name] = float(np.mean(mine) / np.mean(theirs) - 1.0)
        spread = math.hypot(np.std(mine), np.std(theirs)) / math.sqrt(max(len(mine) - 1, 1))
        row[f"{name}_scatter"] = float(spread / np.mean(theirs))
    gaps = []
    for mine, theirs in zip(found, judged, strict=True):
        stride = round((len(theirs["output"]) - 1) / (len(mine["output"]) - 1))
        kept = theirs["output"][::stride]
        gaps.append(np.sqrt(np.mean((mine["output"][: len(kept)] - kept) ** 2)))
    row["position"] = float(np.mean(gaps) / np.max(np.abs(judged[0]["output"])))
    return row


def relays(draws: int) -> dict[str, dict[str, float]]:
    """Every relay case."""
    bands = relay_bands(draws)
    with ProcessPoolExecutor() as pool:
        judged = list(pool.map(judged_relays, bands))
    print("judge: relays done", file=sys.stderr)
    sine, table = (AMPLITUDE, FREQUENCY), {}
    drawn = [SETTINGS | {"inverter.hysteresis_band": band} for band in bands]
    for name, (extra, steps) in RELAYS.items():
        for step in steps:
            settings = [values | extra | {"solver.step": step} for values in drawn]
            recs = ours(settings, sine, BRAKE, record=[f"{SIGNALS}@125 kHz"])
            found = [switching(rec) for rec in recs]
            table[f"relays, {name}, {step * 1e6:g} us"] = compared(found, judged)
            print(name, step, file=sys.stderr)
    with warnings.catch_warnings():
        # It has no relays: its runs differ in nothing, the judge's do.
        warnings.simplefilter("ignore", elevon.NotActingWarning)
        table["relays, reduced-order"] = compared(reduced(drawn, sine, BRAKE), judged)
    return table


def carriers() -> dict[str, dict[str, float]]:
    """Every carrier case: nothing is chaotic, one run each."""
    trace = carrier.simulate(CARRIER, lambda t: SINE * math.sin(2 * math.pi * RATE * t), DURATION)
    edges = 6.0 * CARRIER.frequency * DURATION
    judged = [figures(trace.time, trace.currents, trace.motor / RATIO, edges)]
    sine, table = (SINE, RATE), {}
    for step in CARRIER_STEPS:
        settings = [CARRIER_SETTINGS | {"solver.step": step}]
        recs = ours(settings, sine, 0.0, record=[f"{SIGNALS}@8 kHz"])
        table[f"carrier, {step * 1e6:g} us"] = compared([switching(rec) for rec in recs], judged)
    table["carrier, reduced-order"] = compared(reduced([CARRIER_SETTINGS], sine, 0.0), judged)
    return table


def cell(value: float, scatter: float = 0.0) -> str:
    """A relative error in percent, with its scatter where chance has a part in it."""
    if math.isnan(value):
        return ""
    text = f"{100 * value:+.2g}" if abs(value) < 1e-2 else f"{100 * value:+.1f}"
    return f"{text} +- {100 * scatter:.1g}" if scatter > 0.0 else text


def report(table: dict[str, dict[str, float]]) -> None:
    """The table as Markdown; all figures in percent."""
    print("| case | output position | RMS current | copper heat | transitions |")
    print("|---|---|---|---|---|")
    for name, row in table.items():
        cells = [cell(row[key], row[f"{key}_scatter"]) for key in ("rms", "heat", "transitions")]
        print(f"| {name} | {100 * row['position']:.2g} | {' | '.join(cells)} |")


def main() -> int:
    """All cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=64, help="bands of each relay case (64)")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    given = parser.parse_args()
    table = relays(given.draws) | carriers()
    if given.json:
        print(json.dumps(table))
    else:
        report(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
