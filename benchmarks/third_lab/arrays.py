"""The one kind of array that is used here."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
