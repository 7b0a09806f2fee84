"""Types of arrays, and the rotor's number of blades: the one place for each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
AnyArray = NDArray[Any]
"""Real or complex: what complex-step differentiation passes through."""
ComplexArray = NDArray[np.complex128]
FloatArray = NDArray[np.float64] | NDArray[np.float32]
"""Of either precision."""
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

BLADES = 3
"""Of the rotor. Multi-blade coordinates are those of three equal blades; everything else is a length."""
