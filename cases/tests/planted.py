"""One error for each kind of check, planted where the number comes from, that must make it fail.

`GOOD` gives the checks of a case without an error; `PLANTED` gives them with one. An error is put
into what the case finds (or into the parameter that the check judges), never into the check.
"""

from dataclasses import replace
from functools import partial

import test_pisa_limits as gear
from planted_bench import BENCH_GOOD, BENCH_PLANTED
from planted_nasa import (
    THERMAL,
    baseline,
    cells,
    current,
    dema,
    drawn_figures,
    fading,
    figures_and_seeding,
    first_row,
    flown,
    hour,
    one_wrong,
    raised,
    refused,
    seeding,
    separation,
    slower,
)
from planted_real import REAL_GOOD, REAL_PLANTED
from planting import given, scaled, with_error

# --- torino-backlash -----------------------------------------------------------------------------
BACKLASH = "torino.backlash:"

# --- torino-compliance ---------------------------------------------------------------------------
COMPLIANCE = "torino.compliance:"


def variant(index, **factors):
    """Scale numbers of one reading of the table."""

    def change(variants):
        changed = list(variants)
        values = {name: factor * getattr(changed[index], name) for name, factor in factors.items()}
        changed[index] = replace(changed[index], **values)
        return changed

    return (COMPLIANCE + "_checks", given(change))


# --- low-fidelity --------------------------------------------------------------------------------
def wrong_low(signal, factor):
    """Scale a signal of the reduced-order model."""

    def wrapper(function):
        def wrong(*arguments, **options):
            good = function(*arguments, **options)
            name = good.signals[signal]
            return replace(good, low={**good.low, name: factor * good.low[name]})

        return wrong

    return ("low_fidelity:compare", wrapper)


# --- pisa ----------------------------------------------------------------------------------------
FRICTION = partial(with_error, "pisa-friction")


def recovered(*kinds):
    """Let quantities of these kinds be recovered 5 % too large."""

    def change(rows):
        return [
            replace(row, recovered=1.05 * row.put_in) if row.quantity.startswith(kinds) else row
            for row in rows
        ]

    return ("pisa_friction:_checks", given(change))


def commutation(row=None, pulses=None, **pulse):
    """Return the checks of a sector and a shorted stretch, but for what is wrong."""
    from elevon_cases.pisa.commutation import SectorRow, ShortedPulse, checks_of

    sector = replace(SectorRow(30.0, "101", "a", "b", 0.0, 50.0, 50.5), **(row or {}))
    short = replace(ShortedPulse(1.0, 1e-3, -1.0, 59.0), **pulse)
    return checks_of([sector], [short] if pulses is None else pulses, 60.0)


def monitoring(**changes):
    """Return the checks of the simplified model, but for what is wrong."""
    from elevon_cases.pisa.monitoring import MonitoringRow, checks_of

    return checks_of([replace(MonitoringRow("low", 100.0, 0.02, 30.0, 0.02, 0.5, 1.0), **changes)])


def functional(**changes):
    """Return the checks of every condition, but for what is wrong in each."""
    from elevon_cases.pisa.gear import CONDITIONS, FIGURES, TEMPERATURES

    return [
        check
        for condition in (*CONDITIONS[:-1], FIGURES, *TEMPERATURES)
        for check in gear.functional_checks(condition, **changes)
    ]


def failures(safe=True, listed=False, missing=0):
    """Return the checks of two rows, the last one so."""
    from elevon_cases.pisa.failures import FailureRow, failure_checks

    row = FailureRow("x", "y", "locked", "locked", True, "-", None, "", False, 0.0)
    return failure_checks([row, replace(row, safe=safe, listed=listed)], 2 + missing)


# --- cranfield -----------------------------------------------------------------------------------
def cranfield(alarms=2, **wrong):
    """Return the checks of a folder with good figures, but for those that are wrong."""
    from elevon_cases.cranfield.judge import Detection
    from elevon_cases.cranfield.result import LIMITS, CranfieldResult

    headline = dict.fromkeys(LIMITS, 0.99) | wrong
    return CranfieldResult(
        None, headline=headline, detections=[Detection("normal", alarms, 40, None)]
    ).checks


