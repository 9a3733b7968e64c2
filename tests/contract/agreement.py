"""Where the two models part: the features that they share, in means over the reduced-order model's
band.

The reduced-order model carries means; the switching one shows the ripple of relays and carrier
beside them, and a sample of it now and then shows the carrier's phase: read once a millisecond in
step with its 20 kHz carrier, the landing gear's torque has a mean of 0.040 N m; it is 0.055 over
all instants (and at low). So both are read often, out of step with any carrier, and averaged over
`BAND` before their size is requested.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import elevon
from elevon.errors import ElevonWarning
from elevon.parameters import records
from tests.contract import shipped
from tests.contract.cells import Cell, Choices, Variant, fault, severe

#: Agreement in sign and within this factor ...
FACTOR = 1.5
#: ... where the switching model's change is this many of its own floors (healthy against healthy)
#: and this part of the healthy value.
FLOORS, SEEN = 5.0, 0.05
#: A change that passes through none as the fault grows is no measure there: within this part of the
#: severity a hair more or less of the fault is all of it. Both sides of the passage are compared.
NEIGHBOUR = 0.05
#: Healthy runs of the switching model that differ in nothing that matters: half the step, and a
#: winding a ten-thousandth warmer or colder, by which relays and stick fall into another phase.
ALIKE = 1e-4

#: Mechanical signals, torque, and the current that makes it (of a servo, of a landing gear).
SIGNALS = ("output_position", "motor_speed", "motor_torque", "current_q", "current_mean")
#: Window of the means, s, and the time between two readings, s: no carrier's period is a multiple.
BAND, READ = 1e-3, 23e-6
#: Runs in one batch: what they keep stays under a few hundred megabytes.
BATCH = 16


@dataclass(frozen=True)
class Sizes:
    """How a run ended, and the mean size of each shared signal over it."""

    status: str
    message: str
    sizes: Mapping[str, float]


def sizes_of(cell: Cell, variants: Sequence[Variant], duration: float | None = None) -> list[Sizes]:
    """What each variant shows, from batches of a few."""
    return [
        shows
        for first in range(0, len(variants), BATCH)
        for shows in _batch(cell, variants[first : first + BATCH], duration)
    ]


def _batch(cell: Cell, variants: Sequence[Variant], duration: float | None) -> list[Sizes]:
    signals = set(SIGNALS) & set(shipped.signals(cell.name, cell.fidelity))
    runs = [cell.of(variant, duration) for variant in variants]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ElevonWarning)
        recordings = elevon.simulate_batch(
            runs,
            fidelity=cell.fidelity,
            record=",".join(sorted(signals)) + f"@{_rate(cell)} Hz",
            threads=1,
        )
    return [_sizes(recording, signals) for recording in recordings]


def _rate(cell: Cell) -> str:
    """Readings a second: the multiple of the cell's step that is nearest to `READ`, or its step."""
    path = "solver.step" if cell.fidelity == "high" else "low.step"
    step = cell.actuator().parameters.value(path)
    return repr(1.0 / (step * max(round(READ / step), 1)))


def _sizes(recording: elevon.Recording, signals: set[str]) -> Sizes:
    channels = {item.name: item for item in recording.channels if item.name in signals}
    sizes = {name: _size(item.time, item.values) for name, item in channels.items()}
    return Sizes(recording.status, recording.meta["message"], sizes)


def _size(time: np.ndarray, values: np.ndarray) -> float:
    """Mean over the run of the size of the means over `BAND`."""
    window = np.floor(time[1:] / BAND - 1e-6).astype(int)
    means = np.bincount(window, values[1:]) / np.bincount(window)
    return float(np.mean(np.abs(means)))


def apart(
    name: str,
    choices: Choices,
    push: float,
    only: Collection[str] = (),
    duration: float | None = None,
    planted: float = 1.0,
) -> Iterator[str]:
    """Faults that both models carry and in which they part: sign, or a factor of 1.5.

    All of them, or only some, over the motion or another duration (s); where they are few, healthy
    runs are not compared among themselves: what is requested stands far above their differences.
    `planted` is an error of the reduced-order model's severities, to be seen.
    """
    choices = (*choices, *shared_choices(name))
    pair = Pair(*(Cell(name, fidelity, choices, push) for fidelity in ("high", "low")),
                duration, planted)  # fmt: skip
    chosen = [variant for variant in _carried(pair) if not only or variant.name in only]
    (healthy, *broken), (healthy_low, *broken_low) = pair.run([Variant(), *chosen])
    floors = dict.fromkeys(healthy.sizes, 0.0) if only else _floors(pair.high, healthy)
    before = Healthy(floors, healthy, healthy_low)
    for variant, after, after_low in zip(chosen, broken, broken_low, strict=True):
        if after.status != after_low.status:
            yield f"{variant.name}: high ends as {after.status}, low as {after_low.status}"
        elif after.status == "ok":
            parted = before.parted(after, after_low)
            yield from (
                f"{variant.name}: {text}" for text in _standing(pair, before, variant, parted)
            )


