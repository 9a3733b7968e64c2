"""Which commands exist and where they live."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """One command: the module of its ``app``, its line in ``elevon --help``, and its purpose."""

    module: str
    help: str
    group: str

    @property
    def available(self) -> bool:
        """Whether the module is part of this installation."""
        return importlib.util.find_spec(self.module) is not None


#: Modules whose name is a word of Python.
_MODULES = {"import": "import_log"}
#: Purpose to its commands, in the order of work, each with its line of help.
_GROUPS = {
    "Actuators": {
        "list": "List actuators, signals, parameters, faults, laws, waveforms, features.",
        "show": "Show an actuator: parameters, sources, block diagram.",
        "new": "Write a commented file for an actuator of your own.",
        "check": "Report all that is wrong with a set or scenario file.",
    },
    "Simulate": {
        "simulate": "Simulate one actuator and keep what it did.",
        "live": "Show an actuator at real time in the browser: move it, break it.",
        "compare": "Compare the high and the low fidelity model.",
        "response": "Measure a frequency response, with a Bode plot.",
        "fit-low": "Tune the reduced-order model against the switching one.",
        "loads": "Turn a recorded flight into an actuator's load.",
        "design": "Design experiments and parts.",
    },
    "Many runs": {
        "campaign": "Run plans of many labelled simulations.",
        "dataset": "Describe, verify, export, split a data set.",
    },
    "Bench and logs": {
        "bench": "Run the virtual test bench's procedures.",
        "import": "Read bench and drive logs into recordings.",
        "plot": "Draw a recording, a log, a run of a campaign or a result.",
        "features": "Compute features of a recording or a log.",
    },
    "Judge a unit": {
        "doctor": "Look at a log for the first time: data, fit, verdict.",
        "calibrate": "Fit an actuator's parameters to logs.",
        "validate": "Check an actuator against logs it was not fitted to.",
        "diagnose": "Say what is wrong, where, how bad, how sure.",
        "monitor": "Watch a unit's stream; alarm when a fault begins.",
        "next-test": "Propose the test that tells most about what is ambiguous.",
        "learn": "Learn classes from labelled logs of one motion.",
        "learn-spread": "Learn from healthy logs how days and units differ.",
        "diagnose-train": "Train the surrogate that diagnose --method surrogate asks.",
    },
    "Remaining life": {
        "predict": "Say how long a unit will do what it must.",
        "next-inspection": "Say when to look at a unit again, and with which test.",
        "fleet": "Group the maintenance of several units.",
    },
    "Elsewhere": {
        "export": "Write an actuator for other tools: FMUs, the C interface.",
        "safety": "Run a control unit under many failures; list the hazards left.",
        "demo": "Let a unit wear, diagnose it, predict its end; one report.",
        "reproduce": "Recompute a published table or figure.",
    },
}

COMMANDS = {
    name: CommandEntry(f"elevon.cli.{_MODULES.get(name, name.replace('-', '_'))}", text, group)
    for group, commands in _GROUPS.items()
    for name, text in commands.items()
}
