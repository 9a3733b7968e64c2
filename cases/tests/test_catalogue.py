"""Every table and figure has a command or a reason; every case, check and command is declared."""

import json

import pytest
import typer

from elevon.cli import main
from elevon.cli.runner import app
from elevon.errors import InputError, OutputExistsError
from elevon.report.checks import Check
from elevon_cases import everything
from elevon_cases.cases import CASES
from elevon_cases.catalogue import Judgement, Published, published, works
from elevon_cases.everything import CaseRun, reproduce_everything, rows_of

#: Cases that recompute nothing that a work prints.
UNPUBLISHED = {"signatures"}
ITEMS = [(work.name, item) for work in works() for item in work.items]


def test_every_item_has_a_command_or_a_reason():
    assert [(work, i.name) for work, i in ITEMS if not i.commands and not i.why] == []
    assert len({(work, i.name) for work, i in ITEMS}) == len(ITEMS)


def test_every_case_of_a_work_is_declared_and_covers_what_there_is():
    assert set(published()) == {case.name for case in CASES} - UNPUBLISHED
    known = {(work, item.name) for work, item in ITEMS}
    for record in published().values():
        for work, names in record.covers.items():
            assert {(work, name) for name in names} <= known, record.name
        for judged in record.checks:
            work, _, name = judged.item.partition(" ")
            assert name.startswith("Section") or (work, name) in known, judged


def test_every_named_command_exists():
    commands = {command for _, item in ITEMS for command in item.commands}
    group = typer.main.get_command(app)
    for command in commands:
        words = command.split()[1:]
        found = group
        while hasattr(found, "list_commands"):
            found = found.get_command(typer.Context(found), words.pop(0))
            assert found is not None, command
        found.make_context("x", words)


def test_options_of_a_record_are_the_commands_own():
    cases = {case.name: case for case in CASES}
    for record in published().values():
        assert set(record.options) <= set(cases[record.name].signature()), record.name


def run_of(record, checks, calls=None):
    def work(folder, progress):
        if calls is not None:
            calls.append(record.name)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "report.html").write_text("page")
        return {"checks": [check.to_dict() for check in checks]}

    return CaseRun(record, work)


SOURCE = {"kind": "source", "basis": "nasa Figure 9"}
RECORD = Published(
    "one",
    {},
    (Judgement("a *", item="nasa Figure 9", theirs="0.84 K", definition="error", **SOURCE),),
)


def test_a_row_has_both_numbers_its_verdict_and_why():
    rows = rows_of(RECORD, [Check("a b", 0.1, 0.05, "K", ours=0.94), Check("a c", 0.1, 0.84, "K")])
    assert (rows[0].paper, rows[0].item, rows[0].ours, rows[0].unit, rows[0].theirs) == (
        "nasa", "Figure 9", 0.94, "K", "0.84 K")  # fmt: skip
    why = "0.1 is above 0.05 K: no reason is known"
    assert (rows[0].verdict, rows[0].reason) == ("fail", why)
    assert (rows[1].verdict, rows[1].ours, rows[1].reason) == ("pass", 0.1, "")


def test_our_number_has_its_own_unit():
    checks = [Check("a b", 0.1, 0.5, "1", ours=3.0, ours_unit="1/s"), Check("a c", 0.1, 0.5, "1")]
    assert [row.unit for row in rows_of(RECORD, checks)] == ["1/s", ""]


def test_a_check_that_was_not_made_is_not_run():
    assert [row.verdict for row in rows_of(RECORD, [])] == ["not_run"]


def test_a_case_that_raises_fails_and_the_others_go_on(tmp_path):
    def broken(folder, progress):
        raise InputError("no such folder")

    cases = [CaseRun(RECORD, broken), run_of(Published("two", {}, RECORD.checks), [])]
    result = reproduce_everything(cases, tmp_path, seed=0, key="k")
    first = result.rows[0]
    assert (first.verdict, first.reason) == ("fail", "no such folder")
    assert result.status == "fail"


def test_what_has_no_data_is_not_run_and_no_failure(tmp_path):
    good = run_of(Published("two", {}, RECORD.checks), [Check("a b", 0.1, 0.84, "K")])
    absent = CaseRun(RECORD, good.work, "data absent: give --data")
    result = reproduce_everything([absent, good], tmp_path, seed=0, key="k")
    assert [row.verdict for row in result.rows] == ["not_run", "pass"]
    assert result.status == "not_run"  # neither a failure nor a pass
    counts = {"source": {"pass": 1, "fail": 0, "not_run": 1}}
    assert result.counts() == counts
    assert json.loads((tmp_path / "index.json").read_text())["counts"] == counts


