"""Real spherical harmonics up to order 2."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BASES = 9


def basis(directions: NDArray[Any]) -> NDArray[Any]:
    """(n, 9) values at (n, 3) unit vectors, orthonormal over the sphere.

    Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps",
    SIGGRAPH 2001, eq. 3: (0,0), (1,-1), (1,0), (1,1), (2,-2), (2,-1), (2,0), (2,1), (2,2).
    """
    x, y, z = directions.T
    one = np.full_like(x, 0.28209479177387814)
    first, second = 0.4886025119029199, 1.0925484305920792
    return np.stack([
        one, first * y, first * z, first * x,
        second * x * y, second * y * z, 0.31539156525252005 * (3 * z * z - 1),
        second * x * z, 0.5462742152960396 * (x * x - y * y),
    ], axis=1)  # fmt: skip


OPEN_GAINS = np.array([np.pi, *[2 * np.pi / 3] * 3, *[np.pi / 4] * 5])
"""What a coefficient of radiance adds to the irradiance of an open surface whose normal the basis
is taken at (ibid., eq. 8)."""