#: Cases whose checks need minutes or seconds of simulation.
LONG = {"torino-backlash", "low-fidelity", "nasa-thermal", "pisa-friction"}  # fmt: skip

GOOD = (
    BENCH_GOOD
    | REAL_GOOD
    | {
        "torino-backlash": partial(with_error, "torino-backlash"),
        "torino-compliance": partial(with_error, "torino-compliance", resamples=20),
        "low-fidelity": partial(with_error, "low-fidelity"),
        "nasa-current": current,
        "nasa-faults": figures_and_seeding,
        "nasa-flight": flown,
        "nasa-thermal": partial(with_error, "nasa-thermal"),
        "nasa-baseline": baseline,
        "nasa-separation": separation,
        "pisa-functional": functional,
        "pisa-friction": FRICTION,
        "pisa-hydraulic": gear.hydraulic_checks,
        "pisa-validation": gear.validation_checks,
        "pisa-commutation": commutation,
        "pisa-monitoring": monitoring,
        "pisa-failures": failures,
        "cranfield": cranfield,
    }
)


def error(case, *places):
    """Return what makes the checks of a case with an error."""
    return partial(GOOD[case], *places)


_B, _C, _T = (
    partial(error, f"{name}") for name in ("torino-backlash", "torino-compliance", "nasa-thermal")
)