def test_ourselves_are_neither_counted_with_a_work_nor_beside_its_number(tmp_path):
    apart = Judgement("b", "self_consistency", "nasa Figure 9", "", "ours")
    record = Published("one", {}, (*RECORD.checks, apart))
    case = run_of(record, [Check("a b", 0.1, 0.3, "K"), Check("b", 0.1, 0.5, "K")])
    result = reproduce_everything([case], tmp_path, seed=0, key="k")
    one = {"pass": 1, "fail": 0, "not_run": 0}
    assert result.counts() == {"source": one, "self_consistency": one}
    page = (tmp_path / "index.html").read_text()
    assert page.index("0.84 K") < page.index("<h2>Self-consistency")
    assert "0.84 K" not in page[page.index("<h2>Self-consistency") :].split("</table>")[0]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"kind": "sourc", "basis": "x"}, "source"),
        ({"kind": "source"}, "takes a 'basis'"),
        ({"kind": "self_consistency", "theirs": "7.12 %"}, "neither 'basis' nor 'theirs'"),
        ({"kind": "self_consistency", "basis": "x"}, "neither 'basis' nor 'theirs'"),
    ],
)
def test_a_check_says_what_it_is_held_against(wrong, message):
    with pytest.raises(InputError, match=message):
        Judgement("a", **{"item": "nasa Figure 9", "theirs": "", "definition": "", **wrong})


def test_one_case_without_its_data_is_refused(tmp_path, capsys):
    words = ["reproduce", "--all", "--only", "cranfield", "--out", str(tmp_path)]
    assert main(words) == 2
    assert "--data" in capsys.readouterr().err
    assert main(["reproduce", "cranfield"]) == 2


def test_the_page_shows_failures_open_and_a_case_that_was_not_run_once(tmp_path):
    checks = [Check(f"a {n}", n, 0.5, "K") for n in (0.1, 0.2, 0.9)]
    judged = (
        Judgement("a *", item="nasa Figure 9", theirs="", definition="error", **SOURCE),
        Judgement("b", item="nasa Figure 9", theirs="", definition="", **SOURCE),
    )
    absent = CaseRun(Published("two", {}, (*judged, judged[1])), dict, "no data here")
    reproduce_everything([run_of(RECORD, checks), absent], tmp_path, seed=0, key="k")
    page = (tmp_path / "index.html").read_text()
    failed = page.split("<h2>Checks that fail</h2>")[1].split("<h2>")[0]
    assert "0.9 is above 0.5 K: no reason is known" in failed
    assert "<details>" not in failed
    other = page.split("<h2>Checks that were not run</h2>")[1].split("<h2>")[0]
    assert other.count("no data here") == 1
    assert page.count(">error<") == 2  # once for the three checks that share it, once for the other


def test_it_goes_on_after_an_interruption_and_runs_nothing_twice(tmp_path):
    calls = []
    first = run_of(RECORD, [Check("a b", float("nan"), 0.84, "K")], calls)

    def stopped(folder, progress):
        raise KeyboardInterrupt

    second = Published("two", {}, RECORD.checks)
    with pytest.raises(KeyboardInterrupt):
        reproduce_everything([first, CaseRun(second, stopped)], tmp_path, seed=0, key="k")
    assert not (tmp_path / "index.json").exists()
    result = reproduce_everything([first, run_of(second, [], calls)], tmp_path, seed=0, key="k")
    assert calls == ["one", "two"]
    assert result.rows[0].verdict == "fail"  # the value that is no number stayed none
    index = json.loads((tmp_path / "index.json").read_text())
    assert [row["link"] for row in index["rows"]] == ["one/report.html", "two/report.html"]
    assert index["counts"] == {"source": {"pass": 0, "fail": 1, "not_run": 1}}
    assert 'href="one/report.html"' in (tmp_path / "index.html").read_text()


def test_another_package_goes_on_with_nothing(tmp_path, monkeypatch):
    calls = []
    case = run_of(RECORD, [Check("a b", 0.1, 0.84, "K")], calls)
    reproduce_everything([case], tmp_path, seed=0, key="k")
    monkeypatch.setattr(everything, "package_digest", lambda: "another")
    with pytest.raises(OutputExistsError):
        reproduce_everything([case], tmp_path, seed=0, key="k")
    reproduce_everything([case], tmp_path, seed=0, key="k", force=True)
    assert calls == ["one", "one"]


def test_the_index_of_other_work_is_not_replaced(tmp_path, capsys):
    (tmp_path / "index.json").write_text("mine")
    words = ["reproduce", "--all", "--only", "torino-compliance", "--out", str(tmp_path)]
    assert main(words) == 2
    assert "--force" in capsys.readouterr().err
    assert (tmp_path / "index.json").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--all"], "--out DIR"),
        (["--all", "torino-compliance"], "leave out"),
        (["--json", "torino-compliance"], "behind its name"),
        (["--all", "--only", "torino-complianc", "--out", "x"], "torino-compliance"),
    ],
)
def test_wrong_use_is_named(words, message, capsys):
    assert main(["reproduce", *words]) == 2
    assert message in capsys.readouterr().err
