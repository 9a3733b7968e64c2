"""The load cells' converter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats


@dataclass(frozen=True, slots=True)
class Hx711:
    """The load cells' 24-bit converter (HX711).

    Attributes
    ----------
    full_scale : float
        Force at full scale [N]. ASSUMED 490 N (a 50 kg cell): the cells are not printed.
    bits : int
        Width of the converter.
    rate : float
        Samples a second: 10 or 80 by a pin of the chip; 80 ASSUMED.
    """

    full_scale: float = 490.0
    bits: int = 24
    rate: float = 80.0

    @property
    def step(self) -> float:
        """Force of one count [N]."""
        return 2.0 * self.full_scale / float(2**self.bits)

    def convert(self, force: npt.ArrayLike) -> Floats:
        """Return forces [N] as the converter reports them: in whole counts, clipped at its ends."""
        top = 2 ** (self.bits - 1)
        counts = np.clip(np.rint(np.asarray(force, dtype=np.float64) / self.step), -top, top - 1)
        return np.asarray(counts * self.step, dtype=np.float64)