#: Case and check, as `cases.toml` names it, to the checks with an error that this one must see.
PLANTED = BENCH_PLANTED | REAL_PLANTED | {
    ("torino-backlash", "row *: recovered less put in"):
        _B((BACKLASH + "backlash_from_encoder", scaled(1.05, "loop_gain"))),
    ("torino-backlash", "largest: motor minus encoder less put in"):
        _B((BACKLASH + "lost_motion", scaled(1.001, 1))),
    ("torino-backlash", "centre distances from the micrometer"):
        _B((BACKLASH + "centre_distance", given(lambda reading: reading + 0.1))),
    ("torino-backlash", "printed formula column from the geometry"):
        _B((BACKLASH + "formula_deg", scaled(1.01))),
    ("torino-compliance", "load on loss, printed rows, from 68.16"):
        _C(variant(0, load_on_loss=1.001)),
    ("torino-compliance", "loss on load, printed rows, from 114.6"):
        _C(variant(0, loss_on_load=1.001)),
    ("torino-compliance", "published 68.23 from losses of the rows' own positions"):
        _C(variant(1, load_on_loss=1.001)),
    ("torino-compliance", "load on loss, repaired, from 85.7"): _C(variant(-1, load_on_loss=1.002)),
    ("torino-compliance", "loss on load, repaired, from 113.4"):
        _C(variant(-1, loss_on_load=1.002)),
    ("torino-compliance", "ratio of the two regressions less r squared"):
        _C(variant(0, r2=1.0 + 1e-6)),
    ("torino-compliance", "rows called wrong by only one of program and eye"):
        _C((COMPLIANCE + "_checks", given(lambda slips: slips[1:], 1))),
    ("low-fidelity", "*: position"): error("low-fidelity", wrong_low("position", 1.02)),
    ("low-fidelity", "*: q current"): error("low-fidelity", wrong_low("q_current", 1.1)),
    ("nasa-current", "nominal runs"): partial(current, count=31),
    ("nasa-current", "nominal: average error of the current"): partial(current, nominal=10.1),
    ("nasa-current", "jam: average error of the current"): partial(current, jam=10.1),
    ("nasa-current", "nominal: largest error of the current"): partial(current, nominal_most=10.0),
    ("nasa-current", "jam: largest error of the current"): partial(current, jam_most=9.9),
    ("nasa-faults", "Figure 18: change of the tracking error"):
        partial(drawn_figures, 18, tracking_percent=0.06),
    ("nasa-faults", "Figure 18: line of the fault over the healthy one"):
        partial(drawn_figures, 18, line_a=0.009),
    ("nasa-faults", "Figure 19: change of the tracking error"):
        partial(drawn_figures, 19, tracking_percent=0.06),
    ("nasa-faults", "Figure 19: line of the fault over the healthy one"):
        partial(drawn_figures, 19, line_a=0.009),
    ("nasa-faults", "Figure 19: rise of the current against the closed form"):
        partial(drawn_figures, 19, torque_current_percent=7.6),
    ("nasa-faults", "levels of the resistors against those printed"):
        partial(seeding, first_row(resistance_ohm=200.0)),
    ("nasa-faults", "resistor: spread of its current over speed"):
        partial(seeding, resistor=lambda speed: 60.0 - speed),
    ("nasa-faults", "shorted turns: spread of their current over speed"):
        partial(seeding, turns=lambda _speed: 1.0),
    ("nasa-faults", "least rise of the current from level to level"):
        partial(seeding, first_row(resistor_a=0.2)),
    ("nasa-flight", "load of both rams less the flight's, over its RMS"):
        partial(flown, missing=0.2),
    ("nasa-flight", "faulty over nominal: current of a newton"): partial(flown, excess=0.02),
    ("nasa-flight", "healthy pairs: largest difference of the same"):
        partial(flown, floor=(0.12, 0.0, 0.0)),
    ("nasa-thermal", "steady state less the algebraic root"):
        _T((THERMAL + "steady_state", given(lambda actuator: actuator.with_values(
            {"thermal.convection": 1.1 * actuator.parameters.value("thermal.convection")})))),
    ("nasa-thermal", "one hour without radiation less the closed form, *"):
        _T((THERMAL + "closed_form", scaled(1.01, 1))),
    ("nasa-thermal", "heat in less heat stored and given away"):
        _T(hour("energy_air", lambda values: 1.001 * values, "_energy_check")),
    ("nasa-thermal", "slowest rise of the surface"): _T(hour("surface_temperature", slower)),
    ("nasa-thermal", "winding less surface"): _T(hour("winding_temperature", lambda v: v - 50.0)),
    ("nasa-thermal", "* rises faster after the load's step"):
        _T(hour("winding_temperature", fading)),
    ("nasa-thermal", "fit of a hidden bench: largest error of the surface"):
        _T(dema(1, raised(0, 2.0, -5))),
    ("nasa-thermal", "fit of a hidden bench: rms error of the surface"):
        _T(dema(1, raised(0, 0.6))),
    ("nasa-thermal", "fit of a hidden bench: the same with the air as it was at first"):
        _T(("nasa.dema:_checks", given(lambda runs: (runs[0], runs[0]), 2))),
    ("nasa-thermal", "fit of a hidden bench: largest error of a recovered value"):
        _T(dema(0, one_wrong)),
    ("nasa-thermal", "fit of a hidden bench: winding, which is not measured"):
        _T(dema(3, raised(2, 2.0))),
    ("nasa-baseline", "cells that were refused"): lambda: baseline(refused()),
    ("nasa-baseline", "largest rms phase current"): lambda: baseline(cells(rms_current_a=8.0)),
    ("nasa-baseline", "largest tracking error of a ramp"):
        lambda: baseline(cells(tracking_max_mm=11.0)),
    ("nasa-baseline", "largest rms tracking error of a sine"):
        lambda: baseline(cells(tracking_rms_mm=0.4)),
    ("nasa-baseline", "rms current, compressive against tensile"):
        lambda: baseline(cells(rms_current_a=1.2, load=500.0)),
    ("nasa-baseline", "loads whose increase does not raise the current"):
        lambda: baseline(cells(rms_current_a=0.1, load=4500.0)),
    ("nasa-baseline", "known effects held by their intervals, at *"):
        lambda: baseline(coverage=(0.8, 0.1)),
    ("nasa-baseline", "known effects: mean error over its deviation"):
        lambda: baseline(coverage=(0.95, 0.4)),
    ("nasa-separation", "healthy against healthy: comparisons *"): partial(separation, rate=0.01),
    ("nasa-separation", "healthy against healthy: tables *"): partial(separation, tables=0.1),
    ("nasa-separation", "faults of half severity that rank above the whole"):
        partial(separation, half=(0.5, 1.2)),
    ("nasa-separation", "rows in which half the severity was compared"):
        partial(separation, half=()),
    ("nasa-separation", "gap at * N: impact, *"): partial(separation, impact=0.4),
    ("pisa-functional", "cycle, nominal (*"): partial(functional, extension_s=14.0),
    ("pisa-functional", "cycle, nominal at *"): partial(functional, extension_s=14.0),
    ("pisa-functional", "cycle, normal (*"): partial(functional, extension_s=14.0),
    ("pisa-functional", "cycle, normal, as Figs. *"): partial(functional, retraction_s=14.0),
    ("pisa-functional", "cycle, critical (*"): partial(functional, extension_s=34.0),
    ("pisa-functional", "* against its speed profile, *"): partial(functional, extension_s=7.4),
    ("pisa-functional", "*, high speed against its set point, *"):
        partial(functional, speeds={"extension_high": 625.0}),
    ("pisa-functional", "*, low speed against its set point, *"):
        partial(functional, speeds={"retraction_low": 260.0}),
    ("pisa-friction", "mass: worst error over the largest"):
        error("pisa-friction", recovered("mass")),
    ("pisa-friction", "mean friction, FF*: worst error over the largest"):
        error("pisa-friction", recovered("friction_ff")),
    ("pisa-friction", "harmonics, FF*: worst error over the largest"):
        error("pisa-friction", recovered("harmonic")),
    ("pisa-friction", "efficiency at the preload: worst error over the largest"):
        error("pisa-friction", recovered("preload_efficiency")),
    ("pisa-friction", "efficiency over load: worst error over the largest"):
        error("pisa-friction", recovered("efficiency")),
    ("pisa-hydraulic", "retraction, spread of the controlled speed"):
        partial(gear.hydraulic_checks, "retraction", electric=6.0),
    ("pisa-hydraulic", "extension, spread of the controlled speed"):
        partial(gear.hydraulic_checks, "extension", electric=6.0),
    ("pisa-hydraulic", "*, the same with the winding's temperature alone"):
        partial(gear.hydraulic_checks, winding=6.0),
    ("pisa-hydraulic", "*, spread of the hydraulic speed"):
        partial(gear.hydraulic_checks, electric=4.0, oil=2.0),
    ("pisa-validation", "*: output position"): partial(gear.validation_checks, "output_position"),
    ("pisa-validation", "*: motor speed"): partial(gear.validation_checks, "motor_speed"),
    ("pisa-validation", "*: torque current"): partial(gear.validation_checks, "torque_current"),
    ("pisa-commutation", "samples whose Hall code is not that of their sector"):
        partial(commutation, {"wrong_percent": 0.2}),
    ("pisa-commutation", "on-time of the pair less the demanded duty"):
        partial(commutation, {"on_percent": 52.5}),
    ("pisa-commutation", "weakest braking of a shorted stretch"): partial(commutation, torque=0.01),
    ("pisa-commutation", "largest current of the shorted motor over the cut-off"):
        partial(commutation, peak=62.0),
    ("pisa-monitoring", "simplified model, position"): partial(monitoring, position_percent=0.2),
    ("pisa-monitoring", "simplified model, speed"): partial(monitoring, speed_percent=2.0),
    ("pisa-monitoring", "simplified model, current"): partial(monitoring, current_percent=3.0),
    ("pisa-monitoring", "simplified model, times faster"): partial(monitoring, faster=6.0),
    ("pisa-failures", "unsafe rows outside the listed set"): partial(failures, safe=False),
    ("pisa-failures", "listed rows that are safe"): partial(failures, listed=True),
    ("pisa-failures", "rows, one a fault, place, severity and phase"): partial(failures, missing=1),
    ("cranfield", "mean macro-F1 of three classes at a load left out"):
        partial(cranfield, three_class_macro_f1_mean=0.8),
    ("cranfield", "worst load's macro-F1 of three classes"):
        partial(cranfield, three_class_macro_f1_worst=0.5),
    ("cranfield", "worst load's accuracy of four families"):
        partial(cranfield, four_family_grouped_accuracy_worst=0.9),
    ("cranfield", "false-alarm rate, lower end of its interval"): partial(cranfield, alarms=20),
}  # fmt: skip
