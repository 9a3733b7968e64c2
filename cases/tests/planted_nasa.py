"""Results of the NASA cases, right but for what is planted in them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import test_paper_figures as drawn
from elevon_cases.nasa.baseline import baseline_matrix
from elevon_cases.nasa.baseline_rows import MEASURES, BaselineRow
from planting import given, patched


# --- nasa-current --------------------------------------------------------------------------------
def current(count=32, nominal=7.0, jam=8.0, **largest):
    """Return the checks of runs with these errors, and one with the largest."""
    from elevon_cases.nasa.current import CurrentResult

    rows = [SimpleNamespace(state="nominal", percent_rms=nominal)] * count
    rows += [SimpleNamespace(state="jam", percent_rms=jam)] * 10
    for state, most in largest.items():
        rows.append(SimpleNamespace(state=state.removesuffix("_most"), percent_rms=most))
    return CurrentResult(rows, [], 0, "").checks


def drawn_figures(number=19, **changes):
    """Return the checks of one of the two figures, but for what is wrong."""
    from elevon_cases.nasa.faults import figure_checks

    return figure_checks(
        [item for k in (18, 19)
         for item in drawn.figure(figure=k, **(changes if k == number else {}))]
    )  # fmt: skip


def seeding(change=lambda rows: rows, **wrong):
    """Return the checks of both ways to seed a short."""
    from elevon_cases.nasa.faults import seeding_checks

    return seeding_checks(change(drawn.seeding(**wrong)))


def figures_and_seeding():
    """Return the checks of both parts."""
    return [*drawn_figures(), *seeding()]


def flown(excess=0.2, floor=(0.01, -0.01, 0.005), missing=0.03):
    """Return the checks of a flight, but for what is wrong."""
    from elevon_cases.nasa.flight import checks_of

    return checks_of(excess, np.array(floor), missing)


def first_row(**changes):
    """Return a change of the first row."""
    return lambda rows: [replace(rows[0], **changes), *rows[1:]]


# --- nasa-thermal --------------------------------------------------------------------------------
THERMAL = "nasa.thermal:"


class Altered:
    """A recording of which one channel reads otherwise."""

    def __init__(self, recording, name, change):
        self._recording, self._name, self._change = recording, name, change
        self.meta = recording.meta

    def __getitem__(self, name):
        channel = self._recording[name]
        if name != self._name:
            return channel
        return SimpleNamespace(time=channel.time, values=self._change(channel.values))


def hour(name, change, check="_trend_checks"):
    """Let one channel of the hour read otherwise."""
    return (THERMAL + check, given(lambda run: Altered(run, name, change)))


def slower(values):
    """Turn the rise round."""
    return values[0] + values[0] - values


def fading(values):
    """Let the rise end with the step of the load, in the middle of the hour."""
    bend = len(values) // 2
    late = values[bend] + 1e-3 * (values[bend:] - values[bend])
    return np.concatenate([values[:bend], late])


def dema(place, change):
    """Change what the fit of the bench is judged by: rows, measured, model, truth."""
    return ("nasa.dema:_checks", given(change, place))


def one_wrong(rows):
    """Return the rows with one value recovered 10 % off."""
    return [replace(rows[0], recovered=1.1 * rows[0].put_in), *rows[1:]]


def raised(row, by, last=None):
    """Return a change that raises a row of temperatures, all of it or its last samples."""

    def change(values):
        higher = np.array(values)
        higher[row, last:] += by
        return higher

    return change


# --- nasa-baseline -------------------------------------------------------------------------------
def cells(**wrong):
    """Return rows of the whole matrix whose current rises with the load; `wrong` by measure."""
    rows = []
    for profile, load in baseline_matrix():
        values = dict.fromkeys(MEASURES, 0.1) | {"rms_current_a": 0.5 + 6e-4 * abs(load)}
        if load == wrong.get("load", load):
            values |= {k: v for k, v in wrong.items() if k in MEASURES}
        rows.append(BaselineRow(profile, load, "ok", "", (tuple(values.values()),) * 2))
    return rows


def baseline(rows=None, coverage=None):
    """Return the checks of rows, and of intervals that hold known effects so often."""
    from elevon.actuator import Actuator
    from elevon_cases.nasa import baseline as module

    chosen = cells() if rows is None else rows
    checks = module._checks(chosen, Actuator.load("nasa-ballscrew"))
    checks += module._order_checks(chosen)
    place = ("nasa.baseline:coverage", lambda function: lambda *a, **k: coverage or (0.95, 0.1))
    with patched(place):
        return checks + module._effects(chosen, 2, 0)[1]


def refused():
    """Return the rows with one cell that did not run."""
    return [replace(cells()[0], status="refused", runs=()), *cells()[1:]]


# --- nasa-separation -----------------------------------------------------------------------------
def separation(rate=1e-4, tables=0.02, half=(0.5,), impact=1.0):
    """Return the checks of a table with these shares, effects of half severity and impacts."""
    from elevon_cases.nasa.features import FEATURES, GAP, LOADED, UNLOADED, impact_checks
    from elevon_cases.nasa.separation import _checks, null_checks

    rows = [
        SimpleNamespace(effect=SimpleNamespace(size=1.0, significant=True),
                        half=SimpleNamespace(size=size))
        for size in half
    ]  # fmt: skip
    noise = np.random.default_rng(0).normal(size=(20, len(FEATURES)))
    simulated = {}
    for load, strong, weak in (
        (UNLOADED, "triangular", "trapezoidal"),
        (LOADED, "trapezoidal", "triangular"),
    ):
        simulated[strong, load] = {"healthy": noise, GAP: noise + 2.0 * impact + 0.1 * noise}
        simulated[weak, load] = {"healthy": noise, GAP: noise + 1.0}
    level = 1.0 - 0.05 / 200.0
    return [*null_checks(rate, tables, level), *_checks(rows), *impact_checks(simulated)]
