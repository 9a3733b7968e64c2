"""Which optional packages there are, and which extra of the installation brings each."""

from __future__ import annotations

__all__ = ["EXTRAS", "missing_package"]

#: Extra to the packages it brings, named as they are imported.
EXTRAS = {
    "files": ("h5netcdf", "h5py", "pandas", "pyarrow", "xarray"),
    "reports": ("jinja2", "markupsafe", "matplotlib"),
    "calibrate": ("scipy", "threadpoolctl", "tomlkit"),
    "cluster": ("dask", "distributed"),
    "gym": ("gymnasium",),
    "learn": ("sklearn",),
    "optimise": ("cma", "pymoo"),
    "progpy": ("progpy",),
    "query": ("duckdb", "polars"),
    "sampling": ("emcee",),
}


def missing_package(error: ModuleNotFoundError) -> str | None:
    """Return what to install when an import failed for want of an extra; None for any other."""
    package = (error.name or "").partition(".")[0]
    for extra, packages in EXTRAS.items():
        if package in packages:
            return (
                f"this needs {package}, which is not installed: pip install 'elevon[{extra}]' "
                "(or 'elevon[all]')"
            )
    return None
