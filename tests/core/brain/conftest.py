"""Both hemispheres of a small folded cortex."""

import numpy as np
import pytest

import geodesic_core as gc
from tests.support.folded import folded, is_cortex

SIDES = ("left", "right")


@pytest.fixture(scope="session")
def surfaces() -> dict[str, gc.TriangleMesh]:
    return {side: folded(side) for side in SIDES}


@pytest.fixture(scope="session")
def masks(surfaces: dict[str, gc.TriangleMesh]) -> dict[str, np.ndarray]:
    return {side: is_cortex(mesh) for side, mesh in surfaces.items()}
