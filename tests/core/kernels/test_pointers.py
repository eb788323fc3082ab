"""Raw pointers within kernels, compiled and as plain Python."""

import numba
import numpy as np
import pytest

from geodesic_core.kernels.jit import pointer
from geodesic_core.kernels.jit.pointers import _interpreted_pointer


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
