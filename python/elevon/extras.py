"""Which optional packages there are, and which extra of the installation brings each."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType

#: Extra to the packages it brings, named as they are imported.
EXTRAS = {
    "files": ("h5netcdf", "h5py", "pandas", "pyarrow", "xarray"),
    "reports": ("jinja2", "markupsafe", "matplotlib"),
    "calibrate": ("scipy", "threadpoolctl", "tomlkit"),
    "cluster": ("dask", "distributed"),
    "fmu": ("fmpy",),
    "gym": ("gymnasium",),
    "learn": ("sklearn",),
    "lives": ("lifelines",),
    "live": ("starlette", "uvicorn", "websockets"),
    "measurements": ("asammdf", "mcap", "mcap_ros2", "nptdms"),
    "optimise": ("pymoo",),
    "progpy": ("progpy",),
    "query": ("duckdb", "polars"),
    "sampling": ("emcee",),
}

#: Extras that ``all`` leaves out: of studies and tests, other licences, other tools, for queries.
APART = frozenset({"fmu", "lives", "measurements", "optimise", "progpy", "query", "sampling"})


def missing_package(error: ModuleNotFoundError) -> str | None:
    """Return what to install when an import failed for want of an extra; None for any other."""
    package = (error.name or "").partition(".")[0]
    for extra, packages in EXTRAS.items():
        if package in packages:
            return _message(package, extra)
    return None


def _message(package: str, extra: str) -> str:
    more = "" if extra in APART else " ([all] in its place brings every usual one)"
    return (
        f"this needs {package}, of the extra elevon[{extra}], which is not installed: "
        f"{install_command(extra)}{more}"
    )


def install_command(extra: str) -> str:
    """Return the command that installs an extra from where this copy came.

    A wheel or a folder from which pip installed it is named again, since an index may have no
    Elevon, or another one.
    """
    import json
    from importlib.metadata import PackageNotFoundError, distribution
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    try:
        origin = json.loads(distribution("elevon").read_text("direct_url.json") or "{}")
    except (PackageNotFoundError, ValueError):
        origin = {}
    url = str(origin.get("url", ""))
    if origin.get("dir_info", {}).get("editable"):
        return f"pip install --editable '{url2pathname(urlsplit(url).path)}[{extra}]'"
    return f"pip install 'elevon[{extra}] @ {url}'" if url else f"pip install 'elevon[{extra}]'"


class MissingExtras:
    """The last finder: a package of an extra that no other found, imported by Elevon itself."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:  # noqa: ARG002
        """Raise what to install; None for a package that somebody else imports.

        Raises
        ------
        ModuleNotFoundError
            With the command that installs the extra.
        """
        extra = next((extra for extra, packages in EXTRAS.items() if name in packages), None)
        frame: FrameType | None = sys._getframe(1)
        while frame is not None and "importlib" in frame.f_code.co_filename:
            if frame.f_globals.get("__name__") == "importlib.util":
                return  # who asks whether a package is there gets no error
            frame = frame.f_back
        if extra and frame and str(frame.f_globals.get("__name__", "")).startswith("elevon."):
            raise ModuleNotFoundError(_message(name, extra), name=name)
