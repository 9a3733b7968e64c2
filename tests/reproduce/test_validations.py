"""The published validations, on virtual stands with a mismatch."""

import json

import pytest

from elevon.cli import main
from elevon.reproduce.nasa.current import PUBLISHED, CurrentResult, CurrentRow
from elevon.reproduce.nasa.page_current import current_report


def rows(percent):
    nominal = [CurrentRow("nominal", 1, "sinusoid", "x", percent, 0.1) for _ in range(32)]
    return [*nominal, CurrentRow("jam", 1, "sinusoid", "x", 5.0, 0.1)]


@pytest.mark.parametrize(
    ("percent", "status"), [(7.0, "pass"), (10.5, "fail"), (float("nan"), "fail")]
)
def test_the_average_is_held_to_the_published_maximum(percent, status):
    result = CurrentResult(rows(percent), [], 0, "")
    assert result.to_dict()["status"] == status
    assert result.summary("jam") == (5.0, 5.0, 5.0)


def test_fewer_runs_than_published_fail():
    assert CurrentResult(rows(7.0)[4:], [], 0, "").to_dict()["status"] == "fail"


def test_the_page_says_what_measured_means_and_shows_the_published_figures():
    page = current_report(CurrentResult(rows(7.0), [], 0, ""), date="2026-01-01").html()
    assert "not published" in page
    for figures in PUBLISHED.values():
        for value in figures:
            assert f"{value:.2f}" in page


@pytest.mark.long
@pytest.mark.parametrize("case", ["nasa-current", "pisa-validation"])
def test_cases_run(case, tmp_path, capsys):
    words = ["reproduce", case, "--fidelity", "low", "--out", str(tmp_path), "--json"]
    assert main(words) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["status"] == "pass"
    assert "no signals were published" in values["measured"]
    assert (tmp_path / "report.html").is_file()
