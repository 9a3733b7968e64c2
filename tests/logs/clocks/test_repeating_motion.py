"""Synchronisation of braked sines from a bench that is not in the project: no false report.

A sine shifted by its period, or turned round by half of it, fits almost as well; and a brake that
turns its sign with the motion looks early beside a current that also accelerates the shaft.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from elevon.errors import InputError
from elevon.estimate.covariance import correlated
from elevon.logs.clocks.clock_fit import SharedLogs
from elevon.logs.clocks.sync import search_offset
from elevon.logs.importing import import_log
from tests.calibrate.foreign import CHIRP, LOADED, draw, run
from tests.calibrate.foreign_files import Style, write_trial

SINE = replace(LOADED, values={"amplitude": 8.0, "bias": 9.0, "frequency": 0.4})
BLIND = Style(missing=("trigger",))


def report(folder, seed, trial, duration, style=None, **sensors):
    """Carry a trial out, import its files; return the report, and when the trigger rose."""
    bench, seen = draw(seed, sensors=sensors)
    done = run(bench, seen, trial, seed, duration=duration, start=0.3)
    path = write_trial(folder / "log.csv", done, seen, style or Style())
    return import_log(path).report, done.trigger, seen.cell_clock


@pytest.mark.parametrize(("seed", "duration"), [(32, 5.0), (34, 5.0), (33, 20.0)])
def test_a_repeating_sine_without_a_trigger_is_refused_or_right(tmp_path, seed, duration):
    """Of the first two an offset half a period off explains more over what overlaps."""
    found, trigger, _ = report(tmp_path, seed, SINE, duration, BLIND)
    sync = found.synchronisation
    if sync["method"] == "none":
        (message,) = (f.text for f in found.findings if f.code == "not-synchronised")
        assert "cannot be distinguished" in message
        assert "independent samples" in message
    else:
        assert abs(sync["offset_s"] - trigger) < 3.0 * sync["offset_std_s"]


@pytest.mark.parametrize(("seed", "cell"), [(31, "signed"), (36, "signed"), (36, "positive")])
def test_inertia_and_friction_are_no_delay(tmp_path, seed, cell):
    found, trigger, clock = report(tmp_path, seed, SINE, 20.0, cell=cell)
    sync = found.synchronisation
    assert sync["method"] == "trigger and correlation"
    assert abs(sync["offset_s"] - trigger) < 2.0 * sync["offset_std_s"]
    assert abs(sync["residual_s"]) < 2.0 * sync["residual_std_s"]
    assert abs(sync["drift"] - clock) < 2.0 * sync["drift_std"]
    if cell == "signed":  # no more than the filter of the current, and well known
        assert abs(sync["residual_s"]) < 8e-3
        assert sync["residual_std_s"] < 8e-3


def test_a_sweep_gives_no_false_drift(tmp_path):
    """The faster it goes, the more of the current accelerates the shaft."""
    found, _, clock = report(tmp_path, 31, replace(CHIRP, brake=(0.2, 2.0)), 20.0)
    sync = found.synchronisation
    assert not found.has("drift-unknown")
    assert abs(sync["drift"] - clock) < 2.5 * sync["drift_std"]
    assert abs(sync["residual_s"]) < 2.5 * sync["residual_std_s"]


def pair(shape, *, seconds=16.0, width=0.0125):
    """Two logs that saw one shape, the second from 2 s on."""
    rng = np.random.default_rng(7)
    drive, cell_time = np.arange(0.0, seconds, 0.0025), np.arange(0.0, seconds - 4.0, 0.0125)
    value = shape(cell_time + 2.0) + 1e-3 * rng.standard_normal(len(cell_time))
    return SharedLogs(drive, shape(drive)[:, None], cell_time, value, 0.0125, width)


def sweep(t):
    return np.sin(math.pi * (t + 0.05 * t**2))


def test_what_tells_two_alignments_apart_must_be_more_than_the_signals_lack():
    assert search_offset([pair(sweep)]).offset == pytest.approx(2.0, abs=0.02)
    for almost in (
        lambda t: np.sin(math.pi * t) + 0.02 * np.sin(0.3 * t),
        lambda t: (1.0 + 0.1 * t) * np.sin(math.pi * t),
    ):
        with pytest.raises(InputError, match="the motion repeats: offsets of"):
            search_offset([pair(almost)])


def test_few_independent_samples_tell_nothing_however_well_they_fit():
    """The same logs, had a filter of 1 s made them: a dozen seconds are worth four samples."""
    with pytest.raises(InputError, match=r"worth 3\.\d independent samples for 3 unknowns"):
        search_offset([pair(sweep, width=1.0)])


def test_correlated_counts_filtered_samples_once():
    from scipy.ndimage import gaussian_filter1d

    rng = np.random.default_rng(3)
    white = rng.standard_normal(20_000)
    assert correlated(white) == pytest.approx(1.0, abs=0.05)
    filtered = gaussian_filter1d(white, 3.0)
    assert correlated(filtered) == pytest.approx(2.0 * math.sqrt(math.pi) * 3.0, rel=0.1)
    assert correlated(np.ones(50)) == 1.0
