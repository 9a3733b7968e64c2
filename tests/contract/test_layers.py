"""Imports point only leftwards: data flows one way, and every package has one job."""

import ast

import pytest

from tests.contract import source
from tests.contract.source import PACKAGE

# From left to right; packages in one row do not import each other. A new package is added here with
# thought: what it may know of is everything left of it, and nothing else.
ROWS = [
    ["retired", "arrays", "option", "_core"],
    ["seam"],
    ["errors", "extras"],
    ["units", "files", "progress", "memory", "data", "threads", "plain"],
    ["documents", "strict", "series", "number_text", "report", "worklog", "containers", "estimate"],
    ["transaction", "results"],
    ["recording"],
    ["parameters", "loads"],
    ["actuator", "faults", "waveforms"],
    ["scenario", "diagram"],
    ["record_plan"],
    ["features"],
    ["logs"],
    ["simulate"],
    ["experiment", "compare"],
    ["fault_sensitivity", "bench", "campaign", "calibrate", "session", "deploy"],
    ["analysis", "response", "environment"],
    ["diagnose"],
    ["nexttest", "doctor"],
    ["prognose"],
    ["doors"],
    ["demo", "live", "safety"],
    ["cli"],
    ["__main__"],
]
RANK = {package: rank for rank, row in enumerate(ROWS) for package in row}


def _package(path):
    relative = path.relative_to(PACKAGE)
    return relative.parts[0].removesuffix(".py") if len(relative.parts) > 1 else relative.stem


def _imported(path):
    """Yield the packages that a module imports at run time, also in functions."""
    for node in source.of(path).at_run_time:
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            assert node.level == 0, "imports are absolute"
            if node.module == "elevon":
                names = [f"elevon.{alias.name}" for alias in node.names]
            else:
                names = [node.module]
        for name in names:
            parts = name.split(".")
            if parts[0] == "elevon" and len(parts) > 1 and not parts[1].startswith("__"):
                yield parts[1], node.lineno


MODULES = [path for path in source.MODULES if path != PACKAGE / "__init__.py"]


def test_every_room_has_its_place():
    packages = {_package(path) for path in MODULES}
    assert "recording" in packages
    assert packages <= RANK.keys()


def test_imports_point_left():
    wrong = []
    for path in MODULES:
        package = _package(path)
        for other, line in _imported(path):
            place = f"{path.relative_to(PACKAGE)}:{line}"
            if other not in RANK:
                wrong.append(f"{place}: {other} is no package of the list")
            elif other != package and RANK[other] >= RANK.get(package, -1):
                wrong.append(f"{place}: {package} imports {other}")
    assert wrong == []


def test_the_package_knows_of_no_study_and_no_published_case():
    """`studies` and the published cases stand on the package and are not in its wheel."""
    for path in source.MODULES:
        for node in source.of(path).imports:
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            top = {name.split(".")[0] for name in names}
            assert not top & {"elevon_cases", "studies", "tests"}, path


@pytest.mark.parametrize("package", ["logs", "experiment", "estimate", "calibrate", "diagnose"])
def test_logs_are_read_without_the_bench(package):
    """A real log has no bench of ours behind it: who reads logs knows of none."""
    for path in (PACKAGE / package).rglob("*.py"):
        assert "bench" not in [other for other, _ in _imported(path)], path.relative_to(PACKAGE)


#: What runs a model: in the core, and of runs that are ready for it. Who may call it.
RUNNERS = {
    "simulate": {"simulate", "session", "experiment"},
    "sensitivities": {"simulate", "session", "experiment"},
    "Session": {"simulate", "session", "experiment"},
    "simulate_prepared": {"simulate", "experiment", "campaign"},
}


def _core_calls(module):
    """Yield what of the core, or of runs ready for it, a module calls to run a model."""
    for name, attribute in module.attributes:
        if name == "_core" and attribute in RUNNERS:
            yield attribute
    for node in module.imports:
        if isinstance(node, ast.ImportFrom):
            names = {alias.name for alias in node.names}
            if node.module == "elevon._core":
                yield from names & RUNNERS.keys()
            elif (node.module or "").startswith("elevon.simulate"):
                yield from names & {"simulate_prepared"}


def test_runs_of_the_core_are_seen():
    text = "from elevon import _core\n_core.simulate()\nfrom elevon._core import Session\n"
    assert set(_core_calls(source.parsed(text))) == {"simulate", "Session"}
    assert set(_core_calls(source.parsed("_core.faults('rotary')"))) == set()


def test_the_core_is_simulated_by_its_three_doors_only():
    wrong = [
        f"{path.relative_to(PACKAGE)}: {name}"
        for path in MODULES
        for name in _core_calls(source.of(path))
        if _package(path) not in RUNNERS[name]
    ]
    assert wrong == []


def _module_names():
    return {
        ".".join(("elevon", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
            ".__init__"
        ): path
        for path in MODULES
    }


def _imported_modules(path, modules):
    """Yield the modules of the package that a module imports, also inside functions."""
    for node in source.of(path).at_run_time:
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name in modules else node.module for name in names]
        yield from (name for name in names if name in modules)


def circles(edges):
    """Return every set of modules that reach each other (Tarjan's strong components)."""
    order, low, stack, result = {}, {}, [], []

    def visit(node):
        order[node] = low[node] = len(order)
        stack.append(node)
        for other in edges.get(node, ()):
            if other not in order:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], order[other])
        if low[node] == order[node]:
            at = stack.index(node)
            members = stack[at:]
            del stack[at:]
            if len(members) > 1 or node in edges.get(node, ()):
                result.append(sorted(members))

    for node in edges:
        if node not in order:
            visit(node)
    return result


def test_circles_are_seen():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == [["b", "c"]]
    assert circles({"a": {"b", "c"}, "b": {"c"}}) == []


def test_no_modules_import_each_other_in_a_circle():
    modules = _module_names()
    edges = {name: set(_imported_modules(path, modules)) for name, path in modules.items()}
    assert circles(edges) == []
