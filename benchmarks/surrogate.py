"""Time of a diagnosis by the surrogate, logs in memory to answer, with no baseline and with some.

    python benchmarks/surrogate.py [--rounds N] [--json]

Processor time and wall time of one thread (the linear algebra is held to one), least and median of
the rounds; the first answer of a process, which reads the trained file, in processes of their own.
Reading logs from files is not part of it, nor of `seconds` in the JSON of `elevon diagnose`.
"""

import argparse
import json
import os
import pickle
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from elevon import Actuator  # after the number of threads is set: NumPy reads it when loaded
from elevon.bench.procedure import load_procedure
from elevon.bench.rig import setups
from elevon.bench.traces import recorded
from elevon.bench.virtual import first_trace, traced
from elevon.diagnose.surrogate import diagnose_by_surrogate
from elevon.diagnose.surrogate.features import log_features
from elevon.scenario.compile import signal_records
from elevon.simulate import Run, simulate_batch

FAULT = "short@motor.phase_b=0.2"
BASELINES = 3
TESTS = ("backlash", "loaded")
PROCESSES = 5
FRESH = """
import pickle, sys, time
from elevon.diagnose.surrogate import diagnose_by_surrogate
with open(sys.argv[1], "rb") as stream:
    unit, log, baselines = pickle.load(stream)
begin, wall = time.process_time(), time.perf_counter()
diagnose_by_surrogate([log], unit, baselines=baselines)
print(time.process_time() - begin, time.perf_counter() - wall)
"""


def logs(unit, test):
    """Return a faulty log and healthy ones of other days, of the low model."""
    procedure = first_trace(load_procedure(test))
    faults = [[FAULT]] + [[]] * BASELINES
    made = [setups(procedure, unit, faults=f, seed=k)[0] for k, f in enumerate(faults)]
    record = recorded(list(signal_records(unit.wiring, "low")))
    runs = [Run(s.actuator, s.scenario, s.conditions.seed) for s in made]
    recordings = simulate_batch(runs, fidelity="low", record=record)
    return [traced(s, r) for s, r in zip(made, recordings, strict=True)]


def timed(run, rounds):
    """Return milliseconds of processor and wall time, least and median."""
    run()
    spent = []
    for _ in range(rounds):
        begin, wall = time.process_time(), time.perf_counter()
        run()
        spent.append((time.process_time() - begin, time.perf_counter() - wall))
    return summary(spent)


def first(unit, log, baselines):
    """Return the times of the first answer of fresh processes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "logs.pickle"
        path.write_bytes(pickle.dumps((unit, log, baselines)))
        command = [sys.executable, "-c", FRESH, str(path)]
        outputs = [
            subprocess.run(command, capture_output=True, check=True) for _ in range(PROCESSES)
        ]
    return summary([tuple(map(float, item.stdout.split())) for item in outputs])


def summary(spent):
    """Return least and median of pairs of processor and wall time."""
    cpu, wall = zip(*spent, strict=True)
    return {
        "cpu_least_ms": 1e3 * min(cpu),
        "cpu_median_ms": 1e3 * statistics.median(cpu),
        "wall_median_ms": 1e3 * statistics.median(wall),
    }


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    unit = Actuator.load("torino-rotary")
    rows = []
    for test in TESTS:
        first_log, *healthy = logs(unit, test)
        row = timed(lambda log=first_log: log_features(log, unit), options.rounds)
        rows.append({"test": test, "what": "features of one log", **row})
        for count in range(BASELINES + 1):
            ask = {"baselines": healthy[:count]}
            row = timed(
                lambda log=first_log, ask=ask: diagnose_by_surrogate([log], unit, **ask),
                options.rounds,
            )
            rows.append({"test": test, "what": f"answer, {count} baselines", **row})
        row = first(unit, first_log, healthy[:1])
        rows.append({"test": test, "what": "first answer, 1 baseline", **row})
    if options.json:
        print(json.dumps({"samples": len(first_log.log.time), "rows": rows}))
        return
    print(f"{'test':10s} {'what':26s} {'cpu least':>10s} {'median':>8s} {'wall':>8s}  [ms]")
    for row in rows:
        times = [row[name] for name in ("cpu_least_ms", "cpu_median_ms", "wall_median_ms")]
        values = " ".join(f"{value:8.2f}" for value in times)
        print(f"{row['test']:10s} {row['what']:26s}   {values}")


if __name__ == "__main__":
    main()
