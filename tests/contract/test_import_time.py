"""The package top stays light: no heavy library, few modules. Time is not measured, work is."""

import os
import subprocess
import sys

HEAVY = ["scipy", "pandas", "xarray", "matplotlib", "pyarrow", "pydantic", "pint", "h5py", "typer"]
#: Modules of the standard library and of the package that `import elevon` may load: 29 today.
TOP = 40
#: Modules of the package behind recordings and units, numpy's own apart: 17 today.
RECORDING = 18


def _python(code):
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, env=environment
    ).stdout


def test_import_loads_few_modules_and_no_numpy():
    code = "import sys; before = set(sys.modules); import elevon; print(*set(sys.modules) - before)"
    loaded = _python(code).split()
    assert len(loaded) < TOP, loaded
    assert "numpy" not in loaded


def test_recordings_and_units_load_no_heavy_library():
    code = (
        "import sys, elevon; elevon.Recording; "
        "from elevon.units import parse_quantity; parse_quantity('45 deg', 'rad'); "
        "print(*sys.modules)"
    )
    loaded = _python(code).split()
    assert not set(HEAVY) & {name.partition(".")[0] for name in loaded}
    modules = [name for name in loaded if name.partition(".")[0] == "elevon"]
    assert len(modules) < RECORDING, modules


def test_names_resolve_and_submodules_do_not_hide_functions_of_their_name():
    code = (
        "import importlib, elevon; importlib.import_module('elevon.simulate'); "
        "print(callable(elevon.simulate), all(hasattr(elevon, name) for name in elevon.__all__))"
    )
    assert _python(code).split() == ["True", "True"]


def test_doors_stay_doors_after_every_import():
    """A package of the same name takes no door away: calibrate, diagnose, bench, compare."""
    code = (
        "import elevon, elevon.cli, elevon.calibrate.door, elevon.bench.run, elevon.compare, "
        "elevon.diagnose.engine, elevon.response; "
        "doors = 'bench calibrate compare diagnose effects fleet monitor next_test predict "
        "read_log response validate'; "
        "print({type(getattr(elevon, name)).__name__ for name in doors.split()})"
    )
    assert _python(code).strip() == "{'function'}"
