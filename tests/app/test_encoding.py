from io import BytesIO

import numpy as np
import orjson
import pytest
from scipy.sparse import load_npz

from app.encoding import JSON, NPY, NPZ, OCTETS, Answer, encode, negotiate

ANSWER = Answer(
    {"mesh_id": "abc", "values": np.array([0.5, np.inf]), "stats": {"n": 1}, "warnings": ["π"]},
    ("values",),
)


def body(media_type: str) -> bytes:
    return b"".join(encode(ANSWER, media_type).parts)


def test_json_has_all_members_and_null_for_infinity() -> None:
    assert orjson.loads(body(JSON)) == {
        "mesh_id": "abc",
        "values": [0.5, None],
        "stats": {"n": 1},
        "warnings": ["π"],
    }


def test_npy_has_the_array_and_headers_the_rest() -> None:
    np.testing.assert_array_equal(np.load(BytesIO(body(NPY))), [0.5, np.inf])
    headers = encode(ANSWER, NPY).headers
    assert headers["Geodesic-Dtype"] == "<f8"
    assert headers["Geodesic-Shape"] == "2"
    assert headers["Geodesic-Mesh-Id"] == "abc"
    assert headers["Geodesic-Stats"] == '{"n":1}'
    assert orjson.loads(headers["Geodesic-Warnings"]) == ["π"]


def test_octets_are_the_bare_array() -> None:
    np.testing.assert_array_equal(np.frombuffer(body(OCTETS), "<f8"), [0.5, np.inf])


def test_binary_is_little_endian_and_in_c_order() -> None:
    array = np.asfortranarray(np.arange(6.0).reshape(2, 3)).astype(">f8")
    encoded = encode(Answer({"points": array}, ("points",)), OCTETS)

    found = np.frombuffer(b"".join(encoded.parts), "<f8").reshape(2, 3)
    np.testing.assert_array_equal(found, array)
    assert encoded.headers["Geodesic-Shape"] == "2,3"


@pytest.mark.parametrize("media_type", [JSON, NPY, OCTETS])
def test_empty_arrays(media_type: str) -> None:
    encoded = encode(Answer({"points": np.empty((0, 3))}, ("points",)), media_type)

    assert b"".join(encoded.parts) is not None


def test_npz_has_a_sparse_matrix_as_scipy_reads_it() -> None:
    members = {
        "mesh_id": "abc",
        "shape": (2, 3),
        "rows": np.array([1, 0, 1], np.int32),
        "columns": np.array([2, 1, 0], np.int32),
        "distances": np.array([0.5, 0.0, 2.0]),
    }
    encoded = encode(Answer(members, ("distances", "rows", "columns")), NPZ)

    table = load_npz(BytesIO(b"".join(encoded.parts)))
    assert table.shape == (2, 3)
    assert table.nnz == 3, "a distance of zero is one"
    assert table.toarray().tolist() == [[0, 0, 0], [2, 0, 0.5]]
    assert encoded.headers == {
        "Geodesic-Dtype": "<f8",
        "Geodesic-Shape": "2,3",
        "Geodesic-Mesh-Id": "abc",
    }


def test_long_members_are_left_out_of_headers() -> None:
    answer = Answer({"values": np.zeros(1), "sources": list(range(10_000))}, ("values",))

    assert "Geodesic-Sources" not in encode(answer, NPY).headers


@pytest.mark.parametrize(
    ("accept", "name", "expected"),
    [
        (None, None, JSON),
        ("*/*", None, JSON),
        ("application/*", None, JSON),
        ("application/x-npy", None, NPY),
        ("application/json;q=0.5, application/x-npy", None, NPY),
        ("application/octet-stream;q=0.9, text/html", None, OCTETS),
        ("application/json;q=0, */*", None, NPY),
        ("Application/JSON; charset=utf-8", None, JSON),
        ("application/json;q=high", None, JSON),
        ("text/html", None, None),
        ("text/html", "npy", NPY),
    ],
)
def test_negotiation(accept: str | None, name: str | None, expected: str | None) -> None:
    assert negotiate(accept, name) == expected
