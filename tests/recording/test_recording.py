import math

import numpy as np
import pytest

from elevon import Channel, Clock, Recording
from elevon.errors import InputError, UnitError, UnknownNameError
from tests.recording.make import ordinary


def test_channels_are_found_by_name():
    recording = ordinary()
    channel = recording["output_position"]
    assert (channel.unit, channel.clock.name, len(channel)) == ("rad", "drive", 400)
    assert channel.time is recording.clocks["drive"].time
    assert recording.names == list(recording) == ["output_position", "motor_speed", "force"]
    assert "force" in recording
    assert len(recording) == 3
    assert "status" not in recording
    assert recording.status == "ok"


def test_an_unknown_channel_names_the_nearest():
    with pytest.raises(UnknownNameError, match="'output_positon'; did you mean 'output_position'"):
        ordinary()["output_positon"]


def test_values_and_time_are_read_only_and_the_given_array_stays_writable():
    given = np.arange(3.0)
    recording = Recording.build([0, 1, 2], {"x": given}, {"x": "rad"})
    with pytest.raises(ValueError, match="read-only"):
        recording["x"].values[0] = 1
    with pytest.raises(ValueError, match="read-only"):
        recording.clock().time[0] = 1
    given[0] = 7
    with pytest.raises(AttributeError):
        recording["x"].unit = "m"


def test_large_arrays_are_not_copied():
    block = np.zeros((1000, 3))
    clock = Clock("main", np.arange(1000.0))
    assert np.shares_memory(Channel("x", "rad", block[:, 1], clock).values, block)


def test_build_converts_to_si_and_back():
    recording = Recording.build(
        [0, 1], {"w": [60.0, 120.0], "t": [20.0, math.nan]}, {"w": "rpm", "t": "degC"}
    )
    assert recording["w"].unit == "rad/s"
    np.testing.assert_allclose(recording["w"].values, [2 * math.pi, 4 * math.pi])
    np.testing.assert_allclose(recording["w"].to("rpm"), [60.0, 120.0])
    np.testing.assert_allclose(recording["t"].values, [293.15, math.nan])
    with pytest.raises(UnitError, match="expected an angular speed"):
        recording["w"].to("deg")


def test_gaps_are_found_from_the_rate_or_given():
    time = [0.0, 0.1, 0.2, 0.6, 0.7]
    assert Clock("a", time, rate=10).gaps == (2,)
    assert Clock("a", time, rate=10).gap_intervals == [(0.2, 0.6)]
    assert Clock("a", time).gaps == ()
    assert Clock("a", time, rate=10, gaps=[]).gaps == ()
    assert Clock("a", time, gaps=[3, 0, 3]).gaps == (0, 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"time": [0, 1, 1]}, r"time\[1\] = 1.0, time\[2\] = 1.0"),
        ({"time": [0, 2, 1]}, "does not increase"),
        ({"time": [0, math.nan]}, r"time\[1\] = nan is not finite"),
        ({"time": [0, math.inf]}, "not finite"),
        ({"time": [[0, 1]]}, "one dimension"),
        ({"time": ["a"]}, "not numbers"),
        ({"time": [[0], [1, 2]]}, "not an array"),
        ({"time": [0, 1], "rate": 0}, "rate 0"),
        ({"time": [0, 1], "rate": math.nan}, "rate nan"),
        ({"time": [0, 1], "gaps": [1]}, "gap indices"),
        ({"time": [0, 1], "gaps": [-1]}, "gap indices"),
        ({"time": [0], "name": "a b"}, "clock 'a b'"),
    ],
)
def test_bad_clocks(arguments, message):
    with pytest.raises(InputError, match=message):
        Clock(**{"name": "a", **arguments})


@pytest.mark.parametrize(
    "name", ["", "1a", "_a", "a-b", "é", "x" * 32, "end", "lambda", "time", "clock", "a\n", "a<b>"]
)
def test_bad_names(name):
    with pytest.raises(InputError, match="channel"):
        Recording.build([0], {name: [1]}, {name: "rad"})


def test_bad_channels():
    clock = Clock("main", [0, 1])
    with pytest.raises(InputError, match="3 values for the 2 instants of clock 'main'"):
        Channel("x", "rad", [1, 2, 3], clock)
    with pytest.raises(UnitError, match="not SI"):
        Channel("x", "deg", [1, 2], clock)
    with pytest.raises(UnitError, match="unknown unit 'radd'"):
        Channel("x", "radd", [1, 2], clock)
    with pytest.raises(InputError, match="not numbers"):
        Channel("x", "rad", [1, 2j], clock)
    with pytest.raises(InputError, match="not numbers"):
        Channel("x", "rad", [object(), None], clock)
    for text in ("a\0b", "\ud800", "x" * 1001):
        with pytest.raises(InputError, match="its text"):
            Channel("x", "rad", [1, 2], clock, text)


def test_bad_recordings():
    clock, twin = Clock("main", [0, 1]), Clock("main", [0, 1])
    one = Channel("x", "rad", [1, 2], clock)
    with pytest.raises(InputError, match="given twice"):
        Recording([one, Channel("X", "rad", [1, 2], clock)])
    with pytest.raises(InputError, match="two different clocks"):
        Recording([one, Channel("y", "rad", [1, 2], twin)])
    with pytest.raises(InputError, match=r"meta\.when\[0\]: a object"):
        Recording([one], meta={"when": [object()]})
    with pytest.raises(InputError, match="no unit for the channels y"):
        Recording.build([0], {"x": [1], "y": [1]}, {"x": "1"})
    with pytest.raises(UnknownNameError, match="units: unknown channel 'z'"):
        Recording.build([0], {"x": [1]}, {"x": "1", "z": "1"})
    nested = []
    nested.append(nested)
    with pytest.raises(InputError, match="deeper"):
        Recording([one], meta={"loop": nested})


