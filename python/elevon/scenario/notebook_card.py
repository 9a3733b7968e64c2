"""What a notebook shows of a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.report.cards import Html, card, table

if TYPE_CHECKING:
    from elevon.scenario.scenario import Scenario, Term, Terms


def scenario_card(scenario: Scenario) -> Html:
    """Return the HTML view of a scenario: command, loads, faults, duration."""
    command, loads = scenario.command, scenario.loads
    rows: list[list[object]] = [[f"command ({command.mode})", _sum(command)]]
    rows += [["", f"{step.time}: {step.action}"] for step in command.steps]
    rows += [[f"load: {name}", _sum(getattr(loads, name))] for name in type(loads).model_fields]
    rows += [["supply", _sum(scenario.supply)], ["ambient", _sum(scenario.ambient)]]
    rows += [["fault", str(fault)] for fault in scenario.fault]
    rows += [[f"initial: {name}", value] for name, value in scenario.initial.items()]
    rows += [[f"parameter: {path}", value] for path, value in scenario.parameters.items()]
    facts = [("duration", f"{scenario.seconds:g} s"), ("", scenario.text)]
    return card("Scenario", facts, table(["", ""], [row for row in rows if row[1] != ""]))


def _sum(terms: Terms) -> str:
    return " + ".join(_term(term) for term in terms.terms if term.enabled)


def _term(term: Term) -> str:
    given: dict[str, object] = dict(term.arguments)
    if term.file is not None:
        given["file"] = term.file
    elif term.times is not None:
        given["points"] = len(term.times)
    return f"{term.kind}({', '.join(f'{name}={value}' for name, value in given.items())})"
