"""The page of a published case: its description (`pages/NAME.toml`), filled from its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from elevon.data import packaged_toml
from elevon.report import provenance

if TYPE_CHECKING:
    from elevon.report import Report
    from elevon.report.checks import Check, WithChecks


def case_page(
    name: str,
    result: WithChecks,
    *,
    date: str | None = None,
    options: Mapping[str, object] | None = None,
) -> Report:
    """Return the report of a case.

    Parameters
    ----------
    name : str
        Of the case.
    result : WithChecks
        What it found.
    date : str, optional
        Printed on the page.
    options : mapping, optional
        Of its command: what the page says of how it is made again.
    """
    from elevon.report.described import described, text

    page = packaged_toml("elevon_cases", f"pages/{name}.toml")
    names: dict[str, object] = {
        "result": result,
        "case": import_module(type(result).__module__),
        "option": options or {},
    }
    if "values" in page:  # what an expression cannot say: a function of the result
        module, _, function = page["values"].partition(":")
        names |= getattr(import_module(module), function)(result)
    report = described(page, names, date=date)
    made = {key: text(item, names) for key, item in page.get("made", {}).items()}
    known = {key: item for key, item in made.items() if item}
    return closed(report, result.checks, text(page.get("command", name), names), **known)


def closed(
    report: Report, checks: Sequence[Check], words: str, values: str = "", /, **more: object
) -> Report:
    """Return a case's report with its checks and what made it.

    Parameters
    ----------
    report : Report
        All but that.
    checks : sequence of Check
        Of the case.
    words : str
        Of its command.
    values : str
        Digits of the parameters' values, where the report states them.
    **more
        What else is stated.
    """
    report.section("Checks").checks(checks)
    known = {"Parameter hash": values} if values else {}
    report.provenance(provenance(f"elevon reproduce {words} --out DIR", **known, **more))
    return report
