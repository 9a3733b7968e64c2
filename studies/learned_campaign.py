"""What `elevon learn` makes of a simulated campaign, judged by units that were not learnt.

Units of the rotary bench differ (friction, inertia, gains, backlash, winding), runs of one unit in
temperature, supply and sensors; each of nine faults is there in a tenth of the runs. All run the
bench's sine of 0.2 Hz for 20 s.
"""

from __future__ import annotations

import statistics
import time as clock
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elevon.diagnose.learning.examples import Examples, examples_of_dataset, pole_pairs_of
from elevon.diagnose.learning.fit import learned_classes
from elevon.diagnose.learning.model import LearnedClasses
from elevon.progress import Progress, part
from elevon.report import Check, verdict

__all__ = ["LearnedCampaign", "plan_text", "study_learned_campaign"]

_DRAWS = 20  # runs of a unit
_RATE = 0.05  # of false alarms that is set
_REPEATS = 200  # answers that are timed
_LIMIT = 0.010  # s of an answer
_COVERED = 0.90  # of severities that their intervals must hold
_FAULTS = (
    ("backlash@transmission", "0.02 deg", "0.5 deg"),
    ("friction@transmission", "0.1", "1.2"),
    ("lubrication@transmission", "-0.5", "2"),
    ("short@motor.phase_a", "0.03", "0.35"),
    ("eccentricity_static@motor", "0.03", "0.3"),
    ("demagnetisation@motor", "0.02", "0.2"),
    ("gain_drift@control.position", "-0.15", "0.2"),
    ("gain_drift@control.speed", "-0.3", "0.5"),
    ("gain@sensor.encoder", "-0.015", "0.015"),
)
#: From unit to unit, uniformly. ASSUMED.
_UNITS = (
    ("friction.dynamic", "0.18 N m", "0.36 N m"),
    ("friction.static", "0.38 N m", "0.5 N m"),
    ("gear.inertia", "0.00165 kg m2", "0.0022 kg m2"),
    ("motor.emf_constant", "0.87 V s/rad", "0.93 V s/rad"),
    ("motor.winding_resistance", "2.4 ohm", "3.1 ohm"),
    ("backlash.total", "0.2 deg", "0.6 deg"),
    ("control.position_gain", "1850 1/s", "2300 1/s"),
    ("control.speed_gain", "0.16 N m s/rad", "0.24 N m s/rad"),
    ("sensor.encoder.gain", "0.997", "1.003"),
)
#: From run to run of a unit, uniformly. ASSUMED.
_RUNS = (
    ("motor.winding_temperature", "15 degC", "65 degC"),
    ("inverter.supply_voltage", "365 V", "395 V"),
    ("friction.viscous", "0.0028 N m s/rad", "0.0040 N m s/rad"),
    ("sensor.current.gain_a", "0.993", "1.007"),
    ("sensor.current.gain_b", "0.993", "1.007"),
)
_RECORD = (
    "command,encoder_position,resolver_position,resolver_speed,speed_ref,current_ref,current_q_meas"
)


@dataclass(frozen=True)
class LearnedCampaign:
    """Counts of units that were not learnt, and the time of an answer.

    Attributes
    ----------
    rows : list of dict
        By the number of baselines.
    report : dict
        Of the learning.
    seconds : float
        Of one answer, numbers given and model in memory: median of 200.
    """

    rows: list[dict[str, Any]]
    report: dict[str, Any]
    seconds: float

    @property
    def checks(self) -> list[Check]:
        """Time of an answer, rate of false alarms, intervals of severities."""
        out = [Check("an answer, median of 200", 1e3 * self.seconds, 1e3 * _LIMIT, "ms")]
        for row in self.rows:
            name = f"{row['baselines']} baselines"
            rate, covered = (
                row["false_alarms"] / row["healthy"], row["covered"] / row["severities"]
            )  # fmt: skip
            # Three deviations of a share of so many runs, and of as many that set the threshold.
            room = 3.0 * np.sqrt(2.0 * _RATE * (1.0 - _RATE) / row["healthy"])
            out.append(Check(f"false alarms, {name}", rate, float(_RATE + room)))
            least = _COVERED - 3.0 * np.sqrt(2.0 * _COVERED * (1.0 - _COVERED) / row["severities"])
            out.append(Check(f"severities in 90 %, {name}", covered, float(least), at_least=True))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            **verdict(self.checks), "rows": self.rows, "seconds": self.seconds,
            "learned": self.report,
        }  # fmt: skip


