#!/usr/bin/env python3
"""How large the Python packages are: `tools/size [--json] [PATH]`.

Without a path: the product (``python/elevon``) by package, and beside it the published cases
(``cases/elevon_cases``) and all tests. Counted are

*lines*: lines of Python code wherever it stands. In a module: lines with a token of code; blank
lines, comments and docstrings do not count. In a Jinja template (``*.j2``): lines with a part of a
tag. In a TOML file with a Jinja tag: every line but blank ones and comments, for such a file is a
program in data's clothes. In other TOML files: lines with a string that is an expression, which is
one that Python reads as a call, an ordering, a comprehension, or arithmetic with blanks round its
signs (``rad/s``, ``motor.inertia`` and ``terms[0]`` are none);
*modules*: files of Python; *classes*: class statements; *imports_share*: lines of import
statements over all lines of code in modules;
*public signatures with* ``Any``: functions and methods that a user of the package could call (no
name on the way to them, module, class or their own, begins with an underscore; properties and
``__init__``, ``__call__`` included) and in whose parameters or result the name ``Any`` stands, as
the file writes it.
"""

import argparse
import ast
import json
import re
import sys
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "python" / "elevon"
CASES = ROOT / "cases" / "elevon_cases"
TESTS = (ROOT / "tests", ROOT / "cases" / "tests")
#: Tokens that are no code.
EMPTY = frozenset({
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENCODING, tokenize.ENDMARKER,
})  # fmt: skip
#: Methods that are called by a form of their own: as public as their class.
CALLS = frozenset({"__init__", "__call__", "__getitem__", "__iter__", "__enter__", "__exit__"})
TAG = re.compile(r"\{\{.*?\}\}|\{%.*?%\}", re.S)
QUOTED = re.compile(r"""\"((?:[^"\\\n]|\\.)*)\"|'([^'\n]*)'""")
#: What makes an expression of a string; a call has no blank before its parenthesis.
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp, ast.Lambda)
ORDERINGS = (ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE)
CALL, ARITHMETIC = re.compile(r"\w\("), re.compile(r" (\*\*?|//?|[+-]) ")

_Documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
_Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class Size:
    """Size of a package, or of a part of it."""

    lines: int = 0
    in_texts: int = 0
    modules: int = 0
    classes: int = 0
    imports: int = 0
    signatures: int = 0
    any: list[str] = field(default_factory=list)

    def add(self, other: "Size") -> None:
        """Add the size of another part."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)

    def to_dict(self) -> dict[str, object]:
        """Return the figures; ``in_texts`` are those of ``lines`` in templates and TOML files."""
        in_modules = self.lines - self.in_texts
        share = round(self.imports / in_modules, 4) if in_modules else 0.0
        return {
            "lines": self.lines,
            "in_texts": self.in_texts,
            "modules": self.modules,
            "classes": self.classes,
            "imports_share": share,
        }


def main(arguments: list[str]) -> int:
    """Print the table, or one JSON object."""
    parser = argparse.ArgumentParser(prog="tools/size", description=__doc__.splitlines()[0])
    parser.add_argument("path", nargs="?", type=Path, help="a package's folder instead of ours")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    options = parser.parse_args(arguments)
    root = PACKAGE if options.path is None else options.path
    if not root.is_dir():
        print(f"size: {root}: no folder", file=sys.stderr)
        return 2
    result = size(root)
    if options.path is None:
        result["cases"] = size(CASES) if CASES.is_dir() else Size().to_dict()
        result["tests"] = _tests().to_dict()
    if options.json:
        print(json.dumps(result, indent=2))
        return 0
    _print(root.name, result)
    for name in ("cases", "tests"):
        if name in result:
            print(_row(name, result[name]))
    return 0


def size(root: Path) -> dict:
    """Return the figures of a package, in all and by its parts, and the signatures with ``Any``."""
    parts: defaultdict[str, Size] = defaultdict(Size)
    for path in sorted(root.rglob("*")):
        part = path.relative_to(root).with_suffix("").parts[:1]
        if part and (found := _size_of(path, root)) is not None:
            parts[part[0]].add(found)
    total = Size()
    for found in parts.values():
        total.add(found)
    return {
        **total.to_dict(),
        "signatures": total.signatures,
        "any": total.any,
        "packages": {name: found.to_dict() for name, found in parts.items()},
    }


def _tests() -> Size:
    total = Size()
    for root in TESTS:
        for path in sorted(root.rglob("*.py")):
            if (found := _size_of(path, root)) is not None:
                total.add(found)
    return total


def _size_of(path: Path, root: Path) -> Size | None:
    """Return the size of a file; None where it holds no code."""
    if path.suffix == ".py":
        return _module(path, root)
    if path.suffix == ".j2":
        count = len(tagged_lines(path.read_text(encoding="utf-8")))
    elif path.suffix == ".toml":
        count = evaluated_lines(path.read_text(encoding="utf-8"))
    else:
        return None
    return Size(lines=count, in_texts=count) if count else None


def _module(path: Path, root: Path) -> Size:
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    lines = code_lines(text, tree)
    result = Size(lines=len(lines), modules=1)
    imported: set[int] = set()
    for node in ast.walk(tree):
        result.classes += isinstance(node, ast.ClassDef)
        if isinstance(node, ast.Import | ast.ImportFrom):
            imported |= set(range(node.lineno, (node.end_lineno or 0) + 1))
    result.imports = len(imported & lines)
    parts = path.relative_to(root).with_suffix("").parts
    if not any(part.startswith("_") and part != "__init__" for part in parts):
        for name, node in public(tree):
            result.signatures += 1
            if names_any(node):
                result.any.append(f"{path.relative_to(root)}:{node.lineno} {name}")
    return result


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


def tagged_lines(text: str) -> set[int]:
    """Return the numbers of a template's lines that hold a part of a tag."""
    lines: set[int] = set()
    for tag in TAG.finditer(text):
        first = text.count("\n", 0, tag.start()) + 1
        lines |= set(range(first, first + tag[0].count("\n") + 1))
    return lines


def evaluated_lines(text: str) -> int:
    """Return how many lines of code a TOML file has."""
    lines = [
        line for line in text.splitlines() if line.strip() and not line.strip().startswith("#")
    ]
    if TAG.search(text):
        return len(lines)
    return sum(any(expression(a or b) for a, b in QUOTED.findall(line)) for line in lines)


def expression(text: str) -> bool:
    """Whether a string is an expression of Python, and not words, a name, a path or a unit."""
    try:
        nodes = list(ast.walk(ast.parse(text.strip(), mode="eval")))
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        return False
    if not any(isinstance(node, ast.Name) for node in nodes):
        return False
    return any(
        isinstance(node, COMPREHENSIONS)
        or (isinstance(node, ast.Call) and CALL.search(text))
        or (isinstance(node, ast.BinOp) and ARITHMETIC.search(text))
        or (isinstance(node, ast.Compare) and isinstance(node.ops[0], ORDERINGS))
        for node in nodes
    )


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


def _print(name: str, result: dict) -> None:
    print("  lines  modules  classes  imports  package")
    for part, figures in sorted(result["packages"].items(), key=lambda item: -item[1]["lines"]):
        print(_row(part, figures))
    print(_row(f"{name}, in all", result))
    print(f"{result['in_texts']:7,}  of these lines in templates and TOML files")
    print(f"{len(result['any'])} of {result['signatures']:,} public signatures with Any")


def _row(name: str, figures: dict) -> str:
    counts = f"{figures['lines']:7,}  {figures['modules']:7,}  {figures['classes']:7,}"
    return f"{counts}  {figures['imports_share']:7.1%}  {name}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
