"""Errors planted for the cases of the Torino bench: what they found, but for what is wrong."""

from dataclasses import replace
from functools import partial

import numpy as np


# --- torino-validation ---------------------------------------------------------------------------
def bench_and_model(backlash=0.3667, growth=1.0, percent=(), **facts):
    """Return the checks of a model that agrees with the bench, but for what is wrong."""
    from elevon_cases.torino import validation as module

    wrong, rows, places = dict(percent), [], []
    for number, reading in enumerate(module.READINGS):
        for signal in module.SHOWS:
            rms = 1e-3 * growth**number
            rows.append(
                module.ValidationRow(reading, signal, rms, wrong.get(signal, 0.2), 1, "rad")
            )
        printed = module.PRINTED[reading]
        good = {"model_lost_deg": printed, "bench_flat_s": 0.3, "model_flat_s": 0.3,
                "fitted_amplitude_deg": 7.0, "fitted_frequency_hz": 0.2}  # fmt: skip
        places.append(module.BacklashFacts(reading, printed, printed, **(good | facts)))
    return module.TorinoValidation(rows, places, backlash, "high", 0, "", [], 0.0045).checks


# --- torino-loaded -------------------------------------------------------------------------------
def campaign(constant=1.4, **wrong):
    """Return the checks of a campaign on the line, but for one test in which something is wrong."""
    from elevon_cases.torino import loaded as module

    rows = []
    for net in module.NET:
        lost = np.degrees(net) + 0.3656
        for torque in np.linspace(module.LEAST, module.MOST, 10):
            current = 0.2 + torque / 1.4
            rows.append(module.LoadedRow(net, torque, torque, current, lost, lost, 0.1))
    rows[4] = replace(rows[4], **wrong)
    return module.LoadedCampaign(rows, constant, 0.3656, 0.0045, "low", 0, "").checks


# --- torino-drops --------------------------------------------------------------------------------
def drops(**wrong):
    """Return the checks of estimates that are right, but for what is wrong."""
    from elevon_cases.torino.drops import DropsResult

    good = {
        "rows": [], "stiffness": 1000.0, "stiffness_interval": (990.0, 1010.0),
        "hidden_stiffness": 1000.0, "damping": 0.9, "damping_determined": True,
        "hidden_damping": 0.9, "loss_error_deg": 0.002, "rigid_error_deg": 0.2,
        "count_deg": 0.0045, "seed": 0, "parameter_hash": "", "traces": [], "misfits": (),
    }  # fmt: skip
    return DropsResult(**(good | wrong)).checks


# --- torino-fmeca --------------------------------------------------------------------------------
def fmeca(healthy="healthy", **wrong):
    """Return the checks of a table whose lines are all named, but for one."""
    from elevon_cases.torino.fmeca import LINES, NAMED, RATES, FmecaResult, FmecaRow

    rows = [FmecaRow(part, mode, RATES[part], fault, 200.0, "motor_speed", NAMED, "")
            for part, mode, fault in LINES]  # fmt: skip
    rows[0] = replace(rows[0], **wrong)
    return FmecaResult(rows, healthy, [2.0, 4.0], 0, "").checks


# --- torino-control ------------------------------------------------------------------------------
def control(factor=1.0, speed=24.19, end=None):
    """Return the checks of a locus whose roots are scaled, or end elsewhere, and of a speed."""
    from elevon_cases.torino.control import ControlResult, root_locus

    roots = factor * root_locus()
    if end is not None:
        roots[-1] = end
    return ControlResult([], speed, 24.19, "", roots).checks


# --- torino-gear ---------------------------------------------------------------------------------
def gear(mesh=0.18, rms=0.001, **wrong):
    """Return the checks of three models and three meshes, one number of them wrong."""
    from elevon_cases.torino.gear import (
        ELASTIC,
        LUMPED,
        PLANETS,
        GearResult,
        GearRow,
        MeshRow,
    )

    planets = {"lost_motion_deg": 0.3656, "stiffness_nm_per_rad": 1045.0, "loaded_deg": 0.4752}
    planets |= wrong
    rows = [GearRow(PLANETS, moving_deg=0.36, loaded_rms_deg=0.0, **planets),
            GearRow(ELASTIC, 0.3656, 1045.0, 0.36, 0.4752, rms),
            GearRow(LUMPED, 0.3656, None, 0.36, 0.3656, 0.05)]  # fmt: skip
    meshes = [MeshRow("first", 0.992, mesh, 50.0), MeshRow("second", 1.0, 0.1856, 50.0)]
    return GearResult(rows, meshes, 0.0045, "", np.zeros(1), {}).checks


