"""How the guide reads: `python tools/prose.py [PAGE ...]` prints lines, sentences and pace.

Guide pages are those of a task (docs/start, docs/how-to): at most 150 lines, below 22 words a
sentence on average, and free of the numbers of seeds, which belong to evidence. Code, tables and
headings are dropped; a sentence ends at . ! ? and at the end of a list item.
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


def measured(text: str) -> Prose:
    """Measure the text of a page."""
    sentences = [words for part in _parts(text) if (words := re.findall(r"\S*\w\S*", part))]
    seeds = tuple(match.group() for match in SEED.finditer(text))
    return Prose(text.count("\n"), len(sentences), sum(map(len, sentences)), seeds)


def _parts(text: str) -> list[str]:
    """Return the sentences: prose alone, list items apart from what follows."""
    text = re.sub(r"^(`{3,}|:{3,}).*?^\1\s*$", "\n\n", text, flags=re.M | re.S)
    lines = []
    for line in text.splitlines():
        if line.startswith(("#", "|", "    ")):
            lines.append("")
        elif re.match(r"\s*([*-]|\d+\.) ", line):
            lines += ["", re.sub(r"^\s*([*-]|\d+\.) ", "", line)]
        else:
            lines.append(line)
    prose = re.sub(r"!?\[([^]]*)\]\([^)]*\)", r"\1", "\n".join(lines))
    prose = re.sub(r"`[^`]*`", "code", prose)
    return [part for block in prose.split("\n\n") for part in re.split(r"[.!?](?=\s|$)", block)]


def main(arguments: list[str]) -> int:
    """Print a line for each page; 1 where one is beyond its limits."""
    wrong = 0
    for path in map(Path, arguments or map(str, guide_pages())):
        page = measured(path.read_text("utf-8"))
        beyond = page.lines > MOST_LINES or page.pace >= MOST_WORDS or page.seeds
        wrong += bool(beyond)
        mark = "  <- " + ", ".join(page.seeds or ["beyond its limit"]) if beyond else ""
        print(f"{path.name:24s} {page.lines:4d} {page.sentences:4d} {page.pace:5.1f}{mark}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
