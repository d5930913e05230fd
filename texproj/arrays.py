"""Names of numpy arrays by what they hold: one meaning each, in all of texproj."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
"""Colors, weights, images, surface points relative to an origin."""

Doubles = NDArray[np.float64]
"""Coordinates, cameras, and whatever is solved for."""

Ints = NDArray[np.int64]
"""Labels and counts."""

Index = NDArray[np.intp]
"""Rows of another array."""

Rows = NDArray[np.signedinteger[Any]]
"""The same, or labels, in int32 where there are as many as a mesh has faces: half the memory."""

Bools = NDArray[np.bool_]
"""Yes or no for each of something."""

Mask = NDArray[np.bool_]
"""(h, w): which pixels of an image count."""

Bytes = NDArray[np.uint8]
"""Images of 8 bits, and encoded files."""
