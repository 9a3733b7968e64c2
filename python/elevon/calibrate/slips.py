"""Slips of the pen in the printed compliance table, found from the table itself.

Nothing here knows which rows are wrong. What is known: the encoder came back to the same few end
positions again and again while the motor never stopped twice at the same place; every weight pulls
to the same side; and the printed loss is the distance between the two positions of its row.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from elevon.data import read_table

_ROUNDING = 2e-5
"""Half a unit of the last printed digit of two positions and a loss, together [deg]."""
_NEAR = 1e-3
"""Readings closer than this are the same encoder position: a count is 4.5e-3 deg [deg]."""


@dataclass(frozen=True, slots=True)
class WeightDrop:
    """One weight let down once.

    Attributes
    ----------
    row : int
        Place in the printed order, from 1.
    load_n : float
        Printed load [N].
    motor_deg, encoder_deg : float
        End positions at the output shaft [deg].
    loss_deg : float
        Angle lost between them [deg].
    """

    row: int
    load_n: float
    motor_deg: float
    encoder_deg: float
    loss_deg: float

    @property
    def drop(self) -> int:
        """Which of the four drops of its weight this is, from 1."""
        return (self.row - 1) % 4 + 1


@dataclass(frozen=True, slots=True)
class Slip:
    """One thing wrong in a printed row.

    Attributes
    ----------
    row : int
        Place in the printed order, from 1.
    kind : str
        `swapped` (columns exchanged), `sign`, `decimal` or `loss` (not that of its positions).
    reason : str
        The evidence, in words.
    """

    row: int
    kind: str
    reason: str


def printed_drops() -> list[WeightDrop]:
    """Return the forty rows as printed."""
    table = read_table("torino_compliance")
    names = ("load_n", "motor_deg", "encoder_deg", "loss_deg")
    return [
        WeightDrop(k, *(float(line[name]) for name in names)) for k, line in enumerate(table, 1)
    ]


def find_slips(drops: Sequence[WeightDrop]) -> tuple[list[WeightDrop], list[Slip]]:
    """Find what is wrong in each row, and what the row should have read.

    Parameters
    ----------
    drops : sequence of WeightDrop
        Rows in printed order.

    Returns
    -------
    repaired : list of WeightDrop
        Rows in the same order; a row without a slip is the row given.
    slips : list of Slip
        Every slip with its evidence, in the order of the rows.
    """
    ends = _encoder_ends(drops)
    downwards = sum(_motor(drop, ends) < 0 for drop in drops) * 2 > len(drops)
    repaired, slips = [], []
    for drop in drops:
        fixed, misplaced = _positions(drop, ends, downwards)
        fixed, wrong = _loss(drop, fixed, bool(misplaced), drops)
        repaired.append(fixed)
        slips += misplaced + wrong
    return repaired, slips


def _encoder_ends(drops: Sequence[WeightDrop]) -> list[float]:
    """Positions at which at least three rows ended: only the encoder repeats itself."""
    readings = [value for drop in drops for value in (drop.motor_deg, drop.encoder_deg)]
    counts = Counter(round(value, 5) for value in readings)
    return [value for value, count in counts.items() if count >= 3]


def _is_end(value: float, ends: Sequence[float]) -> bool:
    return any(abs(value - end) < _NEAR for end in ends)


def _swapped(drop: WeightDrop, ends: Sequence[float]) -> bool:
    return _is_end(drop.motor_deg, ends) and not _is_end(drop.encoder_deg, ends)


def _motor(drop: WeightDrop, ends: Sequence[float]) -> float:
    return drop.encoder_deg if _swapped(drop, ends) else drop.motor_deg


def _positions(
    drop: WeightDrop, ends: Sequence[float], downwards: bool
) -> tuple[WeightDrop, list[Slip]]:
    """Mend the two positions of a row."""
    fixed, slips = drop, []
    if _swapped(drop, ends):
        fixed = replace(drop, motor_deg=drop.encoder_deg, encoder_deg=drop.motor_deg)
        reason = f"the motor column holds {drop.motor_deg:g}, an end position of the encoder"
        slips.append(Slip(drop.row, "swapped", reason))
    if (fixed.motor_deg < 0) != downwards:
        slips.append(Slip(drop.row, "sign", f"the motor ends at {fixed.motor_deg:+g} deg, alone"))
        fixed = replace(fixed, motor_deg=-fixed.motor_deg)
    if not _is_end(fixed.encoder_deg, ends) and _is_end(fixed.encoder_deg / 10, ends):
        reason = f"{fixed.encoder_deg:g} is ten times an end position of the encoder"
        slips.append(Slip(drop.row, "decimal", reason))
        fixed = replace(fixed, encoder_deg=fixed.encoder_deg / 10)
    return fixed, slips


def _loss(
    printed: WeightDrop, fixed: WeightDrop, moved: bool, drops: Sequence[WeightDrop]
) -> tuple[WeightDrop, list[Slip]]:
    """Hold the printed loss against the positions, as printed and as mended."""
    difference = abs(printed.encoder_deg - printed.motor_deg)
    slips = []
    if abs(difference - printed.loss_deg) > _ROUNDING:
        twins = [d.row for d in drops if d.loss_deg == printed.loss_deg and d.row != printed.row]
        copy = f"; {printed.loss_deg:g} is the loss of row {twins[0]}" if twins else ""
        reason = f"printed loss {printed.loss_deg:g}, its positions give {difference:.5f}{copy}"
        slips.append(Slip(printed.row, "loss", reason))
    distance = abs(fixed.encoder_deg - fixed.motor_deg)
    if slips or (moved and abs(distance - printed.loss_deg) > _ROUNDING):
        fixed = replace(fixed, loss_deg=distance)
    return fixed, slips
