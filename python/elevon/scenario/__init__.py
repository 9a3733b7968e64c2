"""Scenarios: what an actuator is commanded, what acts on it, and what breaks."""

from elevon.scenario.compile import CompiledScenario, compile_scenario
from elevon.scenario.scenario import Action, Command, Load, Scenario, Term, Terms

__all__ = [
    "Action",
    "Command",
    "CompiledScenario",
    "Load",
    "Scenario",
    "Term",
    "Terms",
    "compile_scenario",
]
