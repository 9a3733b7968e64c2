"""Retired words: `python tools/words.py [PATH ...]` lists each place that still uses one.

One name for each thing. The words below were replaced by the field's own; they may stand in the
CHANGELOG, in the mapping that reads old files, and in quotations of the papers (lines that bear
the mark ``quoted:``). Identifiers are nouns or verbs of the domain, not bare participles.
"""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

#: What may not stand in code, docs and messages, and what to write instead.
RETIRED = {
    r"(?<![A-Za-z])plays?(?![A-Za-z])": "backlash",
    r"(?<![A-Za-z])user_(?:position|speed|torque|inertia|side|stop|dry)": "output_...",
    r"\buser[ -]side\b": "output side",
    r"\bfast[ _-]shaft\b": "motor shaft",
    r"\bgiv(?:es?|ing) way\b": "compliance, deflection",
    r"\bst(?:ands?|ood) off\b": "deviates by",
    r"\bnot to be told from\b": "ambiguous with",
    r"(?<![A-Za-z])akin(?![A-Za-z])": "ambiguous with",
    r"(?<![A-Za-z])weighed(?![A-Za-z])": "candidate",
    r"(?<![A-Za-z])declined(?![A-Za-z])": "not modelled",
    r"(?<![A-Za-z])foreseen(?![A-Za-z])": "predicted",
    r"(?<![A-Za-z])dragged(?![A-Za-z])": "frictional load, free",
    r"(?<![A-Za-z])winding_(?:short|open)(?![A-Za-z])": "resolver_short, resolver_open",
}

#: Identifiers that name nothing.
BARE = frozenset({
    "akin", "asked", "beside", "doubt", "foreseen", "held", "own", "proofs", "rest", "said",
    "shown", "still", "sure", "told", "weighed",
})  # fmt: skip

#: Where retired words are the subject.
EXEMPT = (
    "CHANGELOG.md",
    "tools/words.py",
    "python/elevon/retired.py",
    "python/elevon/retired.toml",
    "tests/test_retired.py",
)
_TEXT = (".py", ".pyi", ".rs", ".md", ".toml", ".html", ".j2", ".sh", ".c", ".ipynb", ".yml")


def main(arguments: list[str]) -> int:
    """Print each place as ``file:line: word: what to write``; 1 where there is any."""
    tokens = [(re.compile(pattern, re.IGNORECASE), better) for pattern, better in RETIRED.items()]
    found = 0
    for path in _files(arguments):
        text = path.read_text(encoding="utf-8")
        places = [*_words(text, tokens), *(_identifiers(text) if path.suffix == ".py" else [])]
        for line, word, better in sorted(places):
            print(f"{path}:{line}: {word}: {better}")
        found += len(places)
    if found:
        print(f"{found} retired word(s)", file=sys.stderr)
    return 1 if found else 0


def _files(arguments: list[str]) -> Iterator[Path]:
    """Yield the tracked text files below the paths given, or all of them."""
    listed = subprocess.run(
        ["git", "ls-files", *arguments],  # noqa: S607
        capture_output=True,
        text=True,
        check=True,
    )
    for name in listed.stdout.splitlines():
        path = Path(name)
        text = path.suffix in _TEXT and "vendor" not in path.parts
        if text and name not in EXEMPT and path.is_file():
            yield path


def _words(text: str, tokens: list[tuple[re.Pattern[str], str]]) -> Iterator[tuple[int, str, str]]:
    for number, line in enumerate(text.splitlines(), 1):
        if "quoted:" in line:
            continue
        for pattern, better in tokens:
            for match in pattern.finditer(line):
                yield number, match.group(), better


def _identifiers(text: str) -> Iterator[tuple[int, str, str]]:
    """Yield definitions, arguments and variables whose whole name is a bare participle."""
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.arg(arg=name):
                pass
            case ast.Name(id=name, ctx=ast.Store()):
                pass
            case ast.AnnAssign(target=ast.Name(id=name)):
                pass
            case _:
                continue
        if name.strip("_").lower() in BARE:
            yield node.lineno, name, "a noun or verb of the domain"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
