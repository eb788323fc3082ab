"""Selection among the distances of a row's targets."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from geodesic_core.kernels.front.rows import nth_least

distances = st.one_of(
    st.floats(0.0, math.inf),
    st.sampled_from([0.0, 1.0, 2.0, math.inf]),  # with ties
)


@given(st.lists(distances, min_size=1, max_size=40), st.data())
def test_the_nth_least_is_that_of_the_sorted_values(values, data):
    n = data.draw(st.integers(0, len(values) - 1))
    beyond = [-1.0, -2.0]  # values that do not count
    array = np.array(values + beyond)
    assert nth_least(array, len(values), n) == sorted(values)[n]
    assert sorted(array[: len(values)].tolist()) == sorted(values)
    assert array[len(values) :].tolist() == beyond
