"""Which commands exist and where they live."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """One command: the module that holds its ``app`` and the line shown by ``elevon --help``."""

    module: str
    help: str

    @property
    def available(self) -> bool:
        """Whether the module is part of this installation."""
        return importlib.util.find_spec(self.module) is not None


COMMANDS: dict[str, CommandEntry] = {
    "list": CommandEntry(
        "elevon.cli.list", "List actuators, signals, parameters, faults, waveforms, features."
    ),
    "show": CommandEntry(
        "elevon.cli.show", "Show an actuator: parameters, sources, block diagram."
    ),
    "new": CommandEntry("elevon.cli.new", "Write a commented file for an actuator of your own."),
    "check": CommandEntry(
        "elevon.cli.check", "Report all that is wrong with a set or scenario file."
    ),
    "simulate": CommandEntry("elevon.cli.simulate", "Simulate one actuator and keep what it did."),
    "campaign": CommandEntry("elevon.cli.campaign", "Run plans of many labelled simulations."),
    "dataset": CommandEntry("elevon.cli.dataset", "Describe, verify, export, split a data set."),
    "compare": CommandEntry("elevon.cli.compare", "Compare the high and the low fidelity model."),
    "response": CommandEntry(
        "elevon.cli.response", "Measure a frequency response, with a Bode plot."
    ),
    "fit-low": CommandEntry(
        "elevon.cli.fit_low", "Tune the reduced-order model against the switching one."
    ),
    "bench": CommandEntry("elevon.cli.bench", "Run the virtual test bench's procedures."),
    "design": CommandEntry("elevon.cli.design", "Design experiments and parts."),
    "loads": CommandEntry("elevon.cli.loads", "Turn a recorded flight into an actuator's load."),
    "import": CommandEntry("elevon.cli.import_log", "Read bench and drive logs into recordings."),
    "features": CommandEntry("elevon.cli.features", "Compute features of a recording or a log."),
    "calibrate": CommandEntry("elevon.cli.calibrate", "Fit an actuator's parameters to logs."),
    "validate": CommandEntry(
        "elevon.cli.validate", "Check an actuator against logs it was not fitted to."
    ),
    "diagnose": CommandEntry("elevon.cli.diagnose", "Say what is wrong, where, how bad, how sure."),
    "monitor": CommandEntry(
        "elevon.cli.monitor", "Watch a unit's stream; alarm when a fault begins."
    ),
    "predict": CommandEntry("elevon.cli.predict", "Say how long a unit will do what it must."),
    "diagnose-train": CommandEntry(
        "elevon.cli.diagnose_train", "Train the surrogate that diagnose --method surrogate asks."
    ),
    "fleet": CommandEntry("elevon.cli.fleet", "Group the maintenance of several units."),
    "next-test": CommandEntry(
        "elevon.cli.next_test", "Propose the test that tells most about what is ambiguous."
    ),
    "demo": CommandEntry(
        "elevon.cli.demo", "Let a unit wear, diagnose it, predict its end; one report."
    ),
    "safety": CommandEntry(
        "elevon.cli.safety", "Run a control unit under many failures; list the hazards left."
    ),
    "reproduce": CommandEntry("elevon.cli.reproduce", "Recompute a published table or figure."),
}
