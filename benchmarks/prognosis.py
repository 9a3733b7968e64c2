"""What a prognosis costs: an update, a prediction, and the tables before them.

    python benchmarks/prognosis.py

The mission of the run-to-failure histories: wear, lubricant loss, insulation at once. Prints wall
and processor seconds; limits: 1 s an update, 5 s a whole prediction on two cores.
"""

import time

from elevon.actuator import Actuator
from elevon.prognose import GrowthFilter, Inspection, Process, Seen, respond
from elevon.prognose.predict import prognosis
from studies.prognosis.campaign import campaign_mission

SEVERITIES = {"backlash@transmission": 2e-6, "friction@transmission": 1.5e-4}


def inspections():
    """Return ten inspections of a unit that wears while its friction grows."""
    items = []
    for usage in range(300, 3300, 300):
        seen = {key: Seen(rate * usage, 0.1 * rate * usage, 0.1 * rate * usage)
                for key, rate in SEVERITIES.items()}  # fmt: skip
        items.append(Inspection(float(usage), seen))
    return items


def timed(name, work):
    """Print wall and processor seconds of a piece of work; return its result."""
    wall, processor = time.perf_counter(), time.process_time()
    result = work()
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"{name:28s} {wall:7.3f} s wall {processor:7.3f} s of processor")
    return result


def main():
    """Time each part."""
    mission, items = campaign_mission(), inspections()
    tables = timed("tables, 343 low runs", lambda: respond(Actuator.load("torino-rotary"), mission))
    flt = GrowthFilter(Process(tables))
    for item in items[:-1]:
        flt.update(item)
    timed("one update", lambda: flt.update(items[-1]))
    timed("look ahead, 2000 samples", lambda: prognosis(flt, mission, items))


if __name__ == "__main__":
    main()
