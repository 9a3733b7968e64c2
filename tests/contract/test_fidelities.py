"""The reduced-order model shows what the switching one does, or its record states the reason."""

from __future__ import annotations

import pytest

from tests.contract import shipped
from tests.contract.agreement import apart
from tests.contract.cells import Choices, drives, load

PUSHES = {"no_load": 0.0, "opposing": 1.0, "aiding": -1.0}


@pytest.mark.long
@pytest.mark.parametrize("push", PUSHES.values(), ids=PUSHES)
@pytest.mark.parametrize("name", shipped.names())
def test_both_models_agree_on_every_fault_that_both_carry(name: str, push: float) -> None:
    """In every drive, in sign and within a factor of 1.5 on the features they share."""
    parted = {
        str(choices): list(apart(name, choices, push * load(name))) for choices in drives(name)
    }
    assert "\n".join(f"{drive}: {line}" for drive, lines in parted.items() for line in lines) == ""


PWM: Choices = (("drive.kind", "pwm"),)
SIX_STEP: Choices = (("drive.commutation", "six_step"),)
#: What is looked at each time: references apart from the rotor, a reading that is lost, integrals
#: that no current follows, a voltage limit.
PINNED: list[tuple[str, Choices, float | None, tuple[str, ...]]] = [
    ("torino-rotary", (), None, ("offset@sensor.resolver", "gain@sensor.current_c")),
    ("torino-rotary", PWM, None, tuple(f"open_phase@motor.phase_{j}" for j in "abc")),
    ("torino-rotary", SIX_STEP, None, ("offset@sensor.resolver", "stuck@sensor.resolver")),
    ("nasa-ballscrew", (), None, ("dropout@sensor.resolver", "sag@supply")),
]


@pytest.mark.parametrize(("name", "choices", "duration", "faults"), PINNED)
def test_both_models_agree_on_these(
    name: str, choices: Choices, duration: float | None, faults: tuple[str, ...]
) -> None:
    """The same of a few faults, with an aiding load."""
    assert list(apart(name, choices, -load(name), faults, duration)) == []


def test_an_error_beside_a_passage_is_seen() -> None:
    """Six-step, references 1 rad away: the q current is as without the fault, by two effects.

    0.95 rad adds 0.59 A, 1.05 rad takes 0.14 A away. Both models do; one whose offset is a tenth
    too small does not.
    """
    cell = ("torino-rotary", SIX_STEP, 0.0, ("offset@sensor.resolver",))
    assert list(apart(*cell)) == []
    assert any("current_q" in line for line in apart(*cell, planted=0.9))
