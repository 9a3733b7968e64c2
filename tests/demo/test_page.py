"""The demonstration's page."""

from types import SimpleNamespace

from elevon.demo import page
from elevon.demo.story import Step
from elevon.report import Report


def test_the_times_say_which_steps_were_resumed():
    steps = [Step("one", 1.0), Step("two", 0.01, "kept from the interrupted run")]
    for used, columns in ((steps, 3), (steps[:1], 2)):
        report = Report("t")
        demo = SimpleNamespace(steps=used, seconds=sum(step.seconds for step in used))
        page._times_section(report, demo)
        table = report.sections[0].items[0]["table"]
        assert len(table.columns) == columns
        assert [line[0] for line in table.rows] == [*(step.name for step in used), "all"]
    assert "kept from the interrupted run" not in report.html()
