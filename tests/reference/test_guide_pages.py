"""The guide reads easily: length, words a sentence, no seed numbers; what its pages show runs."""

import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from evidence import BLOCK, PAGES, RUNS, filled, kept, main, run_again  # noqa: E402
from newcomer import Block, blocks_of, matches, run_page, shortened  # noqa: E402
from prose import MOST_LINES, MOST_WORDS, all_pages, guide_pages, measured  # noqa: E402


@pytest.mark.parametrize("path", guide_pages(), ids=lambda path: path.stem)
def test_a_page_of_the_guide(path):
    page = measured(path.read_text("utf-8"))
    assert page.lines <= MOST_LINES
    assert not page.seeds


@pytest.mark.parametrize("path", all_pages(), ids=lambda path: path.stem)
def test_sentences_are_short(path):
    """On every page, not those of the guide alone."""
    assert measured(path.read_text("utf-8")).pace < MOST_WORDS


@pytest.mark.parametrize("path", sorted((ROOT / "docs/explanation/theory").glob("*.md")), ids=str)
def test_a_theory_page_names_its_sources(path):
    """As links, which `test_links_and_pictures_are_there` follows."""
    assert re.search(r"\]\((\.\./)+crates/elevon-core/src/\S+\.rs\)", path.read_text("utf-8"))


HOW_TO = [path for path in guide_pages() if path.parent.name == "how-to" and path.stem != "index"]


@pytest.mark.parametrize("path", HOW_TO, ids=lambda path: path.stem)
def test_a_page_of_a_task_has_the_form(path):
    """Task, command, how to read its answer, and at least three limits."""
    text = path.read_text("utf-8")
    assert re.search(r"^Task: ", text, re.M)
    assert re.search(r"^```(sh|console|python|toml|matlab)$", text, re.M)
    assert re.search(r"^##+ How to read it$", text, re.M)
    limits = text.partition("\n## Limits\n")[2].partition("\n## ")[0]
    assert len(re.findall(r"^[*-] ", limits, re.M)) >= 3


def test_the_readme_is_short():
    text = (ROOT / "README.md").read_text("utf-8")
    assert text.count("\n") <= 120
    assert measured(text).pace < MOST_WORDS


def test_what_is_measured():
    text = (
        "# A heading of many words\n\nOne two three. Four 0.5 five!\n\n* an item\n"
        "* another [link](x.md)\n\n| a table | of words |\n\n```sh\nelevon --seed 3\n```\n"
    )
    page = measured(text)
    assert (page.sentences, page.words) == (4, 3 + 3 + 2 + 2)
    assert page.seeds == ("--seed 3",)


def test_a_table_and_a_paragraph_end_no_sentence():
    """What goes on behind them is the same sentence; what is indented below an item is of it."""
    page = measured("As here:\n\n| a |\n|---|\n\nand on. So\n\n    code\n\nis it.\n")
    assert (page.sentences, page.words) == (2, 2 + 2 + 1 + 2)
    assert measured("* an item\n    of two lines\n").words == 2 + 3


def test_a_page_that_prints_something_else_is_found(tmp_path):
    """Wrong output, wrong exit codes: neither passes; what varies is left out."""
    (block,) = blocks_of("```sh\necho a 1.5 s\n```\n\n```text\na ... s\n...\n```\n")
    assert block.expected == "a ... s\n...\n"
    block.printed = "a 1.5 s\nmore\n"
    assert matches(block)
    block.printed = "b 1.5 s\n"
    assert not matches(block)
    assert shortened(Block("sh", "", "", printed="x" * 200)).endswith("x...\n")


@pytest.mark.parametrize(("body", "wrong"), [("echo one\n", 0), ("echo two\n", 1), ("false\n", 1)])
def test_blocks_are_run(body, wrong, tmp_path, monkeypatch):
    monkeypatch.setattr("newcomer.ROOT", tmp_path)
    (tmp_path / "examples").mkdir()
    page = tmp_path / "page.md"
    page.write_text(f"```sh\n{body}```\n\n```text\none\n```\n", "utf-8")
    assert run_page(page, Path(sys.executable).parent) == wrong


@pytest.mark.parametrize("path", sorted(PAGES.glob("*.md")), ids=lambda path: path.stem)
def test_a_page_shows_its_records_as_they_are_kept(path):
    """`python tools/evidence.py --pages` writes them."""
    text = path.read_text("utf-8")
    assert filled(text) == text
    assert len(BLOCK.findall(text)) == text.count("<!-- end -->")


def test_what_a_command_printed_becomes_a_record_and_a_block(tmp_path, monkeypatch):
    monkeypatch.setattr("evidence.RUNS", tmp_path)
    monkeypatch.setattr("evidence.PAGES", tmp_path)
    check = {"name": "a share", "value": 0.5, "limit": 0.8, "unit": "", "at_least": True}
    printed = tmp_path / "printed.json"
    printed.write_text(json.dumps({"checks": [{**check, "passed": False}]}), "utf-8")
    (tmp_path / "a.md").write_text("<!-- run mine -->\n<!-- end -->\n", "utf-8")
    assert main(["mine", "--command", "python -m studies x", "--printed", str(printed)]) == 0
    text = (tmp_path / "a.md").read_text("utf-8")
    assert "`python -m studies x`" in text
    assert "* not met: a share: 0.5 (at least 0.8)" in text
    (tmp_path / "mine.json").write_text(json.dumps({**kept("mine"), "checks": []}), "utf-8")
    assert filled(text) != text


#: Judged studies take hours: their records are of one run; those of real machines need the data.
AGAIN = [
    path
    for path in sorted(RUNS.glob("*.json"))
    if "elevon reproduce" in (text := path.read_text("utf-8")) and "--data FOLDER" not in text
]


@pytest.mark.long
@pytest.mark.parametrize("path", AGAIN, ids=lambda path: path.stem)
def test_evidence_is_what_its_command_writes(path):
    assert run_again(path.stem)


@pytest.mark.long
@pytest.mark.parametrize("path", [ROOT / "README.md", *guide_pages()], ids=lambda path: path.stem)
def test_the_newcomer(path):
    """Each block runs in a fresh folder and home, and prints what the page shows."""
    assert run_page(path, Path(sys.executable).parent) == 0
