import numpy as np
import pytest

from app.engine.mesh_json import read_json_mesh
from app.errors import ProblemError


def test_reads_vertices_and_faces() -> None:
    read = read_json_mesh(b'{"vertices": [[0, 0, 0], [1.5, 0, 0]], "faces": [[0, 1, 1]]}')

    np.testing.assert_array_equal(read.vertices, [[0, 0, 0], [1.5, 0, 0]])
    np.testing.assert_array_equal(read.faces, [[0, 1, 1]])
    assert read.lengths is None


def test_reads_lengths_in_place_of_vertices_or_beside_them() -> None:
    alone = read_json_mesh(b'{"faces": [[0, 1, 2]], "lengths": [[3, 4, 5.5]]}')
    np.testing.assert_array_equal(alone.lengths, [[3, 4, 5.5]])
    assert alone.vertices is None
    drawn = read_json_mesh(
        b'{"faces": [[0, 0, 0]], "lengths": [[3, 4, 5]], "vertices": [[1, 2, 3]]}'
    )
    np.testing.assert_array_equal(drawn.vertices, [[1, 2, 3]])


@pytest.mark.parametrize(
    ("body", "code", "place"),
    [
        (b"{", "malformed_body", None),
        (b'{"vertices": [[NaN, 0, 0]], "faces": [[0, 0, 0]]}', "malformed_body", None),
        (b"[]", "invalid_request", ""),
        (b'{"faces": [[0, 1, 2]]}', "invalid_request", "/vertices"),
        (b'{"vertices": [[0, 0, 0]], "faces": [], "x/y": 1}', "invalid_request", "/x~1y"),
        (b'{"vertices": 7, "faces": [[0, 1, 2]]}', "invalid_request", "/vertices"),
        (b'{"vertices": [[0, 0, 0], [0, 0]], "faces": []}', "invalid_request", "/vertices/1"),
        (b'{"vertices": [[0, 0, 0], ["1", 0, 0]], "faces": []}', "invalid_request", "/vertices/1"),
        (b'{"vertices": [[0, 0, null]], "faces": []}', "invalid_request", "/vertices/0"),
        (b'{"vertices": [[true, false, true]], "faces": []}', "invalid_request", "/vertices/0"),
        (
            b'{"vertices": [[0, 0, 0], [1, true, 0.5]], "faces": []}',
            "invalid_request",
            "/vertices/1",
        ),
        (b'{"vertices": [[0, 0, 0]], "faces": [[0, false, 2]]}', "invalid_request", "/faces/0"),
        (b'{"vertices": true, "faces": [false]}', "invalid_request", "/vertices"),
        (b'{"vertices": [], "faces": []}', "invalid_request", "/vertices"),
        (b'{"vertices": [[0, 0, 0]], "faces": [[0, 1.5, 2]]}', "invalid_request", "/faces/0"),
        (b'{"vertices": [[0, 0, 0]], "faces": [[0, 1, 2, 3]]}', "invalid_request", "/faces/0"),
        (b'{"lengths": [[1, 1, 1]]}', "invalid_request", "/faces"),
        (b'{"faces": [[0, 1, 2]], "lengths": null}', "invalid_request", "/lengths"),
        (b'{"faces": [[0, 1, 2]], "lengths": [[1, 1]]}', "invalid_request", "/lengths/0"),
        (b'{"faces": [[0, 1, 2]], "lengths": [[1, true, 1]]}', "invalid_request", "/lengths/0"),
    ],
)
def test_says_what_is_wrong_where(body: bytes, code: str, place: str | None) -> None:
    with pytest.raises(ProblemError) as caught:
        read_json_mesh(body)

    assert caught.value.problem.code == code
    assert [fault.pointer for fault in caught.value.problem.errors] == (
        [] if place is None else [place]
    )
