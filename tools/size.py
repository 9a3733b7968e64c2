#!/usr/bin/env python3
"""How large the Python package is: `tools/size [--json] [PATH]`.

*Code lines*: lines of a file that hold a token of code; blank lines, comments and docstrings do
not count. *Public signatures with `Any`*: functions and methods that a user of the package could
call (no name on the way to them, module, class or their own, begins with an underscore; properties
and ``__init__``, ``__call__`` included) and in whose parameters or result the name ``Any`` stands,
as the file writes it.
"""

import argparse
import ast
import json
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "python" / "elevon"
#: Tokens that are no code.
EMPTY = frozenset({
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENCODING, tokenize.ENDMARKER,
})  # fmt: skip
#: Methods that are called by a form of their own: as public as their class.
CALLS = frozenset({"__init__", "__call__", "__getitem__", "__iter__", "__enter__", "__exit__"})

_Documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
_Function = ast.FunctionDef | ast.AsyncFunctionDef


def main(arguments: list[str]) -> int:
    """Print the table, or one JSON object."""
    parser = argparse.ArgumentParser(prog="tools/size", description=__doc__.splitlines()[0])
    parser.add_argument("path", nargs="?", type=Path, default=PACKAGE, help="a package's folder")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    options = parser.parse_args(arguments)
    if not options.path.is_dir():
        print(f"size: {options.path}: no folder", file=sys.stderr)
        return 2
    result = size(options.path)
    if options.json:
        print(json.dumps(result, indent=2))
        return 0
    for name, lines in sorted(result["packages"].items(), key=lambda item: -item[1]):
        print(f"{lines:7,}  {name}")
    print(f"{result['code_lines']:7,}  code lines of {result['lines']:,} in all")
    print(f"{len(result['any'])} of {result['signatures']:,} public signatures with Any")
    return 0


def size(root: Path) -> dict:
    """Return code lines by package, in all, and the public signatures with ``Any``."""
    packages: Counter[str] = Counter()
    total, signatures, with_any = 0, 0, []
    for path in sorted(root.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        parts = path.relative_to(root).with_suffix("").parts
        packages[parts[0]] += len(code_lines(text, tree))
        total += len(text.splitlines())
        if any(part.startswith("_") and part != "__init__" for part in parts):
            continue
        for name, node in public(tree):
            signatures += 1
            if names_any(node):
                with_any.append(f"{path.relative_to(root)}:{node.lineno} {name}")
    return {
        "code_lines": sum(packages.values()),
        "lines": total,
        "packages": dict(packages),
        "signatures": signatures,
        "any": with_any,
    }


def code_lines(text: str, tree: ast.Module) -> set[int]:
    """Return the numbers of the lines that hold code."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(iter(text.splitlines(keepends=True)).__next__):
        if token.type not in EMPTY:
            lines |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(tree):
        if isinstance(node, _Documented) and ast.get_docstring(node, clean=False) is not None:
            text_node = node.body[0]
            lines -= set(range(text_node.lineno, (text_node.end_lineno or 0) + 1))
    return lines


def public(node: ast.Module | ast.ClassDef, inside: str = "") -> Iterator[tuple[str, _Function]]:
    """Yield dotted name and definition of each public function and method."""
    for item in node.body:
        name = getattr(item, "name", "_")
        if name.startswith("_") and name not in CALLS:
            continue
        if isinstance(item, ast.ClassDef):
            yield from public(item, f"{inside}{name}.")
        elif isinstance(item, _Function):
            yield f"{inside}{name}", item


def names_any(node: _Function) -> bool:
    """Whether ``Any`` stands in a parameter's annotation or the result's."""
    given = node.args
    arguments = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
    notes = [item.annotation for item in arguments if item is not None]
    return any(
        isinstance(part, ast.Name) and part.id == "Any"
        for note in [*notes, node.returns]
        if note is not None
        for part in ast.walk(note)
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
