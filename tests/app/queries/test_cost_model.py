"""The cost model follows decisions of the library."""

from app.queries import cost_model
from geodesic_core.matrices import matrix


def test_pairs_are_swept_from_as_many_as_in_the_library() -> None:
    assert cost_model.SWEPT_FROM == matrix.SWEEP_FROM
