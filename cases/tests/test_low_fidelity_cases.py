"""The three cases in which the reduced-order model must hold."""

import json

import pytest

from elevon.cli import main
from elevon_cases.torino.low_fidelity import CaseRow


def test_a_case_below_the_relay_band_is_held_beside_its_floor_only():
    row = CaseRow("x", 0.001, 0.01, 0.2, 0.3, 0.06, None)
    assert [check.passed for check in row.checks()] == [True, False]
    row = CaseRow("x", 0.006, 0.01, 0.2, 0.3, 0.06, 0.01)
    assert [check.passed for check in row.checks()] == [False]


@pytest.mark.long
def test_the_command_passes(capsys):
    assert main(["reproduce", "low-fidelity", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["status"] == "pass"
    assert len(values["rows"]) == 3
    assert values["rows"][2]["floor_a"] > 0.0
