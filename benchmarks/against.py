"""Time this checkout against another one, both in one run: ``against.py OTHER [--json]``.

OTHER is a checkout of the project whose extension is built (``make build`` there). Each of the two
runs its own ``run.py`` functions in a process of its own, one after the other within a round, so
that a machine that slows down slows both; the C yardsticks run in each round as well. A figure is
the best of the rounds, a ratio one of the bests.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
FIGURES = {
    "single": ("ns/step", "run.high(False)['core']"),
    "full": ("ns/step", "run.high(True)['core']"),
    "batch": ("ns/lane step", "run.batch(False)"),
    "batch_full": ("ns/lane step", "run.batch(True)"),
    "low": ("x real time", "run.low()"),
    "low_batch": ("x real time", "run.low_batch()"),
    "thousand": ("s", "run.thousand()['seconds']"),
}
YARDSTICKS = {"c": 1_000_000, "c_batch": 1_000_000}
WORKER = """
import json, sys
sys.path.insert(0, sys.argv[1])
import run
for line in sys.stdin:
    print(json.dumps(eval(line)), flush=True)
"""


class Checkout:
    """A process that evaluates the ``run.py`` functions of one checkout."""

    def __init__(self, root: Path) -> None:
        paths = [str(root / "python"), os.environ.get("PYTHONPATH", "")]
        self.process = subprocess.Popen(
            [sys.executable, "-c", WORKER, str(root / "benchmarks")],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
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


def rounds(other: Path, names: list[str], count: int) -> dict[str, dict[str, Any]]:
    """Every figure of both checkouts, and the yardsticks', `count` times in turn."""
    import yardsticks

    before, after = Checkout(other), Checkout(HERE.parent)
    kept: dict[str, dict[str, list[float]]] = {n: {"before": [], "after": []} for n in names}
    c: dict[str, list[float]] = {name: [] for name in YARDSTICKS}
    with tempfile.TemporaryDirectory() as folder:
        sticks = yardsticks.build(Path(folder))
        for index in range(count):
            for name, steps in YARDSTICKS.items():
                result = sticks[name].run(steps)
                c[name].append(result.get("ns_per_step") or result["ns_per_lane_step"])
            for name in names:
                call = FIGURES[name][1]
                kept[name]["before"].append(before.measure(call))
                kept[name]["after"].append(after.measure(call))
            print(f"round {index + 1} of {count}", file=sys.stderr)
    table: dict[str, dict[str, Any]] = {}
    for name in names:
        unit = FIGURES[name][0]
        best = {side: better(unit, values) for side, values in kept[name].items()}
        table[name] = {"unit": unit, **best, "ratio": best["after"] / best["before"]}
    for name, stick in (
        ("single", "c"),
        ("full", "c"),
        ("batch", "c_batch"),
        ("batch_full", "c_batch"),
    ):
        if name in table:
            least = min(c[stick])
            table[name] |= {
                "c": least,
                "before_c": table[name]["before"] / least,
                "after_c": table[name]["after"] / least,
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
    parser.add_argument("--figures", default=",".join(FIGURES), help="which, separated by commas")
    given = parser.parse_args()
    sys.path.insert(0, str(HERE))
    table = rounds(given.other.resolve(), given.figures.split(","), given.rounds)
    if given.json:
        print(json.dumps(table))
    else:
        report(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
