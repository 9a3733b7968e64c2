"""Slips of the pen, planted and found."""

from dataclasses import replace

import pytest

from elevon.calibrate.drops import WeightDrop, find_slips, printed_drops

ENDS = (0.018432, -0.2304, -0.22118, -0.22118)


def _sound():
    drops = []
    for k in range(20):
        motor = -0.15 - 0.021 * k + 0.0013 * (k * 7 % 5)
        encoder = ENDS[k % 4]
        drops.append(WeightDrop(k + 1, 5.0 * (k // 4 + 1), motor, encoder, abs(encoder - motor)))
    return drops


def test_sound_rows_are_left_alone():
    drops = _sound()
    repaired, slips = find_slips(drops)
    assert repaired == drops
    assert slips == []


@pytest.mark.parametrize("row", [2, 9, 16])
@pytest.mark.parametrize(
    ("kind", "spoil"),
    [
        ("swapped", lambda d: replace(d, motor_deg=d.encoder_deg, encoder_deg=d.motor_deg)),
        ("sign", lambda d: replace(d, motor_deg=-d.motor_deg)),
        ("decimal", lambda d: replace(d, encoder_deg=10 * d.encoder_deg)),
        ("loss", lambda d: replace(d, loss_deg=d.loss_deg + 0.01)),
    ],
)
def test_a_planted_slip_is_found_and_mended(row, kind, spoil):
    drops = _sound()
    sound = drops[row - 1]
    drops[row - 1] = spoil(sound)
    repaired, slips = find_slips(drops)
    assert (row, kind) in {(slip.row, slip.kind) for slip in slips}
    assert {slip.row for slip in slips} == {row}
    mended = repaired[row - 1]
    assert mended.motor_deg == pytest.approx(sound.motor_deg)
    assert mended.encoder_deg == pytest.approx(sound.encoder_deg)
    assert mended.loss_deg == pytest.approx(sound.loss_deg)


def test_the_printed_table_is_left_as_printed():
    drops = printed_drops()
    assert len(drops) == 40
    assert drops[0] == WeightDrop(1, 5.09, -0.15245, 0.18432, 0.33677)
    assert drops[28].encoder_deg == 0.546464
