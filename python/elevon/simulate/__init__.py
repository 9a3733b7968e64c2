"""Simulate one run, or many of them in SIMD batches and threads, on the Rust core."""

from elevon.simulate.batch import batch_bytes, completed, simulate, simulate_batch
from elevon.simulate.prepare import Run, check_fidelity, solver_step
from elevon.simulate.prepared import PreparedResult, PreparedRun, prepare
from elevon.simulate.sensitivity import Sensitivities, sensitivities

__all__ = [
    "PreparedResult",
    "PreparedRun",
    "Run",
    "Sensitivities",
    "batch_bytes",
    "check_fidelity",
    "completed",
    "prepare",
    "sensitivities",
    "simulate",
    "simulate_batch",
    "solver_step",
]
