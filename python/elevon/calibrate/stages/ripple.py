"""Which model the logs bear: the one that switches, or the one that takes means.

Commutations ripple the demanded voltage, the current and through it the speed. A log of a machine
has at least the ripple that the switching model shows in the same motion; noise adds to it. A log
with less comes from means, as the reduced-order model computes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.stages.moves import moves_of
from elevon.logs.log import Log

_ROLES = ("motor_speed", "torque_voltage", "torque_current")
_SMOOTH = 2.0  # samples of the Gaussian that leaves the ripple: nothing slower than five samples
_LOCAL = 0.05  # s over which a ripple's energy is averaged; the median over a motion drops ramps
_HALF = 0.5  # of the switching model's energy: nearer to it than to none
_ROUNDING = 1e-12  # of a signal's variance: energy below it is arithmetic


@dataclass(frozen=True)
class Ripple:
    """Energy of a log's ripple over the switching model's, where it is smallest.

    Attributes
    ----------
    share : float or None
        Smallest over motions and channels; None where no run has any.
    role, log : str
        Where.
    """

    share: float | None
    role: str = ""
    log: str = ""

    @property
    def fidelity(self) -> str:
        """``low`` where the logs lack the ripple, else ``high``: a machine commutates."""
        return "low" if self.share is not None and self.share < _HALF else "high"


def ripple_of(logs: Sequence[Log], runs: Sequence[Log]) -> Ripple:
    """Compare the ripple of logs with that of the switching model's runs of them.

    Parameters
    ----------
    logs : sequence of Log
        Of the stand.
    runs : sequence of Log
        The same motions, by the switching model; logs that were not run are passed over.

    Returns
    -------
    Ripple
        The smallest share; its `fidelity` is the one that the logs bear.
    """
    by_name = {log.name: log for log in logs}
    rows = []
    for run in runs:
        log = by_name[run.name]
        for role in _ROLES:
            if not (log.has(role) and run.has(role)):
                continue
            ran = _energy(run, run[role])
            if ran > _ROUNDING * float(np.var(run[role])):
                rows.append((_energy(log, log[role]) / ran, role, log.name))
    return Ripple(*min(rows)) if rows else Ripple(None)


def _energy(log: Log, values: Floats) -> float:
    """Median over the log's motions of a channel's local energy above its smooth part."""
    from scipy.ndimage import gaussian_filter1d

    ripple = values - gaussian_filter1d(values, _SMOOTH)
    local = gaussian_filter1d(ripple**2, _LOCAL / log.period)
    inside = np.zeros(len(values), dtype=bool)
    for move in moves_of(log):
        inside |= (log.time >= move.begin) & (log.time <= move.end)
    return float(np.median(local[inside])) if inside.any() else 0.0
