"""What a session costs: stepped 1 ms at a time against one call, and a call of the low model.

    .venv/bin/python benchmarks/session.py

Ratios are of the processor time of one process, alternating, the best of some repeats.
"""

import json
import time

import elevon

SECONDS = {"high": 0.5, "low": 4.0}
REPEATS = 7


def _once(actuator, fidelity):
    scenario = {**actuator.default_scenario, "duration": SECONDS[fidelity]}
    began = time.process_time()
    elevon.simulate(actuator, scenario, fidelity=fidelity, record="output_position@1 kHz")
    return time.process_time() - began


def _stepped(actuator, fidelity):
    session = elevon.Session(actuator, actuator.default_scenario, fidelity=fidelity)
    calls = round(SECONDS[fidelity] / 1e-3)
    began = time.process_time()
    for _ in range(calls):
        session.advance(1e-3)
    return time.process_time() - began


def main():
    rows = []
    for name in ("torino-rotary", "nasa-ballscrew", "pisa-landing-gear"):
        actuator = elevon.Actuator.load(name)
        for fidelity, seconds in SECONDS.items():
            once, stepped = [], []
            for _ in range(REPEATS):
                once.append(_once(actuator, fidelity))
                stepped.append(_stepped(actuator, fidelity))
            ratio, call = min(stepped) / min(once), 1e3 * min(stepped) / seconds
            rows.append({"actuator": name, "fidelity": fidelity, "ratio": ratio, "us_a_call": call})
            print(f"{name:18} {fidelity:5} stepped/once {ratio:5.2f}   {call:7.2f} us a call")
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
