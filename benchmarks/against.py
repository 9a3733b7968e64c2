"""Time this checkout against another one, both in one run: ``against.py OTHER [--json]``.

OTHER is a checkout of the project whose extension is built (``make setup`` there). The packages of
both run the ``run.py`` functions of this checkout, each in a process of its own, one after the
other within a round, so that a machine that slows down slows both; the C yardsticks run in each
round as well. A figure is the best of the rounds, a ratio one of the bests; costs are nanoseconds
for each microsecond simulated, a step of the C march.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
FIGURES = {
    "single": ("ns/us", "run.high()['call']", "c"),
    "batch": ("ns/us", "run.batch()", "c_batch"),
    "full": ("ns/us", "run.high('full')['call']", "c"),
    "batch_full": ("ns/us", "run.batch('full')", "c_batch"),
    "carrier, 1 us": ("ns/us", "run.high('carrier')['call']", "c"),
    "carrier, 1 us, batch": ("ns/us", "run.batch('carrier')", "c_batch"),
    "carrier, 12.5 us": ("ns/us", "run.high('carrier', 12.5e-6)['call']", "c"),
    "carrier, 12.5 us, batch": ("ns/us", "run.batch('carrier', 12.5e-6)", "c_batch"),
    "located, 1 us": ("ns/us", "run.high('located')['call']", "c"),
    "located, 4 us": ("ns/us", "run.high('located', 4e-6)['call']", "c"),
    "located, 4 us, batch": ("ns/us", "run.batch('located', 4e-6)", "c_batch"),
    "thermal": ("ns/us", "run.high('thermal')['call']", "c"),
    "dead time": ("ns/us", "run.high('dead_time')['call']", "c"),
    "lugre": ("ns/us", "run.high('lugre')['call']", "c"),
    "lugre, batch": ("ns/us", "run.batch('lugre')", "c_batch"),
    "low": ("x real time", "run.low()", ""),
    "low_batch": ("x real time", "run.low_batch()", ""),
    "thousand": ("s", "run.thousand()['seconds']", ""),
}
#: Lanes of the C programs.
YARDSTICKS = {"c": 1, "c_batch": 64}
STEPS = 1_000_000
WORKER = """
import json, sys, time
sys.path.insert(0, sys.argv[1])
if sys.argv[2] == "cpu":
    time.perf_counter = time.process_time
import run
for line in sys.stdin:
    print(json.dumps(eval(line)), flush=True)
"""


class Checkout:
    """A process that evaluates the ``run.py`` functions of one checkout."""

    def __init__(self, root: Path, clock: str) -> None:
        paths = [str(root / "python"), os.environ.get("PYTHONPATH", "")]
        self.process = subprocess.Popen(
            [sys.executable, "-c", WORKER, str(HERE), clock],
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(paths),
                "OPENBLAS_NUM_THREADS": "1",
            },
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def measure(self, call: str) -> float:
        """One figure."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(call, file=self.process.stdin, flush=True)
        return float(json.loads(self.process.stdout.readline()))


def better(unit: str, values: list[float]) -> float:
    """The best of repeated figures."""
    return max(values) if unit.startswith("x") else min(values)


def yardstick(stick: Any, steps: int, lanes: int, clock: str) -> float:
    """Nanoseconds a step of a C program, by its own clock or by the CPU's."""
    begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    result = stick.run(steps)
    if clock == "cpu":
        used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - begin
        return used / steps / lanes * 1e9
    return float(result.get("ns_per_step") or result["ns_per_lane_step"])


def rounds(other: Path, names: list[str], count: int, clock: str) -> dict[str, dict[str, Any]]:
    """Every figure of both checkouts, and the yardsticks', `count` times in turn."""
    import yardsticks

    before, after = Checkout(other, clock), Checkout(HERE.parent, clock)
    kept: dict[str, dict[str, list[float]]] = {n: {"before": [], "after": []} for n in names}
    c: dict[str, list[float]] = {name: [] for name in YARDSTICKS}
    with tempfile.TemporaryDirectory() as folder:
        sticks = yardsticks.build(Path(folder))
        for index in range(count):
            for name, lanes in YARDSTICKS.items():
                c[name].append(yardstick(sticks[name], STEPS, lanes, clock))
            for name in names:
                call = FIGURES[name][1]
                kept[name]["before"].append(before.measure(call))
                kept[name]["after"].append(after.measure(call))
            print(f"round {index + 1} of {count}", file=sys.stderr)
    table: dict[str, dict[str, Any]] = {}
    for name in names:
        unit, _, stick = FIGURES[name]
        best = {side: better(unit, values) for side, values in kept[name].items()}
        table[name] = {"unit": unit, **best, "ratio": best["after"] / best["before"]}
        if stick:
            least = min(c[stick])
            table[name] |= {
                "c": least,
                "before_c": best["before"] / least,
                "after_c": best["after"] / least,
            }
    return table


def report(table: dict[str, dict[str, Any]]) -> None:
    """The table for people, as Markdown."""
    print("| figure | unit | before | after | after / before | before / C | after / C |")
    print("|---|---|---|---|---|---|---|")
    for name, row in table.items():
        ratios = [
            f"{row[key]:.2f}" if key in row else "" for key in ("ratio", "before_c", "after_c")
        ]
        figures = [f"{row[side]:.4g}" for side in ("before", "after")]
        print(f"| `{name}` | {row['unit']} | {' | '.join(figures + ratios)} |")


def main() -> int:
    """Both checkouts, figure by figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="checkout to compare with, its extension built")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    parser.add_argument("--rounds", type=int, default=7, help="interleaved repetitions (7)")
    parser.add_argument("--figures", default=";".join(FIGURES), help="which, separated by ;")
    parser.add_argument(
        "--cpu", action="store_true", help="CPU time instead of wall time: where others work, too"
    )
    given = parser.parse_args()
    sys.path.insert(0, str(HERE))
    names = [name for name in given.figures.split(";") if not (given.cpu and name == "thousand")]
    clock = "cpu" if given.cpu else "wall"
    table = rounds(given.other.resolve(), names, given.rounds, clock)
    if given.json:
        print(json.dumps(table))
    else:
        report(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
