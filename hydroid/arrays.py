"""Arrays by what they hold; shapes and units stand where one is made."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]
Structs = NDArray[np.void]  # of a structured type
