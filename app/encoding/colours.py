"""The colour map viridis: equal steps look equal, in shades of grey as well."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

_GREY = 128, 128, 128
_STEPS = 256


def largest_of(values: NDArray[np.floating[Any]]) -> float:
    """Return the largest finite value, or 0."""
    return float(values.max(where=np.isfinite(values), initial=0.0))


def colours_of(values: NDArray[np.floating[Any]], largest: float) -> NDArray[np.uint8]:
    """Return the colours (N, 3) of values from 0 to the ``largest``; grey for infinite ones."""
    is_finite = np.isfinite(values)
    shades = np.where(is_finite, values, 0.0) / (largest or 1.0)
    colours: NDArray[np.uint8] = _table()[np.rint(shades * (_STEPS - 1)).astype(np.intp)]
    colours[~is_finite] = _GREY
    return colours


@cache
def _table() -> NDArray[np.uint8]:
    from cmap import Colormap

    return np.rint(255.0 * Colormap("viridis").lut(_STEPS)[:, :3]).astype(np.uint8)