def plan_text(units: int, judged: int, fidelity: str, seed: int) -> str:
    """Return the campaign's plan (TOML)."""
    total = units + judged
    switching = ",current_d_meas,voltage_q_meas" if fidelity == "high" else ""
    steps = (
        '[parameters]\nsolver.method = "semi_implicit"\nsolver.step = "5 us"\n'
        'control.derivative_filter = "100"\n\n'
    )
    spread = "".join(
        f'[[population.spread]]\nparameter = "{path}"\ndistribution = "uniform"\n'
        f'from = "{low}"\nto = "{high}"\n'
        for path, low, high in _UNITS
    )
    draws = "".join(
        f'[[random.draw]]\nparameter = "{path}"\nfrom = "{low}"\nto = "{high}"\nrole = "nuisance"\n'
        for path, low, high in _RUNS
    ) + "".join(
        f'[[random.draw]]\nfault = "{name}"\nfrom = "{low}"\nto = "{high}"\nprobability = 0.1\n'
        for name, low, high in _FAULTS
    )
    return (
        f'name = "learned"\nactuator = "torino-rotary"\nfidelity = "{fidelity}"\n'
        f'record = ["{_RECORD}{switching}@400 Hz"]\nsplit_seed = {seed + 1}\n'
        'allow_not_acting = true\n\n[scenario]\nduration = "20 s"\n[[scenario.command.terms]]\n'
        'kind = "sine"\namplitude = "7 deg"\nbias = "10 deg"\nfrequency = "0.2 Hz"\n\n'
        f"{steps if fidelity == 'high' else ''}"
        f"[population]\nunits = {total}\npoints = 1\nseed = {seed + 1}\n{spread}"
        f'[random]\ncount = {_DRAWS}\nmethod = "uniform"\nseed = {seed + 5}\n{draws}'
        f"[split]\ntrain = {units / total!r}\ntest = {1.0 - units / total!r}\n"
    )


def study_learned_campaign(
    folder: Path,
    *,
    units: int = 100,
    judged: int = 30,
    fidelity: str = "high",
    seed: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
) -> LearnedCampaign:
    """Run the campaign, learn from some of its units, judge by the others.

    Parameters
    ----------
    folder : path
        Of the campaign; gone on with where it was begun.
    units, judged : int
        Units that are learnt from, and others that judge.
    fidelity : str
        Of the runs: ``high`` or ``low``.
    seed : int
        Of the campaign, of learning and of the baselines that are drawn.
    threads : int, optional
        Default: one a core.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    Interrupted
        `progress` returned False; finished runs stay.
    """
    from tempfile import TemporaryDirectory

    from elevon.campaign import load_campaign, load_plan, resolve_plan, run_campaign

    text = plan_text(units, judged, fidelity, seed)
    with TemporaryDirectory() as place:
        path = Path(place) / "plan.toml"
        path.write_text(text, encoding="utf-8")
        resolved = resolve_plan(*load_plan(path))
    run_campaign(resolved, text, folder, threads=threads, progress=part(progress, 0.0, 0.7))
    ds = load_campaign(folder)
    pairs = pole_pairs_of(ds)
    examples, motion, _, numbers = examples_of_dataset(ds, pairs, part(progress, 0.7, 0.8))
    split = ds.runs.to_pandas().set_index("run").loc[numbers, "split"].to_numpy()
    known = examples.take(np.flatnonzero(split == "train"))
    classes, report = learned_classes(
        known, motion, pole_pairs=pairs, seed=seed, progress=part(progress, 0.8, 1.0)
    )
    others = examples.take(np.flatnonzero(split == "test"))
    rows = [_judged(classes, others, count, seed) for count in (0, 1, 3)]
    return LearnedCampaign(rows, report, _seconds(classes, others))


def _judged(classes: LearnedClasses, others: Examples, count: int, seed: int) -> dict[str, Any]:
    """Count what is said of runs with so many baselines of their unit."""
    rng = np.random.default_rng([seed, count])
    says, rows = [], []
    for row, unit in enumerate(others.unit):
        near = np.flatnonzero(others.healthy & (others.unit == unit))
        near = rng.permutation(near[near != row])[:count]
        if count and not len(near):
            continue
        values = others.values[row] - (others.values[near].mean(axis=0) if count else 0.0)
        says.append(classes.says(values[None], relative=count > 0))
        rows.append(row)
    there, severity = others.present[rows], others.severity[rows]
    share = np.array([[o.probability[kind] for kind in classes.kinds] for o in says])
    ends = np.array([[o.severity[kind][1:] for kind in classes.kinds] for o in says])
    alarm = np.array([o.chance <= _RATE for o in says])
    healthy, single = ~there.any(axis=1), there.sum(axis=1) == 1
    first = share.argmax(axis=1) == there.argmax(axis=1)
    inside = (ends[..., 0] <= severity) & (severity <= ends[..., 1])
    return {
        "baselines": count, "runs": len(rows), "healthy": int(healthy.sum()),
        "false_alarms": int(alarm[healthy].sum()), "faulty": int((~healthy).sum()),
        "alarms": int(alarm[~healthy].sum()), "singles": int(single.sum()),
        "single_first": int(first[single].sum()),
        "all_named": int(((share > 0.5) == there).all(axis=1).sum()),
        "brier": float(np.mean((share - there) ** 2)), "severities": int(there.sum()),
        "covered": int(inside[there].sum()),
    }  # fmt: skip


def _seconds(classes: LearnedClasses, others: Examples) -> float:
    """Return the median time of an answer by numbers that are given."""
    spent = []
    for k in range(_REPEATS):
        row = others.values[k % len(others.values)][None]
        begin = clock.perf_counter()
        classes.says(row)
        spent.append(clock.perf_counter() - begin)
    return statistics.median(spent)
