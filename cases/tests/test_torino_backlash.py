"""The backlash campaign: geometry, and (long) all fifteen backlashes through the command."""

import json
import math

import pytest

from elevon.cli import main
from elevon_cases.torino.backlash import centre_distance, formula_deg, measured_rows


def test_the_table_is_that_of_the_paper():
    rows = measured_rows()
    assert [row.row for row in rows] == list(range(1, 16))
    # T1 Table 2, experimental backlash in degrees.
    published = {1: 0.3667, 2: 0.4985, 3: 0.5386, 7: 0.9855, 8: 1.1058, 9: 1.3006,
                 13: 2.2976, 14: 2.4981, 15: 2.6184}  # fmt: skip
    for number, value in published.items():
        assert rows[number - 1].measured_total_deg == pytest.approx(value, abs=5e-5)


def test_geometry():
    for row in measured_rows():
        assert centre_distance(row.micrometer_mm) == pytest.approx(
            row.centre_distance_mm, abs=0.015
        )
        assert formula_deg(row.spacing_mm) - formula_deg(0.0) == pytest.approx(
            row.calculated_deg, abs=0.0025
        )
    # The general form: 4 dC tan(alpha) / (m z), here with m = 2 and z = 88.
    net = math.radians(formula_deg(1.0) - formula_deg(0.0))
    assert net == pytest.approx(4.0 * math.tan(math.radians(20.0)) / (2 * 88))


@pytest.mark.long
def test_all_fifteen_backlashes_come_back(tmp_path, capsys):
    assert main(["reproduce", "torino-backlash", "--json", "--out", str(tmp_path)]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["status"] == "pass"
    assert values["encoder_count_deg"] == pytest.approx(360.0 / 80000.0)
    assert len(values["rows"]) == 15
    for row in values["rows"]:
        limit = values["encoder_count_deg"] + 0.02 * row["backlash_in_deg"]
        assert row["backlash_in_deg"] == row["measured_total_deg"]
        assert abs(row["backlash_out_deg"] - row["backlash_in_deg"]) <= limit
        assert row["backlash_out_deg"] != row["backlash_in_deg"]  # measured, not handed through
        assert row["lost_motion_deg"] == pytest.approx(row["backlash_in_deg"], abs=0.0045)
    page = (tmp_path / "report.html").read_text("utf-8")
    assert page.count("<svg") == 3
    assert "checks pass" in page
