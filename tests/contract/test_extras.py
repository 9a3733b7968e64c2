"""The core needs four packages; every other one belongs to an extra that the messages name."""

import ast
import re
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from elevon import Recording
from elevon.cli import main
from elevon.errors import FormatError
from elevon.extras import APART, EXTRAS, install_command, missing_package
from tests.contract import source

ROOT = Path(__file__).resolve().parents[2]
CORE = {"numpy", "pydantic", "rich", "typer", "elevon"}
IMPORTED_AS = {"mcap-ros2-support": "mcap_ros2", "scikit-learn": "sklearn"}
BROUGHT = {
    "cycler": "matplotlib",
    "dask": "distributed",
    "markupsafe": "jinja2",
    "pydantic_core": "pydantic",
}


def _project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def _name(requirement):
    name = re.split(r"[<>=\[; ]", requirement)[0]
    return IMPORTED_AS.get(name, name)


def _imports(path):
    """Packages a module imports when it runs; those of annotations only do not count."""
    for node in source.of(path).at_run_time:
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif node.module and node.level == 0:
            yield node.module.split(".")[0]


def test_every_import_is_of_the_core_or_of_an_extra():
    known = CORE | {package for packages in EXTRAS.values() for package in packages}
    known |= set(sys.stdlib_module_names) | set(BROUGHT)
    for path in source.MODULES:
        assert set(_imports(path)) <= known, path


def test_the_core_is_four_packages_and_the_table_is_that_of_the_project():
    project = _project()
    assert {_name(item) for item in project["dependencies"]} == CORE - {"elevon"}
    optional = project["optional-dependencies"]
    for extra, packages in EXTRAS.items():
        brought = {_name(item) for item in optional[extra]}
        for package in packages:
            assert {package, BROUGHT.get(package)} & brought, (extra, package)
    (everything,) = optional["all"]
    assert set(re.findall(r"\w+", everything)) - {"elevon"} == set(EXTRAS) - APART


@pytest.mark.parametrize("extra", EXTRAS)
def test_a_missing_package_names_its_extra(extra):
    for package in EXTRAS[extra]:
        error = ModuleNotFoundError("none", name=f"{package}.sub")
        assert f"elevon[{extra}]" in missing_package(error)
    assert missing_package(ModuleNotFoundError("none", name="elevon.simulat")) is None


def test_a_command_whose_extra_is_missing_says_which(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for name in [name for name in sys.modules if name.startswith("matplotlib.")]:
        monkeypatch.delitem(sys.modules, name)
    out = ["--plot", str(tmp_path / "a.png")]
    assert main(["simulate", "torino-rotary", "--duration", "0.01", *out]) == 2
    streams = capsys.readouterr()
    assert "elevon[reports]" in streams.err
    assert install_command("reports") in streams.err
    assert streams.out == ""


@pytest.mark.parametrize(
    ("origin", "command"),
    [
        ("", "pip install 'elevon[files]'"),
        (
            '{"url": "file:///a/elevon-1.whl"}',
            "pip install 'elevon[files] @ file:///a/elevon-1.whl'",
        ),
        (
            '{"url": "file:///a/b", "dir_info": {"editable": true}}',
            "pip install --editable '/a/b[files]'",
        ),
    ],
)
def test_the_command_installs_from_where_this_copy_came(origin, command, monkeypatch):
    copy = SimpleNamespace(read_text=lambda _: origin or None)
    monkeypatch.setattr("importlib.metadata.distribution", lambda _: copy)
    assert install_command("files") == command


def test_an_import_of_elevon_that_lacks_an_extra_says_so_in_python_too(monkeypatch):
    """A package that no finder knows; somebody else's import and a mere question are not ours."""
    monkeypatch.setitem(EXTRAS, "files", (*EXTRAS["files"], "no_such_package"))
    with pytest.raises(ModuleNotFoundError, match=r"elevon\[files\], which is not installed: pip"):
        exec("import no_such_package", {"__name__": "elevon.recording.recording"})
    with pytest.raises(ModuleNotFoundError, match="No module named"):
        exec("import no_such_package", {"__name__": "pandas.io"})
    question = "import importlib.util as u; found = u.find_spec('no_such_package')"
    names = {"__name__": "elevon.recording.csv"}
    exec(question, names)
    assert names["found"] is None


def _recording():
    time = np.arange(50) / 100
    values = {"output_position": np.sin(time) / 3.0, "force": np.where(time > 0.2, np.nan, 1e300)}
    return Recording.build(time, values, {"output_position": "rad", "force": "N"})


@pytest.mark.parametrize("writes", [True, False])
@pytest.mark.parametrize("reads", [True, False])
def test_csv_needs_no_package(writes, reads, tmp_path, monkeypatch):
    """Written and read with or without pyarrow: the same bits."""
    import elevon.recording.csv as module

    recording, path = _recording(), tmp_path / "a.csv"
    monkeypatch.setattr(module, "find_spec", lambda _: writes or None)
    recording.save(path)
    monkeypatch.setattr(module, "find_spec", lambda _: reads or None)
    assert Recording.load(path).equals(recording)


@pytest.mark.parametrize(("row", "message"), [("1,2", "columns"), ("0.5,x,1", "x")])
def test_a_wrong_csv_is_refused_without_pyarrow(row, message, tmp_path, monkeypatch):
    import elevon.recording.csv as module

    monkeypatch.setattr(module, "find_spec", lambda _: None)
    path = tmp_path / "a.csv"
    path.write_text(f"time [s],a [N],b [N]\n0,1,2\n{row}\n")
    with pytest.raises(FormatError, match=message):
        Recording.load(path)
