"""Tangent planes at the vertices: angles on the surface as vectors in space, and back."""

import math

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument
from tests.support import zoo
from tests.support.meshes import mesh_of


@zoo.each(zoo.SMALL | zoo.IRREGULAR)
def test_axes_are_orthonormal_and_angles_come_back(case):
    mesh = mesh_of(case)
    frames = mesh.tangent_frames()
    used = np.isin(np.arange(len(mesh.vertices)), mesh.faces)
    has_plane = used & np.isfinite(frames.x_axes).all(axis=1)
    axes = np.stack([frames.x_axes, frames.y_axes, frames.normals], axis=1)[has_plane]
    unit = np.broadcast_to(np.eye(3), axes.shape)
    np.testing.assert_allclose(axes @ axes.swapaxes(1, 2), unit, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(axes), 1.0, atol=1e-12)
    turns = np.random.default_rng(1).uniform(0.0, 0.99, len(mesh.vertices))
    angles = turns * frames.total_angles
    back = frames.angles(3.0 * frames.vectors(angles) + frames.normals)
    np.testing.assert_allclose(back[has_plane], angles[has_plane], atol=1e-11)


def test_directions_of_the_log_map_are_those_of_the_frames():
    mesh = gc.TriangleMesh(*zoo.grid(6, 5, seed=2, jitter=0.2))
    frames = mesh.tangent_frames()
    for source in range(len(mesh.vertices)):
        log_map = gc.log_map(mesh, source)
        away = mesh.vertices - mesh.vertices[source]
        seen = np.flatnonzero(log_map.distances > 0.0)
        turns = log_map.angles[seen][:, None]
        found = np.cos(turns) * frames.x_axes[source] + np.sin(turns) * frames.y_axes[source]
        ways = away[seen] / np.linalg.norm(away[seen], axis=1)[:, None]
        np.testing.assert_allclose(found, ways, atol=1e-13)


def test_normals_point_out_of_a_ball_however_its_faces_are_wound():
    vertices, faces = zoo.icosphere(2)
    frames = gc.TriangleMesh(vertices, faces).tangent_frames()
    np.testing.assert_allclose(frames.normals, vertices, atol=0.02)
    faces, _, _ = zoo.wound_at_random(faces, 4)
    lowest = np.array([np.flatnonzero((faces == v).any(axis=1))[0] for v in range(len(vertices))])
    corners = vertices[faces[lowest]]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sides = np.sign(np.einsum("vk,vk->v", outward, vertices))
    frames = gc.TriangleMesh(vertices, faces).tangent_frames()
    np.testing.assert_allclose(frames.normals, sides[:, None] * vertices, atol=0.02)


def test_a_vector_along_the_normal_has_no_angle():
    frames = gc.TriangleMesh(*zoo.grid(2, 2)).tangent_frames()
    assert np.isnan(frames.angles(np.zeros((9, 3)))).all()
    assert frames.total_angles[4] == pytest.approx(2.0 * math.pi)


@pytest.mark.parametrize("angles", [np.zeros(8), np.zeros((9, 3)), "north", [[0.0], [0.0, 1.0]]])
def test_there_is_one_angle_for_each_vertex(angles):
    frames = gc.TriangleMesh(*zoo.grid(2, 2)).tangent_frames()
    with pytest.raises(InvalidArgument, match="one row for each vertex"):
        frames.vectors(angles)
    with pytest.raises(InvalidArgument, match="one row for each vertex"):
        frames.angles(np.zeros(9))
