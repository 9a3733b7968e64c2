"""The low model shows what the high one does, or its record says that it does not carry it."""

from __future__ import annotations

import pytest

from tests.contract import sets
from tests.contract.cells import drives
from tests.contract.matrix import apart


@pytest.mark.long
@pytest.mark.parametrize("name", sets.names())
def test_both_models_agree_on_every_fault_that_both_carry(name: str) -> None:
    """In every drive, in sign and within a factor of 1.5 on the features they share."""
    found = {str(choices): list(apart(name, choices, 0.0)) for choices in drives(name)}
    assert "\n".join(f"{drive}: {line}" for drive, lines in found.items() for line in lines) == ""
