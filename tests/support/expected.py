"""The oracles' distances on the zoo, computed once per run."""

from functools import cache

import numpy as np

from tests.support.oracles import unfolding
from tests.support.zoo import Case


@cache
def matrix(case: Case) -> np.ndarray:
    """Exact distances (V, V) of a mesh of the small zoo."""
    return unfolding.distance_matrix(case.vertices, case.faces)
