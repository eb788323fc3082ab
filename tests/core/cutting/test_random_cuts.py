"""Cuts of nasty small meshes along curves that cross, touch, overlap and nearly do."""

import numpy as np
import pytest

from tests.support.cuts import KINDS, check_cut, random_curves, random_mesh

pytestmark = [pytest.mark.jit, pytest.mark.slow, pytest.mark.slice(20)]


@pytest.mark.parametrize("seed", range(1000))
def test_a_cut_is_exact(seed):
    random = np.random.default_rng(seed)
    mesh = random_mesh(KINDS[seed % len(KINDS)], random)
    check_cut(mesh, random_curves(mesh, random))
