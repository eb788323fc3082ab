"""Values smoothed along a cortex, by a Gaussian of the geodesic distance."""

from __future__ import annotations  # help() shows the names of types, not what they stand for

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats
from geodesic_core.brain.cortex import Cortex
from geodesic_core.brain.maps import read_values
from geodesic_core.errors import InvalidArgument
from geodesic_core.matrices.gaussian import REACH, spread
from geodesic_core.solvers import distance_matrix
from geodesic_core.validation import is_number

_FWHM = math.sqrt(8.0 * math.log(2.0))
"""Full width at half maximum of a Gaussian, in standard deviations"""


def smooth(
    cortex: Cortex,
    values: ArrayLike,
    fwhm: float,
    *,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
    cancel: Callable[[], bool] | None = None,
    deadline_s: float | None = None,
    memory_limit: int | None = None,
) -> Floats:
    """Return values smoothed by Gaussians of the exact distance, within the region.

    The mass, values times `Cortex.areas`, stays the same up to rounding, and a constant stays a
    constant: weights are balanced for both.

    Parameters
    ----------
    cortex
        From `load_cortex`. Values outside of the region count for nothing.
    values
        (V,) or (M, V), one for each vertex of the mesh of the cortex; finite in the region.
    fwhm
        Full width of the Gaussian at half of its maximum, mm.
    threads
        As in `write_matrix`.
    progress, cancel, deadline_s, memory_limit
        See `Control`.

    Returns
    -------
    (V,) or (M, V) float64
        Smoothed; NaN outside of the region.

    Raises
    ------
    InvalidArgument
        ``fwhm`` is not a number above 0; a value in the region is not finite.
    OtherSurface
        There are not as many values as vertices.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As in `distance_matrix`.

    Notes
    -----
    Kernels end at 4 standard deviations, 1.7 times ``fwhm``. Memory is that of the pairs within.

    Examples
    --------
    >>> ball = gc.samples.sphere(320)
    >>> cortex = gc.brain.load_cortex({"left": ball})
    >>> peak = np.zeros(162)
    >>> peak[0] = 1.0
    >>> spread = gc.brain.smooth(cortex, peak, fwhm=0.5)
    >>> bool(spread[0] < 0.2), round(float(spread @ cortex.areas / cortex.areas[0]), 12)
    (True, 1.0)
    """
    if not (is_number(fwhm) and 0.0 < fwhm < math.inf):
        raise InvalidArgument(f"fwhm is {fwhm!r}; it must be a finite number above 0")
    given = read_values(np.asarray(values), cortex.structures)
    inside = given[:, cortex.region]
    missing = np.argwhere(~np.isfinite(inside))
    if len(missing):
        vertex = int(cortex.region[missing[0, -1]])
        raise InvalidArgument(f"{cortex.in_words(vertex)} has no finite value: a roi leaves it out")
    sigma = fwhm / _FWHM
    near: Any = distance_matrix(
        cortex.mesh,
        cortex.region,
        max_distance=REACH * sigma,
        layout="sparse",
        threads=threads,
        progress=progress,
        cancel=cancel,
        deadline_s=deadline_s,
        memory_limit=memory_limit,
    )
    smoothed = np.full(given.shape, np.nan)
    smoothed[:, cortex.region] = spread(near, cortex.areas[cortex.region], inside, sigma)
    return smoothed.reshape(np.shape(values))
