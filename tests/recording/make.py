"""Recordings for the tests: ordinary, awkward, and any (for hypothesis)."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from elevon import Channel, Clock, Recording

ALL = [".parquet", ".nc", ".mat", ".csv"]
MANY_CLOCKS = [".parquet", ".nc", ".mat"]  # of any numbers; .csv but for what a NaN can hide
UNITS = ["rad", "rad/s", "N m", "1", "K", "A", "V"]


def ordinary():
    """A run on two clocks, with a gap on the second, irregular one."""
    time = np.arange(400) / 400
    drive = Recording.build(
        time,
        {"output_position": np.sin(time), "motor_speed": np.cos(7 * time)},
        {"output_position": "rad", "motor_speed": "rad/s"},
        clock="drive",
        rate=400,
        meta={"actuator": "torino-rotary", "status": "ok", "seed": 3, "scenario": {"x": [1, 2.5]}},
        labels=[{"kind": "short", "place": "motor.phase_a", "severity": 0.1}],
    )
    cell = Recording.build(
        [0.0, 0.013, 0.021, 0.5, 0.52],
        {"force": [1.0, np.nan, -0.0, 5e-324, np.inf]},
        {"force": "N"},
        clock="cell",
        gaps=[2],
    )
    return drive.joined(cell)


def one_clock():
    """Its irregular clock alone."""
    return ordinary().select(clock="cell")


names = st.from_regex(r"[a-z][a-z0-9_]{3,30}", fullmatch=True).filter(
    lambda name: name not in {"break", "case", "catch", "time", "clock", "units", "elevon"}
)
plain_doubles = st.just(np.nan) | st.floats(allow_nan=False, allow_infinity=True, width=64)
"""Without the signs and payloads that a NaN can have in memory and not in text."""
doubles = st.floats(allow_nan=True, allow_infinity=True, width=64)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | doubles | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=8).filter(lambda k: k != "$float"), inner, max_size=3)
    ),
    max_leaves=8,
)


@st.composite
def clocks(draw, name):
    instants = draw(
        st.lists(st.floats(-1e6, 1e6, allow_nan=False), unique_by=lambda x: x + 0.0, max_size=20)
    )
    rate = draw(st.none() | st.floats(1e-3, 1e6))
    count = len(instants)
    gaps = draw(st.none() | st.sets(st.integers(0, count - 2), max_size=3)) if count > 1 else None
    return Clock(name, sorted(instants), rate, None if gaps is None else sorted(gaps))


@st.composite
def recordings(draw, most_clocks=3, numbers=doubles):
    clock_names = draw(st.lists(names, min_size=1, max_size=most_clocks, unique=True))
    bases = [draw(clocks(name)) for name in clock_names]
    channels = []
    for name in draw(st.lists(names, max_size=5, unique=True)):
        base = draw(st.sampled_from(bases))
        values = draw(hnp.arrays(np.float64, len(base), elements=numbers))
        text = draw(st.text(max_size=20).filter(str.isprintable))
        channels.append(Channel(name, draw(st.sampled_from(UNITS)), values, base, text))
    meta = draw(
        st.dictionaries(
            st.text(max_size=8).filter(lambda k: k != "$float"), json_values, max_size=3
        )
    )
    final = draw(st.dictionaries(names, doubles, max_size=3))
    return Recording(
        channels,
        clocks=bases,
        meta=meta,
        labels=draw(st.lists(json_values, max_size=2)),
        final=final,
    )
