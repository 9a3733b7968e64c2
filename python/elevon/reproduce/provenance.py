"""How the page of a case ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from elevon.report import provenance

if TYPE_CHECKING:
    from elevon.report import Report
    from elevon.report.checks import Check


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
