"""Validation of arguments."""

import math
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats, Longs
from geodesic_core.errors import InvalidArgument, InvalidPoint
from geodesic_core.tolerances import LARGEST_COORDINATE


def is_number(value: Any) -> bool:
    """Tell whether a value is a real number that a float can hold, and not a truth value."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return isinstance(value, float | np.floating | np.integer)


def is_index(value: Any) -> bool:
    """Tell whether a value is an integer, and not a truth value."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def unboxed(value: Any) -> Any:
    """Return the value in an array of no dimensions, and anything else as it is."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def as_vector(name: str, value: Any) -> Floats:
    """Return a vector in space, (3,).

    Raises
    ------
    InvalidArgument
        It is not three finite numbers; ``name`` is the argument's.
    """
    try:
        vector = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InvalidArgument(f"{name} is {value!r}; it must be a vector of three finite numbers")
    return vector


def as_places(name: str, places: Any, dimensions: int) -> tuple[list[tuple[str, Floats]], bool]:
    """Return places in space or in the plane, each with its name, and whether one was given.

    Raises
    ------
    InvalidPoint
        One is not so many finite numbers in the range that vertices may have.
    """
    try:
        given = np.asarray(places, np.float64)
    except (TypeError, ValueError):
        given = np.empty(0)
    numbers = {2: "two", 3: "three"}[dimensions]
    if given.ndim not in (1, 2) or given.shape[-1] != dimensions:
        raise InvalidPoint(
            f"the {name} is {places!r}; it must be {numbers} finite numbers, or an array of such "
            f"rows"
        )
    is_one = given.ndim == 1
    rows = [(name if is_one else f"{name} {i}", row) for i, row in enumerate(np.atleast_2d(given))]
    for called, row in rows:
        if not (np.abs(row) <= LARGEST_COORDINATE).all():
            raise InvalidPoint(
                f"the {called} is {row.tolist()}; it must be {numbers} finite numbers, at most "
                f"{LARGEST_COORDINATE:g} in size"
            )
    return rows, is_one


def as_angle(angle: float) -> float:
    """Return an angle, radians.

    Raises
    ------
    InvalidArgument
        It is not a finite number.
    """
    if not is_number(angle) or not math.isfinite(angle):
        raise InvalidArgument(f"angle is {angle!r}; it must be a finite number, in radians")
    return float(angle)


def as_nonnegative(name: str, values: ArrayLike, count: int) -> Floats:
    """Return so many numbers, 0 or more; a single one stands for all.

    Raises
    ------
    InvalidArgument
        They are none.
    """
    try:
        given = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        given = np.empty(0)
    if given.shape not in ((), (count,)):
        raise InvalidArgument(
            f"{name} has shape {np.shape(values)}; it must be numbers, ({count},)"
        )
    given = np.broadcast_to(given, (count,))
    bad = np.flatnonzero(~(np.isfinite(given) & (given >= 0.0)))
    if len(bad):
        raise InvalidArgument(
            f"{name}[{bad[0]}] is {given[bad[0]]}; it must be a number, 0 or more"
        )
    return given


def as_limit(limit: float | None, name: str = "max_distance") -> float:
    """Return a limit, infinite for None; ``name`` is the argument's.

    Raises
    ------
    InvalidArgument
        It is not a number, 0 or more.
    """
    if limit is None:
        return math.inf
    if not is_number(limit) or not limit >= 0.0:
        raise InvalidArgument(f"{name} is {limit!r}; it must be a number, 0 or more")
    return float(limit)


def check_choice(name: str, value: Any, choices: Sequence[str]) -> None:
    """Refuse a value that is none of some words; ``name`` is the argument's.

    Raises
    ------
    InvalidArgument
        It is none of them.
    """
    if not isinstance(value, str) or value not in choices:
        *others, last = map(repr, choices)
        raise InvalidArgument(f"{name} is {value!r}; it must be {', '.join(others)} or {last}")


def as_barriers(barriers: Any, face_count: int) -> Longs:
    """Return face ids, ascending and each once.

    Raises
    ------
    InvalidArgument
        They are not integers from 0 to ``face_count`` - 1. A mask is refused: as a list it could
        not be told from ids.
    """
    barriers = unboxed(barriers)
    if isinstance(barriers, tuple | list) and not barriers:
        return np.empty(0, np.int64)  # as mostly: what follows takes 3 % of a short search
    if isinstance(barriers, str | bytes) or not isinstance(barriers, Iterable):
        raise InvalidArgument(f"barriers is {barriers!r}; it must be a sequence of face ids")
    if isinstance(barriers, np.ndarray) and barriers.dtype.kind in "iu" and barriers.ndim == 1:
        faces = barriers
    else:
        faces = np.array([None, *barriers], dtype=object)[1:]  # rows stay rows
        one_of_each_type = {type(face): face for face in faces}
        if not all(map(is_index, one_of_each_type.values())):
            i = next(i for i, face in enumerate(faces) if not is_index(face))
            raise InvalidArgument(
                f"barrier {i} is {faces[i]!r}; it must be a face id, an integer (for a mask, use "
                "numpy.flatnonzero)"
            )
    bad = np.flatnonzero((faces < 0) | (faces >= face_count))
    if len(bad):
        raise InvalidArgument(
            f"barrier {bad[0]} is face {faces[bad[0]]}, but faces are numbered 0 to "
            f"{face_count - 1}"
        )
    return np.unique(faces.astype(np.int64))
