"""The report of `diagnosis-limits`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report import Report, ReportTable, provenance
from elevon.report.figures import COLOURS, new_figure
from studies.diagnosis_limits.logs import TESTS
from studies.diagnosis_limits.plan import FAULTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from studies.diagnosis_limits.result import DiagnosisLimits

__all__ = ["limits_report"]

_COLOURS = dict(zip(TESTS, ("blue", "orange", "green"), strict=True))


def limits_report(result: DiagnosisLimits, *, date: str | None = None) -> Report:
    """Return the report."""
    values = result.to_dict()
    report = Report(
        "How small a fault the diagnosis sees",
        f"{values['units']} units of a bench that is unlike the model (two masses with elastic "
        "backlash, carrier PWM, another friction law, imperfect sensors), each calibrated on one "
        f"healthy log a test; {values['healthy_logs']} healthy and {values['faulty_logs']} faulty "
        "logs of other days, those three as baselines.",
        date=date,
    )
    low, high = (100 * x for x in values["false_alarm_interval"])
    report.fact(
        "False alarms",
        f"{100 * values['false_alarm_rate']:.1f} %",
        f"{low:.1f} to {high:.1f}, set for 5",
    )
    pairs = [row for row in result.campaign.rows if row.group == "pair"]
    report.fact(
        "Pairs named", f"{sum(r.named for r in pairs)} of {len(pairs)}", "both and no other"
    )
    report.section("Checks").checks(result.checks)
    report.section("Detection curve").figure(
        _curve(result),
        "Share of logs whose fault is named, and only it, against the severity over its limit; "
        "bars: 95 % (Clopper and Pearson).",
    )
    report.section("All parts").table(_table(values["rows"]))
    seed, units = values["seed"], values["units"]
    command = f"python -m studies diagnosis-limits --seed {seed} --runs {units} --out DIR"
    report.provenance(provenance(command, Seed=seed))
    return report


def _curve(result: DiagnosisLimits) -> Figure:
    table = result.rows()
    with new_figure(len(FAULTS), height=1.7 * len(FAULTS), squeeze=False) as (figure, axes):
        for axis, fault in zip(axes[:, 0], FAULTS, strict=True):
            for test in TESTS:
                rows = [r for r in table if r["fault"] == fault.kind and r["test"] == test]
                x = np.array([r["severity"] for r in rows]) / fault.at(test)
                share = np.array([r["share"] for r in rows])
                ends = np.array([r["interval"] for r in rows]).reshape(-1, 2)
                bars = np.maximum([share - ends[:, 0], ends[:, 1] - share], 0.0)
                colour = COLOURS[_COLOURS[test]]
                axis.errorbar(x, share, bars, fmt="o-", color=colour, label=test, capsize=2)
            axis.set_ylabel(fault.kind.replace("_", " "))
            axis.set_ylim(-0.05, 1.05)
        axes[0, 0].legend()
        axes[-1, 0].set_xlabel("severity over its limit")
    return figure


def _table(rows: list[dict[str, object]]) -> ReportTable:
    names = ("group", "test", "fault", "severity", "logs", "detected", "isolated", "error_median",
             "coverage")  # fmt: skip
    cells = [["-" if row[n] is None else _text(row[n]) for n in names] for row in rows]
    return ReportTable([n.replace("_", " ") for n in names], cells)


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
