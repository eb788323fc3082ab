"""Raw pointers within kernels, compiled and as plain Python."""

from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from geodesic_core.arrays import ABSENT
from geodesic_core.kernels.jit import borrowed, pointer, rows_of
from geodesic_core.kernels.jit.pointers import (
    _interpreted_borrowed,
    _interpreted_pointer,
    _type_of_pointers,
)


class Pair(NamedTuple):
    rows: Any
    scale: float


class Group(NamedTuple):
    pair: Pair
    ids: Any


def second_of_flat(array):
    return pointer(array)[array.shape[1]]


@pytest.mark.parametrize("dtype", [np.float64, np.int32, np.uint8])
def test_a_pointer_is_a_flat_view(dtype):
    array = np.arange(12, dtype=dtype).reshape(3, 4)
    assert numba.njit(second_of_flat)(array) == 4
    assert _interpreted_pointer(array)[4] == 4


def test_a_pointer_writes_through():
    def write(array):
        pointer(array)[5] = 42.0

    array = np.zeros((2, 3))
    numba.njit(write)(array)
    assert array[1, 2] == 42.0
    _interpreted_pointer(array)[0] = 7.0
    assert array[0, 0] == 7.0


def test_rows_are_counted_but_of_what_is_absent():
    @numba.njit
    def rows_in(pair):
        return rows_of(pair.rows)

    for pair, rows in ((Pair(np.ones((3, 2)), 1.0), 3), (Pair(ABSENT, 1.0), ABSENT)):
        assert rows_in(pair) == rows_of(pair.rows) == rows


def test_groups_of_pointers_have_short_names_of_their_own():
    """By which the compiler tells the versions of a kernel apart."""
    arrays = np.ones((3, 2)), np.ones(3, np.int32), ABSENT
    groups = [Group(Pair(rows, 1.0), ids) for rows in arrays for ids in arrays]
    before = [str(numba.typeof(group)) for group in groups]
    *names, without_arrays = [str(_type_of_pointers(numba.typeof(group))) for group in groups]
    assert len({*names, without_arrays}) == len(groups)
    assert max(map(len, names)) < 30
    # The names of the groups themselves are part of the names of kernels on disk.
    assert [str(numba.typeof(group)) for group in groups] == before
    assert without_arrays == before[-1]


def scale_a_row(group):
    group = borrowed(group)
    row = borrowed(group.pair.rows[group.ids[0]])
    for column in range(len(row)):
        row[column] *= group.pair.scale


def test_a_borrowed_group_is_the_same_arrays():
    group = Group(Pair(np.ones((2, 3)), 4.0), np.array([1], np.int32))
    numba.njit(scale_a_row)(group)
    assert group.pair.rows.tolist() == [[1.0, 1.0, 1.0], [4.0, 4.0, 4.0]]
    assert _interpreted_borrowed(group) is group


@pytest.mark.slow
def test_the_owner_of_a_borrowed_array_keeps_it():
    @numba.njit
    def fill(row, value):
        row = borrowed(row)
        for column in range(len(row)):
            row[column] = value

    @numba.njit
    def filled(count):
        rows = np.empty((count, 3))
        for i in range(count):
            fill(rows[i], float(i))
        return rows

    assert (filled(1000) == np.arange(1000)[:, None]).all()
