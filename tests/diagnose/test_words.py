"""A diagnosis as a person says it."""

from dataclasses import replace

import pytest

from elevon.diagnose.engine.answer import Cause, Diagnosis, FaultPlace, Moved, Reason
from elevon.diagnose.engine.page import folded, sentence, severity_text, verdict


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(0.00227, "rad", "0.13 deg"), (0.25, "1", "25 %"), (6.2e-5, "m", "0.062 mm"),
     (0.178, "N m", "0.178 N m")],
)  # fmt: skip
def test_a_severity_has_the_unit_that_a_person_reads(value, unit, text):
    assert severity_text(value, unit) == text


def named(kind, place, unit="1", severity=0.2):
    """A diagnosis that names one fault."""
    cause = Cause(kind, place, unit, 0.99, severity, (0.5 * severity, 1.5 * severity), ())
    return Diagnosis(
        logs=("a.csv",), status="faulty", p_fault=0.99, false_alarm=0.05, chance=0.001,
        faults=(cause,), best=(f"{kind}@{place}",), p_best=0.98, unobservable=(), detectable={},
        features=(), findings=(), seconds=0.0,
    )  # fmt: skip


def test_a_fault_without_words_of_its_own_is_said_by_kind_and_place():
    text = sentence(named("resolver_short", "sensor.resolver.sine"))
    assert text.startswith(
        "There is resolver short at the sensor resolver sine: 20 % (10 to 30 %);"
    )
    assert sentence(named("brake_dragging", "brake", "N m")).startswith(
        "The brake drags with 0.2 N m (0.1 to 0.3 N m);"
    )


def test_the_first_line_is_the_answer():
    worn = named("backlash", "transmission", "m", 3e-4)
    assert verdict(worn) == "FAULTY: backlash +0.30 mm (0.15 to 0.45), p = 0.98"
    well = replace(worn, status="healthy", best=(), faults=(), p_fault=0.03)
    assert verdict(well) == "HEALTHY (p = 0.97)"
    units = {"backlash@transmission": "rad", "short@motor.phase_a": "1", "sag@supply": "1"}
    limits = {"backlash@transmission": 0.0005, "short@motor.phase_a": 0.18}
    least = replace(well, would_be_seen=limits, severity_units=units)
    assert verdict(least) == (
        "HEALTHY (p = 0.97); 1 of 3 candidates would not be seen, would be seen: "
        "backlash from 0.0286 deg, short from 18 %"
    )
    assert "In nine of ten such logs 1 of 3 candidates would not be seen" in sentence(least)
    gap = Moved("a.csv", "lost_motion", "rad", 0.0152, 0.0065, 0.001, 0.0)
    open_answer = replace(well, status="undecided", features=(gap,))
    assert verdict(open_answer) == (
        "UNDECIDED: this unit was never seen healthy; furthest from the file: "
        "lost motion 0.871 deg (file 0.372)"
    )
    assert "not decided" in sentence(open_answer)
    reason = Reason("dry_current", 0.5, 0.2)
    gated = verdict(replace(well, status="model_does_not_fit", reason=reason))
    assert gated.startswith("MODEL DOES NOT FIT: dry_current (current that changes sign with the ")
    assert gated.endswith(" is 0.5, beyond 0.2; nothing is diagnosed")
    unknown = verdict(replace(well, status="unknown_fault", p_fault=0.9, reason=reason))
    assert unknown.startswith("UNKNOWN FAULT: dry_current")
    assert unknown.endswith("p = 0.90")


def test_places_that_are_alike_are_one_word():
    short = named("short", "motor.phase_a").faults[0]
    phases = tuple(FaultPlace("short", f"motor.phase_{p}") for p in "bc")
    sensor = FaultPlace("gain", "sensor.current_a")
    assert folded(replace(short, ambiguous_with=(*phases, sensor))) == [
        "any phase", "gain@sensor.current_a",
    ]  # fmt: skip
    assert folded(replace(short, ambiguous_with=phases[:1])) == ["short@motor.phase_b"]
