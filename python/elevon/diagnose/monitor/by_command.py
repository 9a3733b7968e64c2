"""Samples cut into windows by what is commanded: a position that leaves its rest, or an action."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.monitor.cutter import Bools, CutWindow, WindowCutter


@dataclass
class CommandCutter(WindowCutter):
    """Cuts where a command is `fast` away from where the day began; `speed` is its channel."""

    def _moving(self, values: Floats) -> Bools:
        command = values[:, self.speed]
        known = command[np.isfinite(command)]
        if math.isnan(self.place.level) and known.size:
            self.place.level = float(known[0])
        return np.asarray(np.abs(command - self.place.level) > self.fast)


@dataclass
class ActionCutter(WindowCutter):
    """Cuts a window wherever the action `fast` is commanded anew; between them the unit rests."""

    def _moving(self, values: Floats) -> Bools:
        level = np.rint(values[:, self.speed])
        before = np.concatenate(([self.place.level], level[:-1]))
        return np.asarray((level == self.fast) & np.isfinite(before) & (before != self.fast))

    def _push(self, time: Floats, values: Floats) -> None:
        command = values[:, self.speed]
        known = command[np.isfinite(command)]
        if known.size:
            self.place.level = float(np.rint(known[-1]))
        super()._push(time, values)

    def _close(self) -> CutWindow:
        out = super()._close()
        self.place.fast = math.nan
        return out
