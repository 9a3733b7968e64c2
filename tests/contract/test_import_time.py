"""The package top stays light: no heavy library, and quick to import."""

import os
import subprocess
import sys

HEAVY = ["scipy", "pandas", "xarray", "matplotlib", "pyarrow", "pydantic", "pint", "h5py", "typer"]
LIMIT = 0.4


def _python(code):
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, env=environment
    ).stdout


def test_import_is_quick():
    code = "import time; a = time.perf_counter(); import elevon; print(time.perf_counter() - a)"
    assert min(float(_python(code)) for _ in range(3)) < LIMIT


def test_import_of_the_recording_and_units_is_quick():
    code = (
        "import time; a = time.perf_counter(); import elevon; elevon.Recording; "
        "from elevon.units import parse_quantity; parse_quantity('45 deg', 'rad'); "
        "print(time.perf_counter() - a)"
    )
    assert min(float(_python(code)) for _ in range(3)) < LIMIT


def test_import_loads_no_heavy_library():
    code = "import sys, elevon; elevon.Recording; print(*{n.split('.')[0] for n in sys.modules})"
    assert not set(HEAVY) & set(_python(code).split())


def test_submodules_do_not_hide_functions_of_their_name():
    code = (
        "import importlib, elevon; importlib.import_module('elevon.simulate'); "
        "print(callable(elevon.simulate))"
    )
    assert _python(code).strip() == "True"


def test_every_public_name_resolves():
    code = "import elevon; print(all(hasattr(elevon, name) for name in elevon.__all__))"
    assert _python(code).strip() == "True"
