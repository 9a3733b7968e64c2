"""What a report must say about its own making."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from elevon.report import Report
    from elevon.report.checks import Check


def provenance(command: str, **more: object) -> Mapping[str, object]:
    """Return version, interpreter and command line, and whatever else the caller names."""
    import elevon

    return {
        "Elevon": _version(elevon),
        "Python": ".".join(str(part) for part in sys.version_info[:3]),
        "Made again by": command,
    } | more


def _version(package: object) -> str:
    try:
        return str(package.__version__)  # type: ignore[attr-defined]
    except ImportError:
        return "source tree without the compiled core"


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
