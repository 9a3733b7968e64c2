"""The type of arrays of numbers that the package's functions take and return."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
"""Numbers of double precision, of any shape."""
