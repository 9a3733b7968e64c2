"""Which commands exist and where they live."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Command:
    """One command: the module that holds its ``app`` and the line shown by ``elevon --help``."""

    module: str
    help: str

    @property
    def available(self) -> bool:
        """Whether the module is part of this installation."""
        return importlib.util.find_spec(self.module) is not None


COMMANDS: dict[str, Command] = {
    "list": Command(
        "elevon.cli.list", "List actuators, signals, parameters, faults, waveforms, features."
    ),
    "show": Command("elevon.cli.show", "Show an actuator: parameters, sources, block diagram."),
    "new": Command("elevon.cli.new", "Write a commented file for an actuator of your own."),
    "check": Command("elevon.cli.check", "Report all that is wrong with a set or scenario file."),
    "simulate": Command("elevon.cli.simulate", "Simulate one actuator and keep what it did."),
    "campaign": Command("elevon.cli.campaign", "Run plans of many labelled simulations."),
    "dataset": Command("elevon.cli.dataset", "Describe, verify, export, split a data set."),
    "compare": Command("elevon.cli.compare", "Compare the high and the low fidelity model."),
    "response": Command("elevon.cli.response", "Measure a frequency response, with a Bode plot."),
    "fit-low": Command("elevon.cli.fit_low", "Tune the low model against the high one."),
    "bench": Command("elevon.cli.bench", "Run the virtual test bench's procedures."),
    "design": Command("elevon.cli.design", "Design experiments and parts."),
    "loads": Command("elevon.cli.loads", "Turn a recorded flight into an actuator's load."),
    "import": Command("elevon.cli.import_log", "Read bench and drive logs into recordings."),
    "features": Command("elevon.cli.features", "Compute features of a recording or a log."),
    "calibrate": Command("elevon.cli.calibrate", "Fit an actuator's parameters to logs."),
    "validate": Command(
        "elevon.cli.validate", "Check an actuator against logs it was not fitted to."
    ),
    "diagnose": Command("elevon.cli.diagnose", "Say what is wrong, where, how bad, how sure."),
    "monitor": Command("elevon.cli.monitor", "Watch a unit's stream; alarm when a fault begins."),
    "predict": Command("elevon.cli.predict", "Say how long a unit will do what it must."),
    "diagnose-train": Command(
        "elevon.cli.diagnose_train", "Train the surrogate that diagnose --method surrogate asks."
    ),
    "fleet": Command("elevon.cli.fleet", "Group the maintenance of several units."),
    "next-test": Command(
        "elevon.cli.next_test", "Propose the test that tells most about what is ambiguous."
    ),
    "demo": Command(
        "elevon.cli.demo", "Let a unit wear, diagnose it, predict its end; one report."
    ),
    "reproduce": Command("elevon.cli.reproduce", "Recompute a published table or figure."),
}
