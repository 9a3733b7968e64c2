"""Recordings as pandas tables, xarray datasets and Arrow tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.recording.header import Header

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import xarray as xr

    from elevon.recording.recording import Recording


def time_name(recording: Recording, clock: str) -> str:
    """Return the name of a clock's dimension: ``time``, or ``time_NAME`` beside others."""
    return "time" if len(recording.clocks) == 1 else f"time_{clock}"


def to_pandas(
    recording: Recording, clock: str | None = None, *, units: bool = False
) -> pd.DataFrame:
    """Return one clock's channels as a table indexed by time (s); units in ``attrs``.

    With `units` they also stand in the columns' names: ``output_position [rad]``.
    """
    import pandas as pd

    base = recording.clock(clock)
    channels = recording.on_clock(base.name)
    index = pd.Index(base.time, name="time [s]" if units else "time")
    named = {f"{c.name} [{c.unit}]" if units else c.name: c.values for c in channels}
    table = pd.DataFrame(named, index=index)
    table.attrs["units"] = {"time": "s", **{c.name: c.unit for c in channels}}
    return table


def to_xarray(recording: Recording) -> xr.Dataset:
    """Return all channels as a dataset, one time dimension a clock, units as attributes.

    The dimension is ``time`` for a single clock, ``time_NAME`` for each of several.
    """
    import xarray as xr

    coordinates, variables = {}, {}
    for clock in recording.clocks.values():
        dimension = time_name(recording, clock.name)
        attributes: dict[str, object] = {"units": "s", "clock": clock.name}
        if clock.rate is not None:
            attributes["rate_hz"] = clock.rate
        coordinates[dimension] = xr.Variable((dimension,), clock.time, attributes)
        for channel in recording.on_clock(clock.name):
            notes = {"units": channel.unit, "long_name": channel.text or channel.name}
            variables[channel.name] = xr.Variable((dimension,), channel.values, notes)
    return xr.Dataset(variables, coordinates, {"elevon": Header.sealed(recording).to_json()})


def to_arrow(recording: Recording, clock: str | None = None) -> pa.Table:
    """Return one clock's time and channels as an Arrow table, units in the field metadata."""
    import pyarrow as pa

    base = recording.clock(clock)
    channels = recording.on_clock(base.name)
    fields = [pa.field("time", pa.float64(), nullable=False, metadata={"unit": "s"})]
    fields += [
        pa.field(c.name, pa.float64(), metadata={"unit": c.unit, "text": c.text}) for c in channels
    ]
    arrays = [pa.array(base.time), *(pa.array(c.values) for c in channels)]
    header = Header.sealed(recording.select(clock=base.name)).to_json()
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata={"elevon": header}))
