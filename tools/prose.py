"""How the pages read: `python tools/prose.py [PAGE ...]` prints lines, sentences and pace.

Every page of docs/ has below 22 words a sentence on average. Code blocks, tables and headings are
dropped; a sentence ends at . ! ? and at the end of a list item, and nowhere else, so one that goes
on behind a table is one. What blanks separate is a word, in formulas too. Pages of the guide
(docs/start, docs/how-to) have at most 150 lines and no numbers of seeds, which belong to evidence.
"""

import re
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("start", "how-to")
MOST_LINES = 150
MOST_WORDS = 22.0
SEED = re.compile(r"\bseeds?\b[\s=:`]*(?:of |is )?\d|--seed[ =]\d", re.IGNORECASE)


@dataclass(frozen=True)
class Prose:
    """What is measured of a page."""

    lines: int
    sentences: int
    words: int
    seeds: tuple[str, ...]

    @property
    def pace(self) -> float:
        """Words a sentence."""
        return self.words / max(self.sentences, 1)


def guide_pages() -> list[Path]:
    """Return the pages of the guide, in their order."""
    return sorted(path for name in FOLDERS for path in (ROOT / "docs" / name).glob("*.md"))


def all_pages() -> list[Path]:
    """Return every page of the documentation, in their order."""
    return sorted((ROOT / "docs").rglob("*.md"))


def measured(text: str) -> Prose:
    """Measure the text of a page."""
    sentences = [words for part in _parts(text) if (words := part.split())]
    seeds = tuple(match.group() for match in SEED.finditer(text))
    return Prose(text.count("\n"), len(sentences), sum(map(len, sentences)), seeds)


def _parts(text: str) -> list[str]:
    """Return the sentences: prose alone, list items apart from what follows."""
    text = re.sub(r"^(`{3,}|:{3,}).*?^\1\s*$", "", text, flags=re.M | re.S)
    items, before = [""], ""
    for line in text.splitlines():
        code = line.startswith("    ") and (not before.strip() or before.startswith("    "))
        if item := re.match(r"\s*([*-]|\d+\.) ", line):
            items.append(line[item.end() :])
        elif not code and not line.startswith(("#", "|")):
            items[-1] += f"\n{line}"
        before = line
    prose = [re.sub(r"!?\[([^]]*)\]\([^)]*\)", r"\1", item) for item in items]
    return [part for item in prose for part in re.split(r"[.!?](?=\s|$)", item)]


def main(arguments: list[str]) -> int:
    """Print a line for each page; 1 where one is beyond its limits."""
    wrong, guide = 0, guide_pages()
    for path in map(Path, arguments or all_pages()):
        page = measured(path.read_text("utf-8"))
        beyond = ["too many words a sentence"] if page.pace >= MOST_WORDS else []
        if path.resolve() in guide:
            beyond += [*page.seeds, *(["too many lines"] if page.lines > MOST_LINES else [])]
        wrong += bool(beyond)
        mark = f"  <- {', '.join(beyond)}" if beyond else ""
        print(f"{path.stem:24s} {page.lines:4d} {page.sentences:4d} {page.pace:5.1f}{mark}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