@dataclass(frozen=True)
class Pair:
    """The same cell at both fidelities."""

    high: Cell
    low: Cell
    duration: float | None
    planted: float

    def run(self, variants: Sequence[Variant]) -> tuple[list[Sizes], list[Sizes]]:
        """What the variants show in each model."""
        wrong = [_grown(variant, self.planted) for variant in variants]
        return sizes_of(self.high, variants, self.duration), sizes_of(
            self.low, wrong, self.duration
        )


@dataclass(frozen=True)
class Healthy:
    """What healthy runs show, and what is no change of it."""

    floors: Mapping[str, float]
    high: Sizes
    low: Sizes

    def parted(self, after: Sizes, after_low: Sizes) -> dict[str, str]:
        """Features of a fault in which the reduced-order model is elsewhere, and what both show."""
        texts = {}
        for key in sorted(self.high.sizes.keys() & self.low.sizes.keys()):
            change = self.change(key, after)
            change_low = after_low.sizes[key] - self.low.sizes[key]
            if abs(change) <= max(FLOORS * self.floors[key], SEEN * self.high.sizes[key]):
                continue
            ratio = change_low / change
            if not 1.0 / FACTOR <= ratio <= FACTOR:
                texts[key] = f"{key} {change:+.3g} high, {change_low:+.3g} low ({ratio:.2f})"
        return texts

    def change(self, key: str, after: Sizes) -> float:
        """Change of a feature at high fidelity."""
        return after.sizes[key] - self.high.sizes[key]


def _standing(
    pair: Pair, before: Healthy, variant: Variant, parted: Mapping[str, str]
) -> Iterator[str]:
    """What is left of the features that part: not those that agree on both sides of a passage."""
    neighbours = [_grown(variant, 1.0 - NEIGHBOUR), _grown(variant, 1.0 + NEIGHBOUR)]
    if not parted or any(pair.high.refused(one) for one in neighbours):
        yield from parted.values()
        return
    high, low = pair.run(neighbours)
    whole = all(after.status == "ok" for after in (*high, *low))
    apart_too = [before.parted(*both) for both in zip(high, low, strict=True)]
    for key, text in parted.items():
        less, more = (before.change(key, after) for after in high)
        if not whole or less * more > 0.0 or any(key in some for some in apart_too):
            yield text


def _grown(variant: Variant, factor: float) -> Variant:
    """The same variant with faults of other severities."""
    faults = tuple({**one, "severity": factor * one["severity"]} for one in variant.faults)
    return Variant(variant.name, variant.values, faults)


def _carried(pair: Pair) -> list[Variant]:
    """Every fault that runs and acts at both fidelities, severe."""
    high, low = pair.high, pair.low
    lows = {(kind, place) for kind, place, _ in low.faults()}
    chosen = [
        Variant(f"{kind}@{place}", faults=(fault(kind, place, record, severe(record)),))
        for kind, place, record in high.faults()
        if (kind, place) in lows
    ]
    return [
        variant
        for variant in chosen
        if not any(cell.refused(variant) or cell.resting(variant) for cell in (high, low))
    ]


def _floors(cell: Cell, healthy: Sizes) -> dict[str, float]:
    """Largest difference of each feature among healthy runs that differ in nothing of matter."""
    value = cell.actuator().parameters.value
    winding, step = "motor.winding_resistance", "solver.step"
    alike = [
        *sizes_of(
            cell, [Variant(values={winding: value(winding) * x}) for x in (1 + ALIKE, 1 - ALIKE)]
        ),
        *sizes_of(cell, [Variant(values={step: 0.5 * value(step)})]),
    ]
    return {
        key: max(abs(one.sizes[key] - size) for one in alike) for key, size in healthy.sizes.items()
    }


def shared_choices(name: str) -> Choices:
    """Choices that the reduced-order model declines, at their defaults: both models then agree."""
    actuator = shipped.actuator(name)
    return tuple(
        (path, record.choices[int(record.default)])
        for path, record in records(actuator.wiring).items()
        if record.choices and "low" not in record.fidelities and "high" in record.fidelities
        and record.default is not None
        and actuator.parameters[path].value != record.choices[int(record.default)]
    )  # fmt: skip


__all__ = ["apart", "shared_choices", "sizes_of"]
