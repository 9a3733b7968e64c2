"""A diagnosis in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from elevon.number_text import severity_texts
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elevon.diagnose.engine.answer import Cause, Diagnosis, Reason


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
    if result.status == "healthy":
        left = next((text for text in result.findings if UNEXPLAINED in text), "")
        return f"HEALTHY (p = {_share(1.0 - result.p_fault)})" + (f", but {left}" if left else "")
    causes = {f"{c.kind}@{c.place}": c for c in result.faults}
    named = [_named(causes[key]) for key in result.best if key in causes]
    return f"FAULTY: {' and '.join(named)}, p = {_share(result.p_best)}"


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
    left = any(UNEXPLAINED in text for text in result.findings)
    if result.status == "healthy" and left:
        return (
            "No candidate stands out, but these are not logs of the healthy unit "
            f"either: {next(t for t in result.findings if UNEXPLAINED in t)}."
        )
    if result.status == "healthy":
        return (
            f"Nothing here is beyond a healthy unit: it deviates as much in "
            f"{100 * result.chance:.3g} % of logs (called faulty below "
            f"{100 * result.false_alarm:g} %); a fault has a probability of {result.p_fault:.2g}."
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
