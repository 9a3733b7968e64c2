"""The types of arrays that the package's functions take and return, of any shape."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Numbers of double precision."""
Complex = npt.NDArray[np.complex128]
"""Complex numbers."""
Bools = npt.NDArray[np.bool_]
"""Which samples."""
Ints = npt.NDArray[np.int64]
"""Counts, or the numbers of blocks."""
