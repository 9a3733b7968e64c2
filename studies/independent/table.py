"""The result in Markdown: a page of the evidence."""

from __future__ import annotations

from typing import Any

from studies.independent.result import IndependentResult

_HEAD = """# Diagnosis on logs of another program

Made by a command, not by hand:

    {command} --table FILE

Turning servos of a bench written apart from the package (`tests/calibrate/foreign.c`): other
friction laws (Coulomb, bristles), a sampled speed controller, a current loop with a lag, rigid or
elastic backlash, gear errors drawn anew in each run, windings that warm up, logs of 400 Hz and 1
kHz. Each unit is calibrated on a log of each of three tests; all other logs are of other days.
Intervals are of 95 %. Alarms are `faulty` and `unknown_fault`. Gated is `model_does_not_fit`. A
cause moves the log where one feature lies beyond five deviations of the unit's healthy days.
Unknown is `unknown_fault`, `model_does_not_fit`, a refused log, or `p_other` of one half and
more. `spread learnt`: by `elevon learn` on {learned} other days of each test of the same unit. The
screw's and the gear's logs are the package's own switching model's, so that part is no
independent judgement.

| what | found | share | interval |
|---|---|---|---|
"""

_CAUSES = """
| cause that is no candidate | test | moves the log | answer | `p_other` | best candidate |
|---|---|---|---|---|---|
"""


def independent_table(result: IndependentResult, command: str) -> str:
    """Return the page: shares, checks, and every cause with its answer."""
    lines = [_HEAD.format(command=command, learned=result.plan.learned)]
    for row in result.rows:
        low, high = row["interval"]
        share = f"{100 * row['share']:.1f} %" if row["logs"] else "-"
        found = f"{row['hits']} of {row['logs']}"
        lines.append(
            f"| {row['what']} | {found} | {share} | {100 * low:.1f} to {100 * high:.1f} % |\n"
        )
    lines.append("\n| check | value | limit | passed |\n|---|---|---|---|\n")
    for check in result.checks:
        way = "at least" if check.at_least else "at most"
        lines.append(
            f"| {check.name} | {check.value:.3g} | {way} {check.limit:g} | {_yes(check.passed)} |\n"
        )
    lines.append(_CAUSES)
    lines += [_cause(row) for row in result.causes]
    return "".join(lines)


def _cause(row: dict[str, Any]) -> str:
    answer = " and ".join([row["status"], *row["best"]])
    return (
        f"| {row['name']} | {row['test']}, {row['rate']:g} Hz | {_yes(row['moved'])} | {answer} | "
        f"{row['p_other']:.2f} | {row['most']:.2f} |\n"
    )


def _yes(value: bool) -> str:
    return "yes" if value else "no"
