"""The demonstration's page."""

from elevon.demo.page import times_section
from elevon.demo.story import Story
from elevon.report import Report


def test_the_times_say_which_steps_were_resumed(tmp_path):
    story = Story(tmp_path, "a")
    story.begin()
    story.timed("one", lambda: None)
    story.resumable("two", "piece", float, lambda: 1.5)
    again = Story(tmp_path, "a")
    assert again.resumes
    assert again.resumable("two", "piece", float, lambda: 2.5) == 1.5
    for used, kept in ((story, False), (again, True)):
        report = Report("t")
        times_section(report, used)
        table = report.sections[0].items[0]["table"]
        assert [line[0] for line in table.rows] == [*(step.name for step in used.steps), "all"]
        assert ("kept from the interrupted run" in report.html()) is kept
