"""What all tests share."""

import gc
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parents[1]

settings.register_profile(
    "elevon", deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("ci", parent=settings.get_profile("elevon"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "elevon")


# Each process of tests has a core of its own: threads that wait for each other on it only spin.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ["OMP_NUM_THREADS"] = "1"


def pytest_configure() -> None:
    """Let Ctrl-C reach what the tests start: a shell's background job would hide it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_finish() -> None:
    """Leave what was collected out of every later collection of garbage: it stays to the end."""
    gc.collect()
    gc.freeze()


def pytest_report_header() -> str:
    """Say which build is tested: that of the release, or that for work on physics."""
    from elevon import _core

    return f"extension: {_core.__file__} (lanes: {_core.widths()['auto']})"


def shared_folder() -> Path:
    """The folder of reference data: ELEVON_SHARED, or `shared` beside the repository."""
    return Path(os.environ.get("ELEVON_SHARED", ROOT.parent / "shared"))


@pytest.fixture(scope="session", autouse=True)
def quick_disk() -> Iterator[None]:
    """Do not wait for the disk at every file of every example; test_files looks at the calls."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


@pytest.fixture(scope="session")
def shared() -> Path:
    folder = shared_folder()
    if not folder.is_dir():
        pytest.skip(f"the reference data folder {folder} is absent (set ELEVON_SHARED)")
    return folder


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("shared") and not shared_folder().is_dir():
        pytest.skip(f"the reference data folder {shared_folder()} is absent (set ELEVON_SHARED)")
