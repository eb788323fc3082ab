"""What the oracles say of the zoo, computed once per run; and where real meshes may be found."""

import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.oracles import unfolding
from tests.zoo import Case

MESHES = Path(os.environ.get("MESHES", Path(__file__).parents[1] / "../shared/meshes"))
"""A folder of other people's meshes, not part of the project: ``MESHES`` names another."""


@cache
def matrix(case: Case) -> np.ndarray:
    """Exact distances (V, V) of a mesh of the small zoo."""
    return unfolding.distance_matrix(case.vertices, case.faces)


def real_mesh(name: str) -> Path:
    """The path of a real mesh; skips the test where it is absent."""
    path = MESHES / name
    if not path.exists():
        pytest.skip(f"{name} is not in the meshes folder; set MESHES to one that has it")
    return path
