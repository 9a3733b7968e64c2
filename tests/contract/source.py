"""What the contract tests ask of each module: its text is parsed and walked once."""

import ast
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "python" / "elevon"
MODULES = sorted(PACKAGE.rglob("*.py"))


@dataclass(frozen=True)
class Source:
    """Imports (with those for annotations only apart), attributes of names, names given, classes.

    Attributes
    ----------
    imports : list of ast.Import or ast.ImportFrom
        Also inside functions.
    annotations : list of ast.Import or ast.ImportFrom
        Those of `imports` that a type checker sees only.
    attributes : list of (str, str)
        ``name.attribute``.
    names : list of (str, int)
        Variables, arguments, functions and classes with their lines.
    classes : list of (str, int)
        Public classes of the module with their lines.
    """

    imports: list[ast.Import | ast.ImportFrom] = field(default_factory=list)
    annotations: list[ast.Import | ast.ImportFrom] = field(default_factory=list)
    attributes: list[tuple[str, str]] = field(default_factory=list)
    names: list[tuple[str, int]] = field(default_factory=list)
    classes: list[tuple[str, int]] = field(default_factory=list)

    @property
    def at_run_time(self):
        """Imports that a run of the module makes."""
        return [node for node in self.imports if node not in self.annotations]


def parsed(text: str) -> Source:
    """Walk a text."""
    source, tree = Source(), ast.parse(text)
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            source.classes.append((node.name, node.lineno))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            source.imports.append(node)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            inner = (one for part in node.body for one in ast.walk(part))
            source.annotations.extend(
                one for one in inner if isinstance(one, ast.Import | ast.ImportFrom)
            )
        elif isinstance(node, ast.Name | ast.Attribute):
            _named(node, source)
        elif isinstance(node, ast.arg):
            source.names.append((node.arg, node.lineno))
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            source.names.append((node.name, node.lineno))
    return source


def _named(node: ast.Name | ast.Attribute, source: Source) -> None:
    if isinstance(node.ctx, ast.Store):
        name = node.id if isinstance(node, ast.Name) else node.attr
        source.names.append((name, node.lineno))
    elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        source.attributes.append((node.value.id, node.attr))


@cache
def of(path: Path) -> Source:
    """Read a module of the package."""
    return parsed(path.read_text(encoding="utf-8"))
