"""Random cases of actuator, drive, load and faults, and where the two models part in them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import elevon
from elevon.errors import ElevonWarning
from tests.contract import shipped
from tests.contract.agreement import Sizes, shared_choices, sizes_of
from tests.contract.cells import Cell, Variant, drives, fault, load, severe

#: Largest difference of a feature, of its size at high fidelity, with or without the faults.
APART = 0.10
#: Most faults of a case, and the least share of a severe severity.
MOST, LEAST = 2, 0.1
#: Runs that differ in nothing that matters: windings apart by so much, so many on either side.
HAIR, HAIRS = 1e-4, 5
#: Features in which a motor stalled at the current cut-off parts, and what states it.
CUT_OFF = ("current_mean", "motor_torque")
PAGE = "docs/explanation/theory/landing-gear.md"
STATED = f"{PAGE}: at the current cut-off the reduced-order model holds its peak"
#: Least share of the run for which a motor that counts as stalled stands there.
AT_CUT_OFF = 0.05
#: A servo's run covers one swing, s; a gear's is as long as its actions.
SWING = 0.25


@dataclass(frozen=True)
class Case:
    """One case: the same cell at both fidelities, and what is broken."""

    high: Cell
    low: Cell
    variant: Variant
    kinds: tuple[str, ...]

    @property
    def title(self) -> str:
        """What is run, as a person repeats it."""
        return f"{self.high.title} {self.high.load:.4g} {self.variant.name}"

    @property
    def seconds(self) -> float | None:
        """Duration of the run; None: the motion's own."""
        return None if shipped.takes_actions(self.high.name) else SWING


def cases(count: int, seed: int, names: Sequence[str] = ()) -> Iterator[Case]:
    """Yield cases that the switching model runs: actuator, drive, load, up to two faults."""
    rng = np.random.default_rng(seed)
    drawn = 0
    while drawn < count:
        case = _drawn(rng, names or shipped.names())
        if not case.high.refused(case.variant) and not case.high.resting(case.variant):
            drawn += 1
            yield case


def _drawn(rng: np.random.Generator, names: Sequence[str]) -> Case:
    name = str(rng.choice(names))
    ways = drives(name)
    choices = (*ways[int(rng.integers(len(ways)))], *shared_choices(name))
    push = float(rng.uniform(-1.0, 1.0)) * load(name)
    high, low = (Cell(name, fidelity, choices, push) for fidelity in ("high", "low"))
    catalogue = high.faults()
    chosen = rng.choice(len(catalogue), size=int(rng.integers(MOST + 1)), replace=False)
    broken = [
        (kind, fault(kind, place, record, _part(record, rng) * severe(record)))
        for kind, place, record in (catalogue[int(index)] for index in chosen)
    ]
    names = [f"{kind}@{one['place']}={one['severity']:.4g}" for kind, one in broken]
    variant = Variant(" ".join(names) or "healthy", faults=tuple(one for _, one in broken))
    return Case(high, low, variant, tuple(kind for kind, _ in broken))


def _part(record: Mapping[str, Any], rng: np.random.Generator) -> float:
    """Share of a severe severity: all of what is there or not, or counted."""
    share = float(rng.uniform(LEAST, 1.0))
    return 1.0 if record["whole"] or record["effect"].startswith("1: ") else share


def not_modelled(case: Case) -> str:
    """Why the reduced-order model does not run the case; empty: it does."""
    return case.low.refused(case.variant)


def declared(case: Case, text: str) -> str:
    """What states that the models part in the feature a text begins with; empty: nothing does."""
    at_cut_off = text.split(maxsplit=1)[0] in CUT_OFF and _stalls_at_the_cut_off(case)
    return STATED if at_cut_off else ""


def _stalls_at_the_cut_off(case: Case) -> bool:
    """Does the motor stand at the cut-off of its current in the switching model?"""
    cell = case.high
    if not shipped.takes_actions(cell.name):
        return False
    run = cell.of(case.variant, case.seconds)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ElevonWarning)
        record = "current_peak,motor_speed@1 kHz"
        rec = elevon.simulate(run.actuator, run.scenario, fidelity="high", record=record)
    limit = run.actuator.parameters.value("inverter.current_cutoff")
    stands = rec["motor_speed"].values == 0.0
    return bool(np.mean(stands & (rec["current_peak"].values >= limit)) > AT_CUT_OFF)


def parted(case: Case) -> list[str]:
    """Features in which the models are further apart than `APART`, and what both show.

    Where the switching model parts from itself as far, by hairs of its winding's resistance, the
    run is one of chance, and the other model need only be among those: a Hall edge falls just
    before or after the supply of the sensors returns, and the control unit ends the motion or not.
    """
    variants = [Variant(), case.variant] if case.kinds else [case.variant]
    high, low = (sizes_of(cell, variants, case.seconds) for cell in (case.high, case.low))
    healthy, broken, shows = high[0], high[-1], low[-1]
    if broken.status != shows.status:
        return [f"high ends as {broken.status} ({broken.message}), low as {shows.status}"]
    names = sorted(broken.sizes.keys() & shows.sizes.keys())
    size = {name: max(broken.sizes[name], healthy.sizes[name]) for name in names}
    if all(among([broken], shows, name, size[name]) for name in names):
        return []
    alike = [broken, *hairs(case)]
    return [
        f"{name} {broken.sizes[name]:.4g} high, {shows.sizes[name]:.4g} low "
        f"(healthy {healthy.sizes[name]:.4g})"
        for name in names
        if not among(alike, shows, name, size[name])
    ]


def hairs(case: Case) -> list[Sizes]:
    """What the switching model shows with windings a few ten-thousandths warmer or colder."""
    path = "motor.winding_resistance"
    value = case.high.actuator(case.variant.values).parameters.value(path)
    changed = [{path: value * (1.0 + HAIR * k)} for k in range(-HAIRS, HAIRS + 1) if k]
    variants = [Variant(case.variant.name, x, case.variant.faults) for x in changed]
    return sizes_of(case.high, variants, case.seconds)


def among(runs: Sequence[Sizes], shows: Sizes, name: str, size: float) -> bool:
    """Is a feature within what the runs show, give or take `APART`?"""
    seen = [run.sizes[name] for run in runs]
    return min(seen) - APART * size <= shows.sizes[name] <= max(seen) + APART * size
