"""The aliases for arrays: signatures say `Array`, `Mask` or `Integers`, docstrings the shape and unit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]
