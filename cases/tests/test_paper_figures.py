"""Figures of the papers as printed: what is checked fails where it is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from elevon.recording import Recording
from elevon_cases.nasa.faults import (
    LEVELS,
    RESISTANCES,
    SPEEDS,
    FaultFigure,
    SeedingRow,
    faults_page,
    figure_checks,
    reproduce_faults,
    seeding_checks,
)
from elevon_cases.pisa.commutation import (
    SEQUENCE,
    SectorRow,
    ShortedPulse,
    checks_of,
    commutation_page,
    reproduce_commutation,
    sectors,
    shorted_pulses,
)


def failed(checks):
    return [check.name for check in checks if not check.passed]


def figure(**changes):
    empty = np.zeros(1)
    item = FaultFigure(19, "short", empty, empty, empty, empty, empty, 0.001, 100.0 / 14.0, 0.2,
                       0.001)  # fmt: skip
    return [replace(item, **changes)]


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"tracking_percent": 0.06}, "Figure 19: change of the tracking error"),
        ({"line_a": 0.009}, "Figure 19: line of the fault over the healthy one"),
        ({"torque_current_percent": 7.6}, "rise of the current against the closed form"),
    ],
)
def test_each_check_of_a_figure_can_fail(changes, name):
    assert failed(figure_checks(figure())) == []
    (found,) = failed(figure_checks(figure(**changes)))
    assert name in found


def seeding(turns=lambda speed: 60.0 - speed, resistor=lambda _speed: 1.0):
    return [
        SeedingRow(level, resistance, speed, level * turns(speed), level * resistor(speed))
        for speed in SPEEDS
        for level, resistance in zip(LEVELS, RESISTANCES, strict=True)
    ]


def test_each_check_of_the_seeding_can_fail():
    assert failed(seeding_checks(seeding())) == []
    (found,) = failed(seeding_checks(seeding(resistor=lambda speed: 60.0 - speed)))
    assert found.startswith("resistor: spread")
    (found,) = failed(seeding_checks(seeding(turns=lambda _speed: 1.0)))
    assert found.startswith("shorted turns: spread")
    rows = seeding()
    (found,) = failed(seeding_checks([replace(rows[0], resistance_ohm=200.0), *rows[1:]]))
    assert found.startswith("levels of the resistors")
    (found,) = failed(seeding_checks([replace(rows[0], resistor_a=rows[1].resistor_a * 1.001)]
                                     + [replace(r) for r in rows[1:]]))[-1:]  # fmt: skip
    assert found.startswith("least rise")


def test_each_check_of_the_commutation_can_fail():
    row = SectorRow(30.0, "101", "a", "b", 0.0, 50.0, 50.5)
    pulse = ShortedPulse(1.0, 1e-3, -1.0, 59.0)
    assert failed(checks_of([row], [pulse], 60.0)) == []
    for rows, pulses, name in (
        ([replace(row, wrong_percent=0.2)], [pulse], "Hall code"),
        ([replace(row, on_percent=52.5)], [pulse], "on-time"),
        ([row], [replace(pulse, torque=0.01)], "weakest braking"),
        ([row], [replace(pulse, peak=62.0)], "cut-off"),
    ):
        (found,) = failed(checks_of(rows, pulses, 60.0))
        assert name in found
    # Nothing was shorted: nothing is known of it.
    assert len(failed(checks_of([row], [], 60.0))) == 2


def test_a_wrong_hall_sensor_is_seen():
    """Codes of P eq. 13 over one turn backwards, then with sensor b inverted."""
    time = np.linspace(0.8, 0.85, 3603)[1:-1]
    turned = -np.linspace(0.0, 2.0 * np.pi, 3601)
    place = np.floor(np.mod(np.degrees(turned) - 30.0, 360.0) / 60.0).astype(int)
    codes = np.array([entry[0] for entry in SEQUENCE])[place]
    values = {f"hall_{leg}": (codes >> shift & 1).astype(float)
              for leg, shift in (("a", 2), ("b", 1), ("c", 0))}  # fmt: skip
    values |= {f"voltage_{leg}": np.zeros(3601) for leg in "abc"}
    values |= {"motor_position": turned, "motor_speed": np.full(3601, -1.0),
               "duty": np.zeros(3601), "supply_voltage": np.full(3601, 28.0)}  # fmt: skip
    units = dict.fromkeys(values, "1")
    run = Recording.build(time, values, units)
    assert max(row.wrong_percent for row in sectors(run, 1.0)) < 1.0
    values["hall_b"] = 1.0 - values["hall_b"]
    assert max(row.wrong_percent for row in sectors(Recording.build(time, values, units), 1.0)) > 99


def test_stretches_at_rest_are_none():
    time = np.arange(0.0, 1.0, 1e-3)
    on = ((time > 0.1) & (time < 0.2)) | ((time > 0.5) & (time < 0.6))
    values = {f"current_{leg}": np.where(on, 10.0, 0.0) for leg in "abc"}
    values |= {"software_brake": on.astype(float), "motor_speed": np.where(time > 0.4, 300.0, 0.0),
               "motor_torque": np.where(on, -1.0, 0.0)}  # fmt: skip
    (pulse,) = shorted_pulses(Recording.build(time, values, dict.fromkeys(values, "1")))
    assert pulse.time == pytest.approx(0.5, abs=2e-3)
    assert (pulse.torque, pulse.peak) == (-1.0, 10.0)


@pytest.mark.long
def test_the_ballscrews_figures_pass():
    result = reproduce_faults()
    assert failed(result.checks) == []
    assert "baseline" in faults_page(result, "2026-01-01").html()


@pytest.mark.long
def test_the_gears_currents_pass():
    result = reproduce_commutation()
    assert failed(result.checks) == []
    assert "As Fig. 5.4" in commutation_page(result, "2026-01-01").html()
