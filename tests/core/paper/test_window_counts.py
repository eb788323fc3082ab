"""The paper's counts of windows, on meshes a few sizes smaller."""

import itertools
import math

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo

pytestmark = pytest.mark.jit


def windows(vertices, faces) -> gc.SweepStats:
    return gc.exact_distance(gc.TriangleMesh(vertices, faces), 0).stats


def saddle(level):
    """A smooth saddle over the square, refined by halves."""
    count = 4 * 2**level
    points, faces = zoo.grid(count, count)
    points = points / count - (0.5, 0.5, 0)
    points[:, 2] = points[:, 0] ** 2 - points[:, 1] ** 2
    return points, faces


@pytest.mark.parametrize(
    ("surface", "levels"),
    [
        (zoo.icosphere, (3, 4, 5)),
        (saddle, (2, 3, 4)),
        (lambda level: zoo.torus(16 * 2**level, 8 * 2**level), (1, 2, 3)),
        pytest.param(zoo.icosphere, (5, 6, 7), marks=pytest.mark.full),
    ],
    ids=["sphere", "saddle", "torus", "fine sphere"],
)
def test_windows_grow_as_n_to_the_power_of_three_halves(surface, levels):
    """Figure 6: each subdivision makes 4 times the faces and about 8 times the windows."""
    counts = [windows(*surface(level)).windows_created for level in levels]
    exponents = [math.log(b / a, 4) for a, b in itertools.pairwise(counts)]
    assert all(1.3 <= exponent <= 1.6 for exponent in exponents), exponents


def test_noise_reduces_windows():
    """Figure 7: on a rough knot adjacent windows annihilate each other."""
    sample = gc.samples.knot(20_000)
    vertices, faces = sample.vertices, sample.faces
    edge = np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1).mean()
    per_edge = [
        windows(zoo.crumpled(vertices, noise * edge, seed=1), faces).windows_per_edge_created
        for noise in (0, 0.1, 0.2, 0.4, 0.8)
    ]
    assert per_edge == sorted(per_edge, reverse=True)
    assert per_edge[-1] < 0.4 * per_edge[0]
