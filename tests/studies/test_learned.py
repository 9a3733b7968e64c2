"""The study of classes learnt from logs of another program: its counts; one small run of it."""

import pytest

from elevon.errors import InputError
from studies.learned import LearnedResult, study_learned

LEFT = {"logs": 10, "right": 8, "healthy": 4, "false_alarms": 1, "faulty": 6, "missed": 2}


def test_counts_are_those_of_the_answers():
    report = {"classifier": "boosting", "classes": {"healthy": 4}, "left_out": {"unit": LEFT}}
    seen = (
        ("healthy", "healthy", ""), ("healthy", "unknown_fault", ""), ("a@b", "faulty", "a@b"),
        ("a@b", "faulty", "c@d"), ("word", "faulty", "word"), ("word", "healthy", ""),
    )  # fmt: skip
    result = LearnedResult(report | {"logs": 10}, seen, 4, 1)
    found = {row["what"]: (row["hits"], row["logs"]) for row in result.rows}
    assert found["refused as of another motion"] == (4, 20)
    assert found["unit left out: class right"] == (8, 10)
    assert found["unit left out: false alarms"] == (1, 4)
    assert found["other units: false alarms"] == (1, 2)
    assert found["other units: class right"] == (2, 4)
    assert found["other units: missed"] == (1, 4)
    assert result.to_dict()["status"] == "pass"
    with pytest.raises(InputError, match="at least eight"):
        study_learned(units=4)


@pytest.mark.long
def test_classes_of_another_program_are_learnt():
    result = study_learned(seed=2821, units=8, processes=1)
    assert len(result.seen) + result.report["logs"] + result.refused == 8 * 13
    assert result.report["left_out"]["unit"]["right"] > 0.3 * result.report["logs"]
