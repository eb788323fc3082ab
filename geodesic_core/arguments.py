"""What arguments must be."""

import math
from typing import Any

import numpy as np

from geodesic_core.errors import InvalidArgument


def is_number(value: Any) -> bool:
    """Whether a value is a real number, and not a truth value."""
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def is_index(value: Any) -> bool:
    """Whether a value is an integer, and not a truth value."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def as_limit(max_distance: float | None) -> float:
    """Return a distance, infinite for None.

    Raises
    ------
    InvalidArgument
        It is not a number, 0 or more.
    """
    if max_distance is None:
        return math.inf
    if not is_number(max_distance) or not max_distance >= 0.0:
        raise InvalidArgument(f"max_distance is {max_distance!r}; it must be a number, 0 or more")
    return float(max_distance)
