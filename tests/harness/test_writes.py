"""Whatever cuts a command short, the folder is the old one or the new one, or can be repaired.

Every command that writes, found from the program itself, is killed at each system call that
changes a file (before it, and in the middle of a write), meets a full disk from each of them on,
and runs beside a second process. Afterwards every file that can be seen is whole, no foreign file
has changed, and the command named for it brings the folder to the state of an uncut run.
"""

import shutil
import sys

import pytest

from tests.harness.driver import Driver, Trial, table
from tests.harness.recipes import RECIPES, SHARED
from tests.harness.registry import shared_writer, writing

KINDS = "wcosrtu"
"""Writes, new names, files opened to write, fsyncs, renames, truncations, removals."""

FEW = 3
"""Points of each fault in the short form."""

SHORT = ("new",)
"""Commands of the short form; a split is cut short in `tests/campaign/test_transaction.py`, too."""

preload = pytest.mark.skipif(
    not sys.platform.startswith("linux") or shutil.which("cc") is None,
    reason="the faults are put in by a preloaded library: Linux and a C compiler",
)


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    made = Driver(tmp_path_factory.mktemp("harness"))
    yield made
    made.close()


@pytest.fixture(scope="module")
def rows(request):
    """Counts by command; the table is printed at the end."""
    kept = {}
    yield kept
    if kept:
        with request.config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
            sys.stdout.write(f"\n{table(kept)}\n")


def test_every_command_that_writes_has_a_recipe():
    """A new command that writes fails here until it is tried too."""
    found = writing()
    left = {name for name, command in found.items() if name not in RECIPES}
    assert {name for name in left if not shared_writer(found[name])} == set()
    assert shared_writer(found[SHARED])
    assert RECIPES.keys() - found.keys() == set()


def tried(driver, name, most):
    trial = Trial(driver, name, RECIPES[name])
    trial.at_points("kill", KINDS, most)
    trial.at_points("torn", "w", most)
    trial.at_points("full", "wc", most)
    trial.at_once()
    return trial.counts


@preload
@pytest.mark.parametrize("name", SHORT)
def test_a_few_faults(driver, name):
    counts = tried(driver, name, FEW)
    assert counts.faults == []
    assert counts.tried.total() > FEW


@preload
@pytest.mark.long
@pytest.mark.parametrize("name", RECIPES)
def test_every_fault(driver, rows, name, capsys):
    counts = tried(driver, name, RECIPES[name].points)
    rows[name] = counts.row
    with capsys.disabled():
        sys.stdout.write("\n".join(["", table({name: counts.row}), *counts.faults, ""]))
    assert counts.faults == []
