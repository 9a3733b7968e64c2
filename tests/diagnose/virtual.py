"""Logs of the virtual bench in memory."""

from elevon.bench.procedure import load_procedure
from elevon.bench.rig import setups
from elevon.bench.traces import first_trace, recorded, traced
from elevon.scenario.compile import signal_records
from elevon.simulate import Run, simulate_batch


def bench_logs(unit, cases, *, procedure="backlash", fidelity="low"):
    """Return one log for each (seed, faults)."""
    steps = first_trace(load_procedure(procedure))
    ready = [setups(steps, unit, faults=list(faults), seed=seed)[0] for seed, faults in cases]
    record = recorded(list(signal_records(unit.wiring, fidelity)))
    runs = [Run(s.actuator, s.scenario, s.conditions.seed) for s in ready]
    recordings = simulate_batch(runs, fidelity=fidelity, record=record)
    return [traced(s, r) for s, r in zip(ready, recordings, strict=True)]
