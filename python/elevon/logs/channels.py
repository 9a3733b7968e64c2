"""What the channels of a log look like: missing samples, clipping, standing still."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from elevon.arrays import Floats
from elevon.logs.clocks.quality import clipped_share, stuck_spans
from elevon.logs.command.reconstruct import SPEED_LIMIT
from elevon.logs.report import ImportReport
from elevon.recording import Recording

_CLIP_SHARE = 0.01
_FREE_TRAVEL = 0.08  # rad at the output: more than the widest backlash the bench can set (0.0457)
_CLIPPING = {"speed_ref", "motor_speed", "current_ref", "torque_current", "direct_current",
             "torque_voltage", "load_cell"}  # fmt: skip


def examine_channels(recording: Recording, ratio: float | None, report: ImportReport) -> None:
    """Add findings about every channel of the drive's clock.

    Parameters
    ----------
    recording : Recording
        SI, with roles.
    ratio : float or None
        Motor over output, where it is known.
    report : ImportReport
        Findings are added to it.
    """
    values = {channel.name: channel.values for channel in recording.channels}
    roles = {name: role for role, name in recording.roles.items()}
    for name, data in values.items():
        missing = int(np.isnan(data).sum())
        if missing == len(data):
            report.say(name, "empty")
            continue
        if missing:
            report.say(name, "missing", missing, len(data))
        _constant(name, data, values, report)
        if roles.get(name) in _CLIPPING:
            _clipping(name, data, report, limited=roles[name] == "speed_ref")
    if ratio is not None and {"motor_position", "output_position"} <= recording.roles.keys():
        _stuck(recording, ratio, report)


def _constant(name: str, data: Floats, values: Mapping[str, Floats], report: ImportReport) -> None:
    good = data[np.isfinite(data)]
    moved = any(
        np.nanmax(v) > np.nanmin(v)
        for other, v in values.items()
        if other != name and np.isfinite(v).any()
    )
    if good.size > 1 and np.ptp(good) == 0.0 and moved:
        if name == "trigger":
            report.say(name, "no-edge", good[0])
        else:
            report.say(name, "stuck-throughout", good[0])


def _clipping(name: str, data: Floats, report: ImportReport, *, limited: bool) -> None:
    shares = clipped_share(data)
    for share, value in zip(shares, (np.nanmin(data), np.nanmax(data)), strict=True):
        if share <= _CLIP_SHARE or value == 0.0:
            continue
        if limited and abs(abs(value) - SPEED_LIMIT) < 0.01 * SPEED_LIMIT:
            report.say(name, "saturated", np.sign(value) * 500, 100 * share)
        else:
            report.say(name, "clipped", 100 * share, value)


def _stuck(recording: Recording, ratio: float, report: ImportReport) -> None:
    outer, inner = recording.role("output_position"), recording.role("motor_position")
    if outer.unit != "rad":
        return
    both = np.isfinite(inner.values) & np.isfinite(outer.values)
    motor, output = inner.values[both] / ratio, outer.values[both]
    for name, data, drive in ((outer.name, output, motor), (inner.name, motor, output)):
        for start, end in stuck_spans(outer.time[both], data, drive, _FREE_TRAVEL)[:10]:
            report.say(name, "stuck", start, end)
