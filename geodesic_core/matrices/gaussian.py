"""Values spread by a Gaussian of the distance between points, so that their mass stays."""

from typing import TYPE_CHECKING

import numpy as np

from geodesic_core.arrays import Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_array

REACH = 4.0
"""Standard deviations at which kernels end: there they are 3e-4 of their peak"""
_ROUNDS = 30
"""Of balancing the kernels: each about halves the logarithm of what is left"""


def spread(distances: "csr_array", areas: Floats, values: Floats, sigma: float) -> Floats:
    """Return values, (n,) or (m, n), spread by Gaussians of a standard deviation.

    The weight of a pair is the Gaussian of its distance times a factor of each of its points, found
    by balancing (Sinkhorn, Knopp) so that the weights around each point, by area, sum to 1. They
    are symmetric: so a constant stays the same, and the sum of values by area as well, which a
    last division keeps to rounding.

    Parameters
    ----------
    distances
        (n, n), symmetric; those that are missing are too far to count.
    areas
        (n,) of each point.
    values
        Of each point.
    sigma
        The standard deviation.
    """
    kernel = distances.copy()
    kernel.data = np.exp(-0.5 * (kernel.data / sigma) ** 2)
    factors = 1.0 / np.sqrt(kernel @ areas)
    for _ in range(_ROUNDS):
        factors = np.sqrt(factors / (kernel @ (areas * factors)))
    sums = factors * (kernel @ (areas * factors))
    mass = (areas * factors / sums) * values
    result: Floats = factors * (kernel @ mass.T).T
    return result
