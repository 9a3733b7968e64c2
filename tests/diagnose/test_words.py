"""A diagnosis as a person says it."""

import pytest

from elevon.diagnose.engine.answer import Cause, Diagnosis
from elevon.diagnose.engine.words import sentence, severity_text


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