def test_meta_is_a_private_plain_copy():
    given = {"a": [np.float64(1.5)], "b": np.arange(2), "c": (1, 2)}
    recording = Recording([], meta=given)
    given["a"].append(2)
    assert recording.meta == {"a": [1.5], "b": [0, 1], "c": [1, 2]}


def test_the_clock_must_be_named_when_there_are_several():
    recording = ordinary()
    with pytest.raises(InputError, match="2 clocks; name one of 'drive', 'cell'"):
        recording.to_pandas()
    with pytest.raises(UnknownNameError, match="did you mean 'drive'"):
        recording.clock("drives")


def test_select():
    recording = ordinary()
    assert recording.select(["force"]).names == ["force"]
    assert list(recording.select(["force"]).clocks) == ["cell"]
    drive = recording.select(clock="drive")
    assert drive.names == ["output_position", "motor_speed"]
    assert np.shares_memory(drive["motor_speed"].values, recording["motor_speed"].values)
    assert drive.meta == recording.meta
    with pytest.raises(UnknownNameError):
        recording.select(["forces"])


def test_window_cuts_every_clock_and_moves_the_gaps():
    part = ordinary().window(0.013, 0.5)
    assert part["force"].time.tolist() == [0.013, 0.021, 0.5]
    assert part.clocks["cell"].gaps == (1,)
    assert part["output_position"].time[0] >= 0.013
    assert part["output_position"].time[-1] == 0.5
    assert len(ordinary().window(5, 6)["force"]) == 0
    assert len(ordinary().window(6, 5)["force"]) == 0
    assert ordinary().window().equals(ordinary())


def test_joining_refuses_the_same_clock_twice():
    with pytest.raises(InputError, match="two different clocks"):
        ordinary().joined(ordinary())


def test_equals_sees_every_bit():
    base = Recording.build([0, 1], {"x": [0.0, math.nan]}, {"x": "rad"})
    assert base.equals(Recording.build([0, 1], {"x": [0.0, math.nan]}, {"x": "rad"}))
    assert not base.equals(Recording.build([0, 1], {"x": [-0.0, math.nan]}, {"x": "rad"}))
    assert not base.equals(Recording.build([0, 1], {"x": [0.0, math.nan]}, {"x": "1"}))
    assert not base.equals(base.with_meta(a=1))


def test_repr_says_what_is_inside():
    text = repr(ordinary())
    assert "Recording ok: 3 channels" in text
    assert "400 Hz, 400 samples" in text
    assert "irregular, 5 samples" in text
    assert "1 gaps" in text
    assert "'rad', 400 samples on 'drive'" in repr(ordinary()["output_position"])
    assert Recording([]).status == "measured"


def test_to_pandas():
    table = ordinary().to_pandas("cell")
    assert table.index.name == "time"
    assert table.attrs["units"] == {"time": "s", "force": "N"}
    assert table["force"].iloc[0] == 1.0


def test_to_xarray():
    dataset = ordinary().to_xarray()
    assert dict(dataset.sizes) == {"time_drive": 400, "time_cell": 5}
    assert dataset["force"].attrs["units"] == "N"
    assert ordinary().select(clock="cell").to_xarray()["force"].dims == ("time",)


def test_to_arrow():
    table = ordinary().to_arrow("drive")
    assert table.column_names == ["time", "output_position", "motor_speed"]
    assert table.schema.field("motor_speed").metadata[b"unit"] == b"rad/s"
    assert table.num_rows == 400


def test_build_copies_what_it_is_given_and_a_mask_becomes_missing_samples():
    time, values = np.arange(5.0), np.arange(5.0)
    masked = np.ma.masked_array(values.copy(), [0, 1, 0, 0, 0])
    built = Recording.build(time, {"x": values, "y": masked}, {"x": "m", "y": "m"})
    time[0], values[0] = -3.0, 9.0
    assert built.time.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert built["x"].values[0] == 0.0
    assert values.flags.writeable
    assert np.isnan(built["y"].values).tolist() == [False, True, False, False, False]


def test_a_mask_that_would_be_lost_is_refused():
    hidden = np.ma.masked_array(np.arange(5.0), [0, 1, 0, 0, 0])
    with pytest.raises(InputError, match="channel 'x': a mask hides 1 values"):
        Channel("x", "m", hidden, Clock("main", np.arange(5.0)))
    with pytest.raises(InputError, match="clock 'main': time: a mask hides 1 values"):
        Recording.build(hidden, {"x": np.arange(5.0)}, {"x": "m"})


def test_the_time_is_found_as_a_channel_and_as_instants():
    one = Recording.build([0.0, 0.5], {"x": [1, 2]}, {"x": "rad"})
    assert one["time"].to("ms").tolist() == [0.0, 500.0]
    assert one["time"].values is one.time
    other = Recording.build([0.0, 0.7], {"y": [1, 2]}, {"y": "rad"}, clock="slow")
    with pytest.raises(InputError, match="2 clocks"):
        one.joined(other)["time"]
