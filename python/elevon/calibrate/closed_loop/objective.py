"""Residuals of a loop model in deviations, with a weak belief in the first values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.blocks import memory
from elevon.calibrate.closed_loop.free import Free, outer
from elevon.calibrate.closed_loop.model import Channels, LoopModel

__all__ = ["SOFT", "Objective", "robust"]

SOFT = 3.0  # deviations beyond which a residual weighs less
_LEAST = 2e-4  # of a channel's spread: its deviation at least
_BIG = 1e3  # residual of a run that left the finite numbers
#: First deviations, as shares of a channel's spread: what a fair model of an unknown drive leaves.
_FIRST = {"position": 0.03, "motor_position": 0.03, "speed": 0.12, "motor_speed": 0.12,
          "current": 0.4, "voltage": 0.4}  # fmt: skip


class Objective:
    """Residuals by point, stacked over logs and channels.

    Attributes
    ----------
    model : LoopModel
        What runs.
    free : tuple of Free
        What moves.
    scales : dict of (int, str) to float
        Deviation of each log's channels.
    """

    def __init__(self, model: LoopModel, free: Sequence[Free], belief: float = 1.0) -> None:
        self.model = model
        self.free = tuple(free)
        self.belief = belief
        self.first = np.array([f.inner(f.start) for f in free])
        self.low = np.array([f.inner(f.low) for f in free])
        self.high = np.array([f.inner(f.high) for f in free])
        self.scales: dict[tuple[int, str], float] = {}
        self.keys = [
            (k, name)
            for k, log in enumerate(model.logs)
            for name in model.channels
            if name in log.signals
        ]
        self.masks = {
            (k, name): model.logs[k].used & np.isfinite(model.logs[k].signals[name])
            for k, name in self.keys
        }
        for k, name in self.keys:
            self.scales[k, name] = max(_FIRST[name] * model.logs[k].sigma(name), 1e-12)
        self.share = np.ones(sum(int(mask.sum()) for mask in self.masks.values()))

    def runs(self, x: Floats) -> list[list[Channels]]:
        """Run points, shape (m, p)."""
        return self.model.simulate([outer(self.free, row) for row in np.atleast_2d(x)])

    def parts(self, predicted: Sequence[Channels]) -> dict[tuple[int, str], Floats]:
        """Residual of each log and channel in deviations, samples that count only."""
        residuals = {}
        for k, name in self.keys:
            mask, run = self.masks[k, name], predicted[k]
            if run is None:
                residuals[k, name] = np.full(int(mask.sum()), _BIG)
                continue
            deviation = (run[name] - self.model.logs[k].signals[name])[mask] / self.scales[k, name]
            residuals[k, name] = np.clip(deviation, -_BIG, _BIG)
        return residuals

    def residual(self, x: Floats) -> Floats:
        """Stacked residuals of points, shape (m, n)."""
        rows = []
        for predicted in self.runs(x):
            parts = self.parts(predicted)
            rows.append(np.concatenate([parts[key] for key in self.keys]))
        return np.array(rows)

    def prior(self, x: Floats) -> Floats:
        """Rows of the belief: how far from the first value, in its spreads; shape (p,)."""
        return np.asarray((x - self.first) * self.belief)

    def cost(self, residual: Floats, x: Floats) -> float:
        """Robust cost of one point, each sample for the share of it that is independent."""
        return float(np.sum(self.share * robust(residual)) + np.sum(self.prior(x) ** 2))

    def weight(self, residual: Floats) -> Floats:
        """Weight of each sample in the normal equations: independent share, robust."""
        return np.asarray(self.share / np.sqrt(1.0 + (residual / SOFT) ** 2))

    def refresh(self, x: Floats) -> None:
        """Set deviations and independent shares to what the residuals really have.

        The position remembers an integral action for a second, the current nothing: counted alike,
        the position would decide everything, down to single ticks of a saturated integrator.
        """
        predicted = self.runs(x)[0]
        parts = self.parts(predicted)
        for key in self.keys:
            rms = float(np.sqrt(np.mean(np.minimum(parts[key] ** 2, (2.0 * SOFT) ** 2))))
            k, name = key
            least = _LEAST * self.model.logs[k].sigma(name)
            self.scales[key] = max(self.scales[key] * rms, least, 1e-12)
        self.share = np.concatenate(
            [np.full(len(parts[key]), _share(parts[key])) for key in self.keys]
        )


def _share(residual: Floats) -> float:
    """Independent samples over samples of a coloured residual."""
    return 1.0 / memory(np.clip(residual, -2.0 * SOFT, 2.0 * SOFT))


def robust(residual: Floats) -> Floats:
    """Soft absolute cost: squares up to some deviations, then linear."""
    return np.asarray(2.0 * SOFT**2 * (np.sqrt(1.0 + (residual / SOFT) ** 2) - 1.0))
