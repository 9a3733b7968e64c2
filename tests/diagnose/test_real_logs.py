"""Real logs of healthy machines that no actuator file is calibrated to: never a cause."""

from collections import Counter

import pytest

import elevon
from elevon.diagnose.learning.labels import LabelledLog
from elevon.errors import ElevonError
from elevon.logs.formats.cranfield import read_cranfield
from elevon.logs.log import Log

pytestmark = [
    pytest.mark.shared,
    pytest.mark.long,
    pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning"),
]


def recordings(folder, *conditions):
    for name in conditions:
        for item in read_cranfield(folder / f"{name}.csv.gz"):
            about = item.meta
            if about["profile"] == "trap":
                load, run = about["load_kgf"], about["run"]
                yield name, load, run, Log.of(item, f"{name} {load:g} {run}")


def test_a_healthy_screw_of_another_make_is_never_given_a_cause(shared):
    """21 recordings without a baseline, with one of another run, with itself."""
    items = list(recordings(shared / "data" / "cranfield", "normal"))
    seen = {}
    for _, load, run, log in items:
        other = next(x for _, a, n, x in items if a == load and n != run)
        for base in ([], [other], [log]):
            try:
                answer = elevon.diagnose(log, "nasa-ballscrew", baselines=base)
            except ElevonError:
                seen.setdefault(len(base), Counter())["refused"] += 1
                continue
            seen.setdefault(len(base), Counter())[answer.status] += 1
            assert not answer.best
    print(seen)  # noqa: T201 - the counts are what it is for
    # Without a baseline and with a file that no log was calibrated to nothing is decided.
    assert set(seen[0]) == {"undecided"}
    assert set(seen[1]) <= {"healthy", "model_does_not_fit"}


@pytest.mark.parametrize("load", [20, 40])
def test_three_healthy_logs_of_a_real_screw_show_its_faults(shared, load):
    """The file is of another make, so the logs alone decide: a fault is seen, never a cause named.

    A spalled ball of the last stage moves the current at 20 kgf by 2 %, as days do: not asked here.
    """
    classes = ["normal", "lackLubrication2", "backlash2", *(["spalling8"] if load == 40 else [])]
    logs = {
        (name, run): log
        for name, at, run, log in recordings(shared / "data" / "cranfield", *classes)
        if at == load
    }
    base = [logs["normal", run] for run in (5, 6, 7)]
    seen = {name: Counter() for name in classes}
    for name in classes:
        for run in (1, 2, 3, 4):
            answer = elevon.diagnose(logs[name, run], "nasa-ballscrew", baselines=base)
            assert not answer.best
            seen[name][answer.status] += 1
    print(seen)  # noqa: T201
    assert seen["normal"]["healthy"] >= 3
    assert all(seen[name] == {"unknown_fault": 4} for name in classes[1:])


def test_real_classes_are_learnt_and_judged_by_runs_and_loads_left_out(shared):
    """Normal, backlash, lost lubrication: three loads, seven runs each."""
    names = ("normal", "backlash2", "lackLubrication2")
    items = list(recordings(shared / "data" / "cranfield", *names))
    known = [
        LabelledLog("healthy" if name == "normal" else name, f"run {run}", f"{load:g} kgf")
        for name, load, run, _ in items
    ]
    left = elevon.learn([log for *_, log in items], known).report["left_out"]
    print(left)  # noqa: T201
    assert left["unit"]["logs"] == len(items)
    assert left["unit"]["right"] > 0.75 * len(items)
