"""Reports: one self-contained HTML page of text, tables, figures and checks.

>>> from elevon.report import Check, Report
>>> report = Report("A measured backlash")
>>> _ = report.section("What was checked").checks([Check("backlash", 0.36, 0.37, "deg")])
>>> path = report.save("report.html")  # doctest: +SKIP
"""

from elevon.report.checks import Check, all_passed, verdict
from elevon.report.document import Report, ReportTable, Section, provenance

__all__ = ["Check", "Report", "ReportTable", "Section", "all_passed", "provenance", "verdict"]
