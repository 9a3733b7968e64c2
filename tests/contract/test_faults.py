"""One suite over every fault of every actuator; a new one is covered the day its catalogue line
exists.

The variants of a cell run as one batch, so a test looks at a whole catalogue and names what fails.
"""

from __future__ import annotations

import math

import pytest

import elevon
from tests.contract import shipped
from tests.contract.cells import Cell, fault
from tests.contract.matrix import FEW, PARTS, cells, lasting, of_one_drive, silent, wrong


def _costly(cell: Cell) -> bool:
    return cell.fidelity == "high" and shipped.takes_actions(cell.name)


#: A control unit's switching model takes as long as all others together.
PLAIN = pytest.mark.parametrize(
    "cell",
    [
        pytest.param(cell, id=cell.title, marks=pytest.mark.long if _costly(cell) else ())
        for cell in cells(every=False)
    ],
)


@PLAIN
def test_severity_zero_is_healthy_and_a_severe_fault_is_not(cell: Cell) -> None:
    """To the bit at zero; a severe one changes some signal or is reported to have no effect; two
    severities that act differently have different labels.
    """
    assert [*wrong(cell, FEW), *silent([cell], FEW)] == []


@pytest.mark.long
@pytest.mark.parametrize("name", shipped.names())
def test_every_drive_and_load_at_every_severity(name: str) -> None:
    """Every choice of a drive under which the set moves; without a load, against one, with one."""
    mine = [cell for cell in cells(every=True) if cell.name == name]
    found = {cell.title: list(wrong(cell, PARTS)) for cell in mine}
    found |= {
        f"{some[0].title}, any load": list(silent(some, PARTS)) for some in of_one_drive(mine)
    }
    assert "\n".join(f"{title}: {line}" for title, lines in found.items() for line in lines) == ""


@pytest.mark.long
@PLAIN
def test_a_cleared_fault_is_forgotten(cell: Cell) -> None:
    """The way is the healthy one again within the time `matrix` states, unless the drive or the
    control unit says that it has stopped for good.
    """
    assert list(lasting(cell)) == []


@pytest.mark.parametrize("name", shipped.names())
def test_severity_out_of_range_is_refused_by_name(name: str) -> None:
    """Above the maximum (if there is one), below the minimum, and NaN."""
    for kind, place, record in shipped.places(name):
        ends = (record["maximum"] + 1.0, record["minimum"] - 1.0)
        for severity in (math.nan, *(end for end in ends if math.isfinite(end))):
            scenario = shipped.scenario(name, dict(fault(kind, place, record, severity)))
            with pytest.raises(elevon.InputError) as caught:
                elevon.simulate(shipped.actuator(name), scenario)
            assert kind in str(caught.value) or "severity" in str(caught.value)
