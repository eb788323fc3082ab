"""The zoo holds the animals on its signs."""

import numpy as np
import pytest

from tests.support import zoo
from tests.support.oracles.graph import edge_lengths


def euler(case) -> int:
    return (
        len(np.unique(case.faces)) - len(edge_lengths(case.vertices, case.faces)) + len(case.faces)
    )


def total_angles(case) -> np.ndarray:
    total = np.zeros(len(case.vertices))
    for turn in range(3):
        a, b, c = (case.vertices[case.faces[:, (turn + k) % 3]] for k in range(3))
        u, v = b - a, c - a
        angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1))
        np.add.at(total, case.faces[:, turn], angle)
    return total


def aspect(case) -> np.ndarray:
    """Least height over longest side of each face."""
    corners = case.vertices[case.faces]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return area / sides.max(axis=1) ** 2


@pytest.mark.parametrize(
    ("name", "characteristic"),
    [
        ("cube", 2), ("sphere", 2), ("hills", 1), ("annulus", 0), ("obstacles", -3), ("prism", 0),
        ("torus", 0), ("frame", 0), ("double_frame", -2), ("two_components", 3), ("bow_tie", 1),
        ("bow_tie_of_fans", 1), ("pinched_cubes", 3), ("isolated_vertices", 2),
    ],
)  # fmt: skip
def test_euler_characteristics(name, characteristic):
    assert euler(zoo.SMALL[name]) == characteristic


@pytest.mark.parametrize("name", ["saddle", "saddle_cone", "crags", "torus", "frame", "open_fan"])
def test_saddles(name):
    assert total_angles(zoo.SMALL[name]).max() > (1.5 if name == "open_fan" else 2) * np.pi


@zoo.each(zoo.SMALL)
def test_small_is_small(case):
    assert len(case.faces) <= 150
    assert aspect(case).min() > 1e-4
    assert case.faces.max() < len(case.vertices)


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("slivers_1e-05", 1e-6, 1e-5), ("slivers_tilted", 1e-6, 1e-5),
        ("crowded_lines", 2e-6, 1e-5), ("needle_fan", 5e-6, 2e-5), ("caps", 1e-6, 1e-5),
        ("prism_slivers", 5e-6, 5e-5), ("pleats_slivers", 5e-6, 2e-5),
    ],
)  # fmt: skip
def test_slivers_are_slivers(name, least, most):
    assert least < aspect(zoo.KNOWN[name]).min() < most


@pytest.mark.parametrize("name", ["flat", "slivers_1e-05", "crowded_lines", "needle_fan", "caps"])
def test_planar_faces_do_not_overlap(name):
    corners = zoo.KNOWN[name].vertices[zoo.KNOWN[name].faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()


@pytest.mark.slow
@zoo.each(zoo.KNOWN)
def test_closed_forms_fit_the_edges(case):
    """An edge is a shortest path on its own two faces: no closed form may exceed it."""
    for source in (0, len(case.vertices) // 2):
        distances = case.distances(source)
        for (a, b), length in edge_lengths(case.vertices, case.faces).items():
            assert abs(distances[a] - distances[b]) <= length * (1 + 1e-9) + 1e-12
            if source in (a, b):
                assert distances[a] + distances[b] == pytest.approx(length, rel=1e-10)
