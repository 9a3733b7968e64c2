"""What features cost: the same runs with logs alone and with logs and features, in one process.

    python benchmarks/features.py [RUNS]

Half-second high-fidelity rotary runs with faults, one thread, medians of three turns each.
"""

import statistics
import sys
import time

from elevon.actuator import Actuator
from elevon.scenario import Scenario
from elevon.simulate import Run
from elevon.simulate.batch import simulate_prepared
from elevon.simulate.prepare import prepare

RECORD = "drive_log,essential@400 Hz"


def prepared(count, features):
    """Return runs ready for the core, each with a short of its own severity."""
    actuator = Actuator.load("torino-rotary")
    term = {"kind": "sine", "amplitude": "7 deg", "frequency": "2 Hz"}
    made = []
    for number in range(count):
        fault = [f"short@motor.phase_a={0.3 * (number + 1) / count}"]
        data = {"duration": "0.5 s", "command": {"terms": [term]}, "fault": fault}
        run = Run(actuator, Scenario.from_dict(data, "benchmark"), number=number)
        made.append(prepare(run, "high", RECORD, features, doubts=False))
    return made


def main(count):
    """Print seconds of each form and what a row of features costs."""
    forms = {"logs": None, "all@400 Hz": "all@400 Hz", "all@10 kHz": "all@10 kHz"}
    runs = {name: prepared(count, features) for name, features in forms.items()}
    spent = {name: [] for name in forms}
    for _ in range(3):
        for name, items in runs.items():
            start = time.perf_counter()
            simulate_prepared(items, fidelity="high", threads=1)
            spent[name].append(time.perf_counter() - start)
    base = statistics.median(spent["logs"])
    for name, times in spent.items():
        seconds = statistics.median(times)
        print(f"{name:12s} {seconds:8.3f} s  {seconds / base:6.3f} of logs alone")
    rows = 5001 * count
    extra = statistics.median(spent["all@10 kHz"]) - base
    print(f"features at 10 kHz: {1e9 * extra / rows:.0f} ns a row")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 256)
