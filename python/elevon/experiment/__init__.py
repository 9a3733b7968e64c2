"""A log's test run on a model: the one replay of logs, and inference's only door to the core."""

from elevon.experiment.experiment import (
    Experiment,
    Inputs,
    ModelRun,
    Sensor,
    Variant,
    run_all,
    signals_by_role,
)

__all__ = ["Experiment", "Inputs", "ModelRun", "Sensor", "Variant", "run_all", "signals_by_role"]
