"""Windows of a stream: where they begin, and what of its samples is counted."""

import sys

import numpy as np
import pytest

from elevon.diagnose.monitor.cutter import SampleCounts, WindowCutter
from elevon.errors import InputError

RATE = 100.0
FAST = 0.1


def cutter(**kind):
    return WindowCutter(
        **{"width": 2.0, "lead": 1.0, "fast": FAST, "speed": 0, "needed": (0, 1)} | kind
    )


def samples(seconds, standstill=0.0, begin=1000.0):
    """Time stamps, and a speed of one after a rest; the second channel is the number."""
    count = round(seconds * RATE)
    time = begin + np.arange(count) / RATE
    return time, np.column_stack([(time >= begin + standstill).astype(float), np.arange(count)])


def taken(order, *, portions=1, **kind):
    """Windows and counts of samples in an order."""
    watch, (time, values) = cutter(), samples(**kind)
    out = []
    for part in np.array_split(np.asarray(order, dtype=int), portions):
        out += watch.take(time[part], values[part])
    out += watch.finish()
    return out, watch.pending, sum((w.counts for w in out), watch.pending)


def test_windows_begin_a_second_after_the_motion_half_a_sample_early():
    out, _, total = taken(range(1000), seconds=10.0)
    assert [w.start for w in out] == pytest.approx([0.995, 2.995, 4.995, 6.995])
    assert [w.values[0, 1] for w in out] == [100, 300, 500, 700]
    assert total == SampleCounts(taken=800)


def test_a_rest_is_windows_of_its_own_and_the_last_window_needs_no_sample_behind_it():
    out, _, total = taken(range(1000), seconds=10.0, standstill=5.0)
    assert [(w.why, w.counts.taken) for w in out] == [("rest", 200)] * 2 + [("window", 200)] * 2
    assert out[2].start == pytest.approx(5.995)
    assert total.missing == 0
    out, _, _ = taken(range(1000), seconds=10.0, standstill=20.0)
    assert [w.why for w in out] == ["rest"] * 5


@pytest.mark.parametrize("portions", [1, 3, 997])
def test_what_is_not_in_order_is_counted_in_any_portions(portions):
    order = list(range(1000))
    order[150:160] = reversed(order[150:160])  # nine behind the one that came first
    order.insert(250, 249)  # doubled
    order.insert(420, 120)  # its window is closed
    del order[500:507]
    out, _, total = taken(order, seconds=10.0, portions=portions)
    assert total == SampleCounts(taken=793, missing=7, doubled=1, out_of_order=9, late=1)
    assert [w.counts.out_of_order for w in out] == [9, 0, 0, 0]
    for window in out:
        assert (np.diff(window.time) > 0.0).all()
        assert (np.diff(window.values[:, 1]) > 0.0).all()


def test_a_value_that_is_missing_is_counted_and_stays_missing():
    time, values = samples(6.0)
    values[150, 1] = np.nan
    watch = cutter()
    first = watch.take(time, values)[0]
    assert first.counts.empty == 1
    assert np.isnan(first.values[50, 1])


def test_a_gap_of_whole_windows_is_one_stretch_and_the_grid_stays():
    order = [*range(350), *range(2350, 3000)]
    out, _, total = taken(order, seconds=30.0)
    assert [w.why for w in out] == ["window", "window", "gap", *["window"] * 3]
    gap = out[2]
    assert (gap.start, gap.end) == pytest.approx((4.995, 22.995))
    assert out[3].start == gap.end
    assert [w.counts.missing for w in out] == [0, 150, 1800, 50, 0, 0]
    assert total.missing == 2000
    assert len(gap.time) == 0


def test_a_clock_that_goes_back_leaves_samples_out_and_says_so_each_window():
    order = [*range(700), *range(100), *range(690)]
    out, _, total = taken(order, seconds=10.0)
    late = [w for w in out if w.why == "late"]
    assert [(w.start, w.end) for w in late] == [(0.0, 2.0), (2.0, 4.0)]
    assert total == SampleCounts(taken=600, late=600, doubled=190)


def test_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(sys.modules[WindowCutter.__module__], "_MOST", 5000)
    watch = cutter(width=1e9)
    time, values = samples(100.0)
    with pytest.raises(InputError, match="more than 5000 samples in a window"):
        for part in np.array_split(np.arange(10_000), 2000):
            watch.take(time[part], values[part])
    long = cutter()
    for k in range(200):
        time, values = samples(10.0, begin=10.0 * k)
        long.take(time, values)
    assert sum(map(len, long.times)) <= 200
    assert len(long.place.first) == 200


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_hardly_any_samples_are_no_window(count):
    out, pending, _ = taken(range(count), seconds=1.0)
    assert out == []
    assert pending == SampleCounts()


def test_stamps_at_the_ends():
    watch = cutter()
    out = watch.take(np.array([0.0, 1e12, -1e12]), np.ones((3, 2)))
    assert [(w.why, w.counts.taken) for w in out] == [("window", 0), ("gap", 0)]
    assert watch.pending.late == 1
