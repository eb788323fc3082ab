"""Points anywhere on random meshes, non-manifold ones among them, by the unfolding oracle."""

import numpy as np
import pytest
from hypothesis import given

import geodesic_core as gc
from tests.core.fields.test_points import random_points
from tests.core.properties.test_exact import EXACT, seeds
from tests.support.meshes import mesh_of
from tests.support.oracles import unfolding
from tests.support.random_meshes import KINDS, blocks, cases, moebius, pages, wound
from tests.support.splitting import split_at


@given(cases((*KINDS, wound, moebius, blocks, pages)), seeds)
def test_points_agree_with_the_oracle(case, seed):
    """Which knows vertices only: there is one at each point of its mesh."""
    mesh = mesh_of(case)
    points = random_points(mesh, 3, seed)
    vertices, faces, at = split_at(mesh, points)
    matrix = unfolding.distance_matrix(vertices, faces)
    solver, close = gc.Solver(mesh), {"rtol": EXACT, "atol": 1e-13 * mesh.diagonal}
    for source, v in zip(points, at, strict=True):
        field = gc.exact_distance(mesh, source)
        np.testing.assert_allclose(field.distances, matrix[v, : len(case.vertices)], **close)
        for target, w in zip(points, at, strict=True):
            np.testing.assert_allclose(field.distance_at(target), matrix[v, w], **close)
            if np.isfinite(matrix[v, w]):
                length = solver.shortest_path(source, target).length
                np.testing.assert_allclose(length, matrix[v, w], **close)
            else:
                with pytest.raises(gc.errors.NoPath):
                    solver.shortest_path(source, target)
