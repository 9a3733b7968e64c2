"""A thousand half-second high-fidelity runs, healthy and faulty, logged at 400 Hz, everything but
process start.

Prints one JSON object. Started by run.py in a fresh process so that imports and the building of
runs count.
"""

import time

START = time.perf_counter()

import json  # noqa: E402
import sys  # noqa: E402
from pathlib import Path  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parent))

import job  # noqa: E402

import elevon  # noqa: E402

KINDS = [
    [],
    [{"kind": "short", "place": "motor.phase_a", "severity": 0.1}],
    [{"kind": "eccentricity_static", "place": "motor", "severity": 0.1}],
    [{"kind": "friction", "place": "transmission", "severity": 0.25}],
    [{"kind": "backlash", "place": "transmission", "severity": "0.13 deg"}],
]


def main() -> None:
    """Build, run, check, report."""
    model = job.actuator()
    runs = [
        elevon.Run(model, job.scenario(0.5, 5.0 + 0.01 * (i // 5), KINDS[i % 5]), i, str(i))
        for i in range(1000)
    ]
    built = time.perf_counter()
    recs = elevon.simulate_batch(runs, record=job.RECORD)
    done = time.perf_counter()
    assert len(recs) == 1000
    assert all(rec.meta["status"] == "ok" for rec in recs)
    print(
        json.dumps(
            {"seconds": done - START, "before_batch_s": built - START, "batch_s": done - built}
        )
    )


if __name__ == "__main__":
    main()
