"""The page of a diagnosis: one sentence, then what it stands on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from elevon.diagnose.pictures import features_figure, traces_figure
from elevon.number_text import severity_texts
from elevon.report import Report, ReportTable
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elevon.diagnose.engine.answer import Cause, Diagnosis, Moved, Reason
    from elevon.diagnose.pictures import Traces


_DRAWN = 4  # logs
_BASELINES = 2  # drawn


def diagnosis_page(
    result: Diagnosis, actuator: str, date: str | None = None, *, traces: Sequence[Traces] = ()
) -> Report:
    """Return the report of a diagnosis.

    Parameters
    ----------
    result : Diagnosis
        The answer.
    actuator : str
        Name of the actuator.
    date : str, optional
        Printed on the page.
    traces : sequence of Traces, optional
        Of the logs, the first four of which are drawn, and of baselines, the first two.
    """
    report = Report(f"Diagnosis of {actuator}", sentence(result), date=date)
    report.judge(*_badge(result))
    _causes(report, result)
    decided = _deciding(result)
    _signals(report, [t for t in traces if not t.baseline], decided)
    _baselines(report, [t for t in traces if t.baseline])
    _features(report, result)
    if result.alternatives:
        _alternatives(report, result)
    limits = report.section("What these logs can tell")
    seen = [
        (key, severity_text(value, result.severity_units[key]))
        for key, value in result.detectable.items()
    ]
    blind = by_reason(result.unobservable)
    limits.table(
        ReportTable(
            ("fault", "least severity seen"),
            seen + blind,
            "Least severity from which on 95 % of held-out single faults were named."
            if _by_network(result)
            else "Least severity that moves the features by three deviations of a healthy unit.",
        )
    )
    for text in result.findings:
        limits.text(text)
    report.provenance(
        {
            "Elevon": result.made_by,
            "Actuator file": f"{result.actuator}, values {result.parameter_hash}",
            "Baselines": ", ".join(result.baselines) or "none",
        }
    )
    return report


def _causes(report: Report, result: Diagnosis) -> None:
    rows = [
        (
            f"{c.kind}@{c.place}",
            c.probability,
            severity_text(c.severity, c.unit),
            f"{severity_text(c.interval[0], c.unit)} to {severity_text(c.interval[1], c.unit)}",
            ", ".join(f"{kind}@{place}" for kind, place in c.ambiguous_with),
        )
        for c in result.faults
    ]
    causes = report.section("Causes")
    causes.table(
        ReportTable(
            ("cause", "probability", "severity", "90 % interval", "ambiguous with"),
            rows,
            f"Logs: {', '.join(result.logs)}. A cause that is not listed has less than 2 %.",
            digits=3,
        )
    )


def _by_network(result: Diagnosis) -> bool:
    """Whether nothing is known of what a cause accounts for: learnt classes have no model."""
    return all(math.isnan(m.explained) for m in result.features)


def _alternatives(report: Report, result: Diagnosis) -> None:
    rows = [
        (
            a.fault or "healthy",
            a.probability,
            "" if a.severity is None else severity_text(a.severity, a.unit),
            f"{a.name}, {a.log}" if len(result.logs) > 1 else a.name,
            a.left,
        )
        for a in result.alternatives
    ]
    report.section("Alternatives, and what speaks against each").table(
        ReportTable(
            ("alternative", "probability", "fits best at", "explains worst", "left"),
            rows,
            "Alone, at the severity that fits best. Left: what it leaves of the feature that it "
            "explains worst, in deviations of a healthy unit with the model's own error. Beyond "
            "three it speaks against the alternative; within, only the prior and the sum do.",
            digits=2,
            formats=("", "", "", "", "+.1f"),
        )
    )


def _badge(result: Diagnosis) -> tuple[str, Literal["pass", "fail", "open"]]:
    """Return the verdict in a word or two; a healthy unit with a residual is not decided."""
    left = any(UNEXPLAINED in text for text in result.findings)
    if result.status == "healthy":
        return ("Not decided", "open") if left else ("Healthy", "pass")
    if result.status == "faulty":
        return f"Faulty: {' and '.join(result.best)}", "fail"
    if result.status == "undecided":
        return "Undecided", "open"
    return ("Unknown fault", "fail") if result.alarm else ("Model does not fit", "open")


def _deciding(result: Diagnosis) -> Moved | None:
    """Return the feature that decided it: named with the reason, else the one furthest off."""
    name = "" if result.reason is None else result.reason.feature
    of = [m for m in result.features if m.name == name] or result.features
    return max(of, key=lambda m: abs(m.score) if math.isfinite(m.score) else 0.0, default=None)


def _displayed(value: float, unit: str) -> tuple[float, str]:
    """Return a value in the unit of the terminal; differences of temperature stay in K."""
    name = unit if unit == "K" else display_unit(unit)
    return float(to_display(value, name)), name


def _signals(report: Report, given: Sequence[Traces], decided: Moved | None) -> None:
    """Draw the log that decided it first, and of each log the signal furthest from healthy."""
    if not given:
        return
    name = "" if decided is None else decided.log
    traces = sorted(given, key=lambda item: item.name != name)[:_DRAWN]
    section = report.section("Signals against the healthy model")
    if decided is not None:
        value, unit = _displayed(decided.value, decided.unit)
        healthy, _ = _displayed(decided.expected, decided.unit)
        section.text(
            f"Furthest from healthy is {decided.name} of {decided.log}: {value:.4g} {unit}, "
            f"healthy {healthy:.4g} {unit}, {decided.score:+.3g} deviations."
        )
    for item in traces:
        named = " and the model with what is named" if item.panels[0].named is not None else ""
        text = f"{item.name} over the healthy model in the same test{named}"
        section.figure(traces_figure(item), f"{text}; means of short stretches.")


def _baselines(report: Report, traces: Sequence[Traces]) -> None:
    """Draw baselines as the logs are: what the model shows of them, no fault has to explain."""
    if not traces:
        return
    section = report.section("Baselines against the healthy model")
    section.text(
        "Where a baseline leaves the model as the log does, it is the model that is off, no fault: "
        "the log is held against the baseline there."
    )
    for item in traces[:_BASELINES]:
        text = f"{item.name} over the healthy model in the same test"
        section.figure(traces_figure(item), f"{text}; means of short stretches.")


def _features(report: Report, result: Diagnosis) -> None:
    ranked = sorted(result.features, key=lambda item: -abs(item.score))
    rows: list[tuple[object, ...]] = [
        (
            m.log, m.name, _displayed(m.value, m.unit)[1], _displayed(m.value, m.unit)[0],
            _displayed(m.expected, m.unit)[0], m.score, m.explained / m.deviation,
        )
        for m in ranked
    ]  # fmt: skip
    names: tuple[str, ...] = (
        "log",
        "feature",
        "unit",
        "value",
        "healthy",
        "deviates by",
        "explained",
    )
    formats: tuple[str, ...] = ("", "", "", "", "", "+.2f", "+.2f")
    text = "Deviates by: in deviations of a healthy unit from run to run."
    if _by_network(result):
        rows, names, formats = [row[:-1] for row in rows], names[:-1], formats[:-1]
    else:
        text += " Explained: what the most probable cause accounts for, in the same measure."
    if len(result.logs) == 1:  # one log need not be named in each row
        rows, names, formats = [row[1:] for row in rows], names[1:], formats[1:]
    section = report.section("Features")
    section.figure(
        features_figure(result.features),
        "How far the features of the logs deviate from a healthy unit: bars, in its deviations "
        "from run to run; diamonds, what the most probable cause accounts for.",
    )
    section.table(ReportTable(names, rows, text, digits=4, formats=formats))


_NAMES = {
    "backlash@transmission": "Backlash has grown by",
    "friction@transmission": "Dry friction has changed by",
    "lubrication@transmission": "Viscous friction has changed by",
    "short@motor.phase_a": "One phase has lost turns to a short:",
    "eccentricity_static@motor": "The rotor stands out of centre (static) by",
    "demagnetisation@motor": "The magnets have lost",
    "unbalance@motor.rotor": "The rotor is out of balance by",
    "gain_drift@control.position": "The position gain has drifted by",
    "gain_drift@control.speed": "The speed gain has drifted by",
    "gain@sensor.encoder": "The encoder's gain deviates by",
    "gain@sensor.current_a": "The gain of one current sensor deviates by",
    "eccentricity_dynamic@motor": "The rotor turns out of centre (dynamic) by",
    "tooth_wear@gear": "Worn teeth have added a backlash of",
    "sag@supply": "The supply has lost",
    "bearing@bearing.outer": "A bearing has a defect of",
    "bearing_wear@motor.bearing": "The motor's bearing rubs with",
    "brake_dragging@brake": "The brake drags with",
    "friction_growth@screw": "The screw's friction has grown by",
    "efficiency_loss@screw": "The screw has lost efficiency:",
    "lubrication_loss@screw": "The screw has lost lubricant:",
    "adapter_gap@adapter": "The adapter's gap has grown by",
}
ALONE = "by the log alone: "  # of what an undecided answer shows without the model
_LISTED = 3  # faults or numbers in the first line
UNEXPLAINED = "does not explain"  # of the finding that the named faults leave a residual


def severity_text(value: float, unit: str) -> str:
    """Return a severity for display: angles in degrees, lengths in mm, shares in %."""
    display = "%" if unit == "1" else display_unit(unit)
    return f"{float(to_display(value, display)):.3g} {display}"


def by_reason(items: Sequence[Mapping[str, str]]) -> list[tuple[str, str]]:
    """Return what is not observable, names of one reason together: ``KIND@PLACE, ...``, reason."""
    names: dict[str, list[str]] = {}
    for item in items:
        names.setdefault(item["reason"], []).append(f"{item['kind']}@{item['place']}")
    return [(", ".join(keys), reason) for reason, keys in names.items()]


def verdict(result: Diagnosis) -> str:
    """Return the answer in one line: what is wrong, how far, how sure that is."""
    if result.status == "model_does_not_fit" and result.reason is not None:
        return f"MODEL DOES NOT FIT: {_off(result.reason)}; nothing is diagnosed"
    if result.status == "unknown_fault" and result.reason is not None:
        return f"UNKNOWN FAULT: {_off(result.reason)}, p = {_share(result.p_fault)}"
    if result.status == "undecided":
        return f"UNDECIDED: this unit was never seen healthy; {_measured(result)}"
    if result.status == "healthy":
        left = next((text for text in result.findings if UNEXPLAINED in text), "")
        seen = _visible(result, _LISTED)
        return f"HEALTHY (p = {_share(1.0 - result.p_fault)})" + (
            f", but {left}" if left else f"; {seen}" if seen else ""
        )
    causes = {f"{c.kind}@{c.place}": c for c in result.faults}
    named = [_named(causes[key]) for key in result.best if key in causes]
    return f"FAULTY: {' and '.join(named)}, p = {_share(result.p_best)}"


def _visible(result: Diagnosis, most: int) -> str:
    """Return what a healthy answer would have shown, the most frequent faults; first what not."""
    if not result.would_be_seen:
        return ""
    hidden = len(result.severity_units) - len(result.would_be_seen)
    kinds = [name.partition("@")[0] for name in result.severity_units]
    seen = []
    for name, value in list(result.would_be_seen.items())[:most]:
        kind, _, place = name.partition("@")
        plain = kind.replace("_", " ") + (f" at {place}" if kinds.count(kind) > 1 else "")
        seen.append(f"{plain} from {severity_text(value, result.severity_units[name])}")
    first = f"{hidden} of {len(kinds)} candidates would not be seen, " if hidden else ""
    return f"{first}would be seen: {', '.join(seen)}"


def _measured(result: Diagnosis) -> str:
    """Return what the logs show by themselves beside what the actuator file states."""
    alone = next((text for text in result.findings if text.startswith(ALONE)), "")
    if alone:
        return alone
    apart = sorted(result.features, key=lambda m: -abs(m.score))
    texts = []
    for item in apart[:_LISTED]:
        unit = display_unit(item.unit)
        value, file = (float(to_display(x, unit)) for x in (item.value, item.expected))
        name = item.name.replace("_", " ")
        texts.append(f"{name} {value:.3g} {unit}".removesuffix(" 1") + f" (file {file:.3g})")
    return "furthest from the file: " + ", ".join(texts)


def folded(cause: Cause) -> list[str]:
    """Return what a cause is ambiguous with; places of its own kind in a word: ``any phase``."""
    places = {place for kind, place in cause.ambiguous_with if kind == cause.kind}
    whole = {p[:-1] for p in (cause.place, *places)} if places else set()
    one = len(whole) == 1 and {p[-1] for p in (cause.place, *places)} == set("abc")
    out = ["any phase"] if one else []
    return out + [
        f"{kind}@{place}"
        for kind, place in cause.ambiguous_with
        if not (one and kind == cause.kind and place in places)
    ]


def _named(cause: Cause) -> str:
    if math.isnan(cause.severity):  # a class that was learnt
        return _labelled(cause)
    value, low, high = severity_texts(cause.severity, cause.interval, cause.unit)
    sign = "+" if cause.severity > 0.0 else ""
    low = low.partition(" ")[0]
    high = high.partition(" ")[0]
    return f"{cause.kind.replace('_', ' ')} {sign}{value} ({low} to {high})"


def _off(reason: Reason) -> str:
    return f"{_spoken(reason.feature)} is {reason.value:.3g}, beyond {reason.limit:.3g}"


def _share(probability: float) -> str:
    """A probability of two digits."""
    return f"{min(max(probability, 0.0), 1.0):.2f}"


def sentence(result: Diagnosis) -> str:
    """Return the answer in one sentence or two."""
    if result.status == "model_does_not_fit" and result.reason is not None:
        return (
            "The model does not show what the healthy unit shows: "
            f"{_off(result.reason)}. Nothing is diagnosed."
        )
    if result.status == "undecided":
        return (
            "Whether the unit is healthy is not decided: without a healthy log of it or a "
            f"calibration a deviation may be the file's; {_measured(result)}."
        )
    left = any(UNEXPLAINED in text for text in result.findings)
    if result.status == "healthy" and left:
        return (
            "No candidate stands out, but these are not logs of the healthy unit "
            f"either: {next(t for t in result.findings if UNEXPLAINED in t)}."
        )
    seen = _visible(result, len(result.would_be_seen))
    if result.status == "healthy":
        return (
            f"Nothing here is beyond a healthy unit: it deviates as much in "
            f"{100 * result.chance:.3g} % of logs (called faulty below "
            f"{100 * result.false_alarm:g} %); a fault has a probability of {result.p_fault:.2g}."
            + (f" In nine of ten such logs {seen}." if seen else "")
        )
    if result.status == "unknown_fault" and result.reason is not None:
        return (
            f"Something is wrong (probability {result.p_fault:.3g}) that none of the candidates "
            f"explains: {_off(result.reason)}."
        )
    causes = {f"{c.kind}@{c.place}": c for c in result.faults}
    parts = [_clause(key, causes[key]) for key in result.best if key in causes]
    parts[1:] = [text[0].lower() + text[1:] for text in parts[1:]]
    ending = (
        "nothing else is needed to explain the logs"
        if not left
        else "but that does not explain all of the logs"
    )
    return f"{' and '.join(parts)}; {ending} (probability {result.p_best:.3g})."


def _opening(key: str) -> str:
    """How a cause begins a sentence; of one without words of its own, by kind and place."""
    kind, _, place = key.partition("@")
    part = place.replace(".", " ").replace("_", " ")
    plain = kind.replace("_", " ")
    at = "" if part in plain else f" at the {part}"
    return _NAMES.get(key, f"There is {plain}{at}:")


def _spoken(name: str) -> str:
    from elevon.diagnose.positions.features import FEATURES
    from elevon.diagnose.positions.plausibility import PLAUSIBLE

    known = {**FEATURES, **PLAUSIBLE}
    return f"{name} ({known[name].text})" if name in known else name


def _labelled(cause: Cause) -> str:
    """A class of labelled logs: its kind, and its place where the label has one."""
    at = "" if cause.place == "unit" else f" at {cause.place}"
    return f"{cause.kind.replace('_', ' ')}{at}"


def _clause(key: str, cause: Cause) -> str:
    if math.isnan(cause.severity):
        return f"These are logs as those labelled {_labelled(cause)}"
    low, high = (severity_text(v, cause.unit) for v in cause.interval)
    unit = low.partition(" ")[2]
    text = (
        f"{_opening(key)} {severity_text(cause.severity, cause.unit)} "
        f"({low.removesuffix(f' {unit}')} to {high})"
    )
    if not cause.ambiguous_with:
        return text
    names = ", ".join(f"{kind}@{place}" for kind, place in cause.ambiguous_with)
    return f"{text}, ambiguous with {names}"
