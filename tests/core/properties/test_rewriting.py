"""However a surface is written, the distances on it are the same: of vertices and of points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_core as gc
from tests.core.properties.test_approximate import split_cases
from tests.core.properties.test_exact import EXACT, seeds
from tests.support.approximation import ERRORS, check_within
from tests.support.meshes import mesh_of
from tests.support.random_meshes import IRREGULAR_KINDS, KINDS, cases
from tests.support.rewriting import REWRITINGS, Rewritten

SAME = 1e-12
"""Of the diagonal: how far points may move that are written otherwise."""

surfaces = cases(KINDS + IRREGULAR_KINDS)
finer = st.one_of(surfaces, split_cases())
rewritings = st.lists(st.sampled_from(REWRITINGS), min_size=1, max_size=4, unique=True).map(
    lambda some: sorted(some, key=REWRITINGS.index)
)


class Pair:
    """A mesh and the same one rewritten, with points of both."""

    def __init__(self, case, seed, rewritings) -> None:
        rng = np.random.default_rng(seed)
        self.mesh, rewritten = mesh_of(case), Rewritten.of(case)
        for rewrite in rewritings:
            rewritten = rewrite(rng, rewritten)
        self.other, self.scale = rewritten.mesh(), rewritten.scale
        spellings = [(int(face), _weights(rng, kind)) for kind, face in enumerate(
            rng.integers(0, len(case.faces), 6)
        )]  # fmt: skip
        self.points = [gc.SurfacePoint.face(*spelling) for spelling in spellings]
        self.moved = [rewritten.point(*spelling) for spelling in spellings]
        self.used = np.unique(case.faces)
        self.vertices = self._numbers(case, rewritten)
        self.close = {"rtol": EXACT, "atol": SAME * self.mesh.diagonal}

    def _numbers(self, case, rewritten) -> np.ndarray:
        """Of each used vertex, the number in the other mesh."""
        numbers = []
        for vertex in self.used:
            face, corner = np.argwhere(case.faces == vertex)[0]
            point = self.other.point(rewritten.point(int(face), np.eye(3)[corner]))
            numbers.append(point.vertex_index)
        return np.array(numbers)


def _weights(rng, kind) -> np.ndarray:
    """At a vertex, on an edge, or inside, by turns."""
    weights = rng.dirichlet([1, 1, 1])
    if kind % 3 == 0:
        return np.eye(3)[rng.integers(3)]
    if kind % 3 == 1:
        weights[rng.integers(3)] = 0.0
        weights /= weights.sum()
    return weights


@given(surfaces, seeds, rewritings)
def test_exact_distances_stay(case, seed, rewritings):
    pair = Pair(case, seed, rewritings)
    for source, moved in zip(pair.points, pair.moved, strict=True):
        field = gc.exact_distance(pair.mesh, source, targets=pair.points)
        found = gc.exact_distance(pair.other, moved, targets=pair.moved)
        expected = field.distances[pair.used]
        np.testing.assert_allclose(
            found.distances[pair.vertices] / pair.scale, expected, **pair.close
        )
        np.testing.assert_allclose(
            [found.distance_at(point) / pair.scale for point in pair.moved],
            [field.distance_at(point) for point in pair.points],
            **pair.close,
        )


@given(finer, seeds, rewritings, st.sampled_from(ERRORS))
def test_approximate_distances_stay_within_the_error(case, seed, rewritings, error):
    pair = Pair(case, seed, rewritings)
    for source, moved in list(zip(pair.points, pair.moved, strict=True))[:3]:
        field = gc.exact_distance(pair.mesh, source, targets=pair.points)
        found = gc.approximate_distance(
            pair.other, moved, error, targets=pair.moved, retain="paths"
        )
        near = [found.distance_at(point) for point in pair.moved]
        near = np.concatenate([found.distances[pair.vertices], near]) / pair.scale
        exact = [field.distance_at(point) for point in pair.points]
        exact = np.concatenate([field.distances[pair.used], exact])
        away = exact > SAME * pair.mesh.diagonal
        check_within(near[away], exact[away], error)
        assert (near[~away] <= SAME * pair.mesh.diagonal).all()
        for target, distance in zip(pair.moved, exact[-len(pair.moved) :], strict=True):
            if np.isfinite(distance):
                length = found.path_to(target).length / pair.scale
                assert length >= distance * (1 - EXACT) - pair.close["atol"]
                assert length <= distance * (1 + error + EXACT) + pair.close["atol"]


@given(finer, seeds, rewritings)
def test_lengths_of_paths_stay(case, seed, rewritings):
    pair = Pair(case, seed, rewritings)
    solver = gc.Solver(pair.other)
    for i, j in [(0, 1), (1, 2), (2, 0), (2, 5), (4, 3)]:
        distance = gc.exact_distance(pair.mesh, pair.points[i]).distance_at(pair.points[j])
        if np.isinf(distance):
            with pytest.raises(gc.errors.NoPath):
                solver.shortest_path(pair.moved[i], pair.moved[j])
            continue
        path = solver.shortest_path(pair.moved[i], pair.moved[j])
        np.testing.assert_allclose(path.length / pair.scale, distance, **pair.close)
