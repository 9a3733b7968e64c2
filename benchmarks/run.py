"""Time the simulator beside C yardsticks and peers, all in one process, alternating: ``run.py
[--json]``.

Each figure is the median of interleaved repetitions, so that a machine that slows down slows every
contestant; ratios are medians of the ratios within one repetition. See README.md for what is timed.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import job
import peers
import yardsticks

import elevon
from elevon import _core

STEPS = 1_000_000
SECONDS = STEPS * 1e-6  # the common job's second, in every lane
LANES = 64
LOW_SECONDS = 500.0
LOW_BATCH_SECONDS = 100.0


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Wall seconds and result of one call."""
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def high(variant: str = "common", step: float = 1e-6) -> dict[str, float]:
    """A second of a variant of the job by the public call, in ns per microsecond simulated.

    All of it, and the integration alone.
    """
    model, scene = job.actuator(variant, step), job.scenario(SECONDS, variant=variant)
    wall, rec = timed(lambda: elevon.simulate(model, scene, record=job.RECORD))
    return {"call": wall / STEPS * 1e9, "core": rec.meta["wall_s"] / STEPS * 1e9}


def batch(variant: str = "common", step: float = 1e-6) -> float:
    """64 runs side by side on one thread, ns per run and microsecond."""
    model = job.actuator(variant, step)
    runs = [
        elevon.Run(model, job.scenario(SECONDS, 7.0 + 0.05 * i, variant=variant), i, str(i))
        for i in range(LANES)
    ]
    wall, _ = timed(lambda: elevon.simulate_batch(runs, record=job.RECORD, threads=1))
    return wall / STEPS / LANES * 1e9


def low() -> float:
    """Simulated seconds a wall second of one low-fidelity run on one thread."""
    model, scene = elevon.Actuator.load("torino-rotary"), job.scenario(LOW_SECONDS)
    record = ["output_position,motor_speed,current_q@400 Hz"]
    wall, _ = timed(lambda: elevon.simulate(model, scene, fidelity="low", record=record))
    return LOW_SECONDS / wall


def low_batch() -> float:
    """The same in lanes, one thread: simulated seconds of all runs a wall second."""
    model = elevon.Actuator.load("torino-rotary")
    runs = [
        elevon.Run(model, job.scenario(LOW_BATCH_SECONDS, 5.0 + 0.1 * i), i, str(i))
        for i in range(LANES)
    ]
    record = ["output_position,motor_speed,current_q@400 Hz"]
    wall, _ = timed(lambda: elevon.simulate_batch(runs, fidelity="low", record=record, threads=1))
    return LANES * LOW_BATCH_SECONDS / wall


def thousand() -> dict[str, float]:
    """A thousand runs in a fresh process, imports included (thousand.py)."""
    script = Path(__file__).resolve().parent / "thousand.py"
    out = subprocess.run(
        [sys.executable, str(script)], check=True, capture_output=True, text=True
    ).stdout
    return dict(json.loads(out))


def agreement(sticks: dict[str, yardsticks.Yardstick]) -> dict[str, float]:
    """Do the timed programs compute the same thing? One simulated second."""
    ours = elevon.simulate(job.actuator(), job.scenario(1.0), record=["output_position@400 Hz"])
    theirs = sticks["c_count"].run(STEPS)
    return {
        "output_deg": math.degrees(ours.final["output_position"]),
        "c_output_deg": theirs["output_deg"],
        "output_difference_deg": math.degrees(ours.final["output_position"]) - theirs["output_deg"],
        "transitions": ours.final["leg_transitions"],
        "c_transitions": theirs["transitions"],
        "transitions_ratio": ours.final["leg_transitions"] / theirs["transitions"],
    }


def rounds(sticks: dict[str, yardsticks.Yardstick], count: int) -> list[dict[str, float]]:
    """`count` interleaved rounds of every contestant, after one uncounted warm-up."""
    found = []
    for index in range(count + 1):
        single, full = high(), high("full")
        figures = {
            "c_ns_per_step": sticks["c"].run(STEPS)["ns_per_step"],
            "high_ns_per_step": single["call"],
            "high_core_ns_per_step": single["core"],
            "c_poly_ns_per_step": sticks["c_poly"].run(STEPS)["ns_per_step"],
            "high_full_ns_per_step": full["call"],
            "c_batch_ns_per_lane_step": sticks["c_batch"].run(STEPS)["ns_per_lane_step"],
            "batch_ns_per_lane_step": batch(),
            "batch_full_ns_per_lane_step": batch("full"),
            "low_realtime_factor": low(),
            "low_batch_realtime_factor": low_batch(),
        }
        print(f"round {index} of {count}", file=sys.stderr)
        if index:
            found.append(figures)
    return found


RATIOS = {
    "ratio_c": ("high_ns_per_step", "c_ns_per_step"),
    "ratio_c_poly": ("high_ns_per_step", "c_poly_ns_per_step"),
    "ratio_full_c": ("high_full_ns_per_step", "c_ns_per_step"),
    "ratio_full_c_poly": ("high_full_ns_per_step", "c_poly_ns_per_step"),
    "ratio_batch_c": ("batch_ns_per_lane_step", "c_batch_ns_per_lane_step"),
    "ratio_batch_full_c": ("batch_full_ns_per_lane_step", "c_batch_ns_per_lane_step"),
}


def summary(found: list[dict[str, float]]) -> dict[str, float]:
    """Medians of the figures and of the ratios within each round."""
    result = {name: statistics.median(f[name] for f in found) for name in found[0]}
    for name, (ours, theirs) in RATIOS.items():
        result[name] = statistics.median(f[ours] / f[theirs] for f in found)
    return result


def report(result: dict[str, Any], indent: str = "") -> None:
    """The table for people."""
    for name, value in result.items():
        if isinstance(value, dict):
            print(f"{indent}{name}")
            report(value, indent + "    ")
        else:
            text = f"{value:.6g}" if isinstance(value, float) else value
            print(f"{indent}{name:{36 - len(indent)}s} {text}")


def main() -> int:
    """Everything in one go; exit 1 if the programs do not agree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    parser.add_argument("--rounds", type=int, default=7, help="interleaved repetitions (7)")
    parser.add_argument("--no-peers", action="store_true", help="leave out the slow peers")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sticks = yardsticks.build(Path(folder))
        result: dict[str, Any] = dict(summary(rounds(sticks, given.rounds)))
        result["agreement"] = agreement(sticks)
        flags = sticks["c_batch"].flags
    many = thousand()
    result["thousand_runs_s"] = many.pop("seconds")
    result["thousand_runs"] = many
    result["peers_s_per_simulated_s"] = {} if given.no_peers else peers.measure()
    result["machine"] = {
        "cpu": yardsticks.cpu_model(),
        "flags": " ".join(yardsticks.cpu_flags()),
        "widths": _core.widths(),
        "lanes_c": LANES,
        "c_batch_flags": " ".join(flags),
        "rounds": given.rounds,
        "version": elevon.__version__,
    }
    if given.json:
        print(json.dumps(result))
    else:
        report(result)
    agrees = result["agreement"]
    close = (
        abs(agrees["output_difference_deg"]) <= 0.01
        and abs(agrees["transitions_ratio"] - 1) <= 0.05
    )
    return 0 if close else 1


if __name__ == "__main__":
    sys.exit(main())
