"""The landing gear's checks fail where what they judge is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.calibrate.validation import Validation, ValidationTrace
from elevon_cases.pisa import functional as functional_case
from elevon_cases.pisa import hydraulic
from elevon_cases.pisa.functional import FunctionalRow, profile_times, set_points
from elevon_cases.pisa.gear import ACTUATOR, CONDITIONS, FIGURES
from elevon_cases.pisa.hydraulic import HydraulicRow
from elevon_cases.pisa.validation import DISPLAYED, ValidationResult, extension_friction

UNITS = {"output_position": "m", "motor_speed": "rad/s", "torque_current": "A"}


def functional_checks(condition=CONDITIONS[0], **changes):
    """Return the checks of a condition whose strokes are the profile's, but for changes."""
    points, profile = set_points(), profile_times()
    speeds = {f"{s}_{part}": v for s in ("extension", "retraction") for part, v in points.items()}
    row = FunctionalRow(condition, profile["extension"], profile["retraction"], 20.0, 600.0,
                        profile, speeds, None, None)  # fmt: skip
    speeds = speeds | changes.pop("speeds", {})
    row = replace(row, speeds_rad_s=speeds, **changes)
    return functional_case._checks(row, condition.requirement, points)


def functional(condition, **changes):
    return [check for check in functional_checks(condition, **changes) if not check.passed]


def test_the_profile_is_that_of_the_thesis():
    """P 1.2.2 and Table 2.1: 198 mm at 590.596 rad/s, 66 mm at 280.264 rad/s, ramps of 777.8."""
    metre = 0.01 / (2.0 * np.pi) / (13.0 / 3.0) ** 2
    steady = 0.198 / metre / 590.596 + 0.066 / metre / 280.264
    assert profile_times()["retraction"] == pytest.approx(steady, abs=0.25)
    assert set_points() == {"high": 590.596, "low": 280.264}


def test_functional_checks_fail_on_planted_errors():
    nominal, figures = CONDITIONS[0], FIGURES
    assert (figures.load_factor, figures.supply) == (1.0, 22.0)
    assert functional(nominal) == []
    slow = profile_times()["extension"] * 1.06
    (found,) = functional(nominal, extension_s=slow)
    assert "extension against its speed profile" in found.name
    (found,) = functional(nominal, speeds={"retraction_low": 280.264 * 1.06})
    assert "retraction, low speed" in found.name
    # Where P doubles the cycle the set points may go, the cycle may not.
    critical = CONDITIONS[3]
    assert functional(critical, speeds={"extension_high": 100.0}) == []
    assert [c.limit for c in functional(critical, extension_s=40.0)] == [40.0]


def hydraulic_checks(wrong="extension", electric=0.0, winding=0.0, oil=50.0):
    """Return the checks of two loads between which one direction's speeds differ by percents."""
    rows = [
        HydraulicRow(20.0, nz, way, 40.0 + 0.4 * nz * (oil if way == wrong else 50.0),
                     40.0 + 0.4 * nz * electric * (way == wrong),
                     40.0 + 0.4 * nz * winding * (way == wrong), 8.0, 8.0)
        for way in ("extension", "retraction")
        for nz in (0.0, 1.0)
    ]  # fmt: skip
    return hydraulic._checks(rows)


def test_the_hydraulic_comparison_judges_both_directions():
    assert all(check.passed for check in hydraulic_checks(electric=4.0))
    for way in ("extension", "retraction"):
        failed = [c.name for c in hydraulic_checks(way, electric=6.0) if not c.passed]
        assert failed == [f"{way}, spread of the controlled speed"]


def validation(wrong):
    time = np.arange(0.0, 4.0, 2e-3)
    measured = {name: np.sin(2.0 * np.pi * 0.3 * time) for name in DISPLAYED}
    simulated = {n: v * (1.3 if n == wrong else 1.0) for n, v in measured.items()}
    trace = ValidationTrace("extend", time, measured, simulated, np.ones(len(time), dtype=bool))
    return Validation("gear", "low", 0.0, tuple(trace.errors(UNITS)), {}, (trace,))


def validation_checks(wrong=""):
    """Return the checks of a held-out stroke of which one signal is a third too large."""
    good = validation("")
    return ValidationResult(
        validation(wrong), good, good, {"extend": True}, {}, "low", 0, ""
    ).checks


@pytest.mark.parametrize("wrong", DISPLAYED)
def test_every_signal_of_a_held_out_stroke_is_judged(wrong):
    good = validation("")
    result = ValidationResult(validation(wrong), good, good, {"extend": True}, {}, "low", 0, "")
    failed = [check.name for check in result.checks if not check.passed]
    assert failed == [f"extend: {wrong.replace('_', ' ')}"]
    used = replace(result, held_out={"extend": False})
    assert used.checks == []


def test_the_floor_of_a_repetition_widens_the_limit_of_the_current_only():
    good, off = validation(""), validation("torque_current")
    rows = ValidationResult(good, good, off, {"extend": True}, {}, "low", 0, "").rows
    limits = {row.signal: row.limit_percent for row in rows}
    assert limits["torque_current"] == pytest.approx(np.hypot(9.96, 30.0), rel=0.01)
    assert (limits["output_position"], limits["motor_speed"]) == (1.0, 5.0)


def test_friction_is_scaled_between_its_knots():
    gear = Actuator.load(ACTUATOR)
    values = extension_friction(gear, np.log([1.1, 1.3]))
    factor = {k: v / gear.parameters.value(k) for k, v in values.items()}
    assert factor["friction.ffm_extension_1"] == pytest.approx(1.1)
    assert factor["friction.ffm_extension_8"] == pytest.approx(1.3)
    assert 1.1 < factor["friction.ffm_extension_5"] < factor["friction.ffm_extension_6"] < 1.3
