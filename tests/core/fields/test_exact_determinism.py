"""The same question has the same answer, to the bit, whoever asks and however often."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo


def answer(mesh, source):
    field = gc.exact_distance(mesh, [source, 0])
    return field.distances.tobytes(), field.nearest_source.tobytes()


@pytest.mark.parametrize("name", ["crags", "torus", "double_frame", "pinched_holes"])
def test_two_runs_agree(name):
    case = zoo.SMALL[name]
    meshes = [gc.TriangleMesh(case.vertices, case.faces) for _ in range(2)]
    assert answer(meshes[0], 7) == answer(meshes[0], 7) == answer(meshes[1], 7)


@pytest.mark.jit
def test_threads_that_share_a_mesh_do_not_disturb_one_another():
    vertices, faces = zoo.icosphere(4)
    mesh = gc.TriangleMesh(zoo.crumpled(vertices, 0.02, seed=1), faces)
    sources = [3, 500, 1000, 3, 500, 1000, 42, 3]
    alone = [answer(mesh, source) for source in sources]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda source: answer(mesh, source), sources)) == alone


def test_the_mesh_is_not_written_to():
    case = zoo.SMALL["crags"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    before = {name: array.tobytes() for name, array in mesh.arrays().items()}
    gc.exact_distance(mesh, 0).path_to(len(case.vertices) - 1)
    assert before == {name: array.tobytes() for name, array in mesh.arrays().items()}
    assert not any(array.flags.writeable for array in mesh.arrays().values())


def test_a_mesh_from_its_arrays_answers_alike():
    case = zoo.SMALL["crumpled_torus"]
    mesh = gc.TriangleMesh(case.vertices, case.faces)
    stored = gc.TriangleMesh.from_arrays(mesh.arrays())
    assert answer(stored, 11) == answer(mesh, 11)


def test_callers_arrays_stay_theirs():
    case = zoo.SMALL["hills"]
    vertices, faces = case.vertices.copy(), case.faces.copy()
    mesh = gc.TriangleMesh(vertices, faces)
    first = gc.exact_distance(mesh, 0).distances
    vertices *= 2
    faces[:] = faces[::-1]
    np.testing.assert_array_equal(gc.exact_distance(mesh, 0).distances, first)
    np.testing.assert_array_equal(mesh.vertices, case.vertices)
    np.testing.assert_array_equal(mesh.faces, case.faces)