#: Case to the checks without an error.
BENCH_GOOD = {
    "torino-validation": bench_and_model,
    "torino-loaded": campaign,
    "torino-drops": drops,
    "torino-fmeca": fmeca,
    "torino-control": control,
    "torino-gear": gear,
}

#: Case and check to the checks with one.
BENCH_PLANTED = {
    ("torino-validation", "*mm: * position"):
        partial(bench_and_model, percent={"encoder_position": 1.2}),
    ("torino-validation", "*mm: motor speed"):
        partial(bench_and_model, percent={"motor_speed": 2.5}),
    ("torino-validation", "calibrated backlash less the printed one"):
        partial(bench_and_model, backlash=0.38),
    ("torino-validation", "*mm: lost motion of the model less the printed backlash"):
        partial(bench_and_model, model_lost_deg=0.4),
    ("torino-validation", "*mm: standstill of model less bench"):
        partial(bench_and_model, model_flat_s=0.32),
    ("torino-validation", "*mm: fitted amplitude less the commanded one"):
        partial(bench_and_model, fitted_amplitude_deg=7.1),
    ("torino-validation", "*mm: fitted frequency less the commanded one"):
        partial(bench_and_model, fitted_frequency_hz=0.201),
    ("torino-validation", "encoder error, largest over least backlash"):
        partial(bench_and_model, growth=1.5),
    ("torino-loaded", "brake torque by the cell less its place on the line"):
        partial(campaign, cell_nm=1.2),
    ("torino-loaded", "torque an ampere balances, less the calibrated constant"):
        partial(campaign, constant=1.5),
    ("torino-loaded", "lost motion of the * beyond 2 % of the backlash"):
        partial(campaign, model_lost_deg=0.4),
    ("torino-loaded", "position of model less bench, worst test"):
        partial(campaign, position_percent=1.5),
    ("torino-drops", "stiffness: recovered less hidden"): partial(drops, stiffness=1050.0),
    ("torino-drops", "damping: recovered less hidden"): partial(drops, damping_determined=False),
    ("torino-drops", "hidden stiffness outside its interval"):
        partial(drops, stiffness_interval=(1001.0, 1010.0)),
    ("torino-drops", "angle lost, model less bench"): partial(drops, loss_error_deg=0.01),
    ("torino-drops", "error of a rigid transmission over that of the model"):
        partial(drops, rigid_error_deg=0.004),
    ("torino-control", "root at no gain less the filter's pole"): partial(control, factor=1.001),
    ("torino-control", "root at the largest gain, over the pole"): partial(control, end=-200.0),
    ("torino-control", "least step of the root towards zero"): partial(control, factor=-1.0),
    ("torino-control", "no-load speed less the drive's limit"): partial(control, speed=25.0),
    ("torino-control", "no-load speed, secondary controls that assist"):
        partial(control, speed=14.0),
    ("torino-gear", "lost motion of the planets less the printed"):
        partial(gear, lost_motion_deg=0.3680),
    ("torino-gear", "lost motion of the planets less the sum of its meshes"):
        partial(gear, mesh=0.19),
    ("torino-gear", "stiffness of the planets less that of the drops"):
        partial(gear, stiffness_nm_per_rad=625.0),
    ("torino-gear", "loaded sine: planets less one elastic backlash, RMS"): partial(gear, rms=0.01),
    ("torino-gear", "loaded sine: wind-up that one backlash leaves out"):
        partial(gear, loaded_deg=0.3656),
    ("torino-fmeca", "least deviation of a line over the largest of a healthy log"): partial(
        fmeca, deviations=5.0
    ),
    ("torino-fmeca", "faults called healthy"): partial(fmeca, seen="called healthy"),
    ("torino-fmeca", "faults named as another"): partial(fmeca, seen="another is named"),
    ("torino-fmeca", "faults isolated"): partial(fmeca, seen="unknown fault"),
    ("torino-fmeca", "healthy log called faulty"): partial(fmeca, healthy="faulty"),
}  # fmt: skip
