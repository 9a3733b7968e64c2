"""Which optional packages there are, and which extra of the installation brings each."""

from __future__ import annotations

#: Extra to the packages it brings, named as they are imported.
EXTRAS = {
    "files": ("h5netcdf", "h5py", "pandas", "pyarrow", "xarray"),
    "reports": ("jinja2", "markupsafe", "matplotlib"),
    "calibrate": ("scipy", "threadpoolctl", "tomlkit"),
    "cluster": ("dask", "distributed"),
    "fmu": ("fmpy",),
    "gym": ("gymnasium",),
    "learn": ("sklearn",),
    "live": ("starlette", "uvicorn", "websockets"),
    "optimise": ("pymoo",),
    "progpy": ("progpy",),
    "query": ("duckdb", "polars"),
    "sampling": ("emcee",),
}

#: Extras that ``all`` leaves out: of studies and tests alone, under another licence, for queries.
APART = frozenset({"fmu", "optimise", "progpy", "query", "sampling"})


def missing_package(error: ModuleNotFoundError) -> str | None:
    """Return what to install when an import failed for want of an extra; None for any other."""
    package = (error.name or "").partition(".")[0]
    for extra, packages in EXTRAS.items():
        if package in packages:
            more = "" if extra in APART else " (or 'elevon[all]')"
            return (
                f"this needs {package}, which is not installed: pip install 'elevon[{extra}]'{more}"
            )
    return None
