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


#: Modules whose name is a word of Python.
_MODULES = {"import": "import_log"}
_HELP = {
    "list": "List actuators, signals, parameters, faults, laws, waveforms, features.",
    "show": "Show an actuator: parameters, sources, block diagram.",
    "new": "Write a commented file for an actuator of your own.",
    "check": "Report all that is wrong with a set or scenario file.",
    "simulate": "Simulate one actuator and keep what it did.",
    "live": "Show an actuator at real time in the browser: move it, break it.",
    "campaign": "Run plans of many labelled simulations.",
    "dataset": "Describe, verify, export, split a data set.",
    "compare": "Compare the high and the low fidelity model.",
    "response": "Measure a frequency response, with a Bode plot.",
    "fit-low": "Tune the reduced-order model against the switching one.",
    "bench": "Run the virtual test bench's procedures.",
    "design": "Design experiments and parts.",
    "loads": "Turn a recorded flight into an actuator's load.",
    "export": "Write an actuator for other tools: FMUs, the C interface.",
    "import": "Read bench and drive logs into recordings.",
    "plot": "Draw a recording, a log, a run of a campaign or a result.",
    "doctor": "Look at a log for the first time: data, fit, verdict.",
    "features": "Compute features of a recording or a log.",
    "calibrate": "Fit an actuator's parameters to logs.",
    "validate": "Check an actuator against logs it was not fitted to.",
    "diagnose": "Say what is wrong, where, how bad, how sure.",
    "monitor": "Watch a unit's stream; alarm when a fault begins.",
    "predict": "Say how long a unit will do what it must.",
    "next-inspection": "Say when to look at a unit again, and with which test.",
    "learn": "Learn classes from labelled logs of one motion.",
    "learn-spread": "Learn from healthy logs how days and units differ.",
    "diagnose-train": "Train the surrogate that diagnose --method surrogate asks.",
    "fleet": "Group the maintenance of several units.",
    "next-test": "Propose the test that tells most about what is ambiguous.",
    "demo": "Let a unit wear, diagnose it, predict its end; one report.",
    "safety": "Run a control unit under many failures; list the hazards left.",
    "reproduce": "Recompute a published table or figure.",
}

COMMANDS = {
    name: CommandEntry(f"elevon.cli.{_MODULES.get(name, name.replace('-', '_'))}", text)
    for name, text in _HELP.items()
}
