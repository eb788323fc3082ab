import json
import tracemalloc
from dataclasses import replace
from io import BytesIO
from typing import Any

import numpy as np
import orjson
import pytest
from scipy.sparse import load_npz

from app.encoding import (
    CSV,
    JSON,
    NPY,
    NPZ,
    OBJ,
    OCTETS,
    PLY,
    Answer,
    Indices,
    Representation,
    Surface,
    Table,
    encode,
    negotiate,
)
from app.encoding.colours import colours_of
from app.queries.views import table_of_matrix, table_of_sparse

ANSWER = Answer(
    {"mesh_id": "abc", "values": np.array([0.5, np.inf]), "stats": {"n": 1}, "warnings": ["π"]},
    ("values",),
)


def body(media_type: str) -> bytes:
    return b"".join(encode(ANSWER, Representation(media_type))[0])


def test_json_has_all_members_and_null_for_infinity() -> None:
    assert orjson.loads(body(JSON)) == {
        "mesh_id": "abc",
        "values": [0.5, None],
        "stats": {"n": 1},
        "warnings": ["π"],
    }


def test_npy_has_the_array_and_headers_the_rest() -> None:
    np.testing.assert_array_equal(np.load(BytesIO(body(NPY))), [0.5, np.inf])
    _, headers = encode(ANSWER, Representation(NPY))
    assert headers["Geodesic-Dtype"] == "<f8"
    assert headers["Geodesic-Shape"] == "2"
    assert headers["Geodesic-Mesh-Id"] == "abc"
    assert headers["Geodesic-Stats"] == '{"n":1}'
    assert orjson.loads(headers["Geodesic-Warnings"]) == ["π"]


def test_octets_are_the_bare_array() -> None:
    np.testing.assert_array_equal(np.frombuffer(body(OCTETS), "<f8"), [0.5, np.inf])


def test_binary_is_little_endian_and_in_c_order() -> None:
    array = np.asfortranarray(np.arange(6.0).reshape(2, 3)).astype(">f8")
    parts, headers = encode(Answer({"points": array}, ("points",)), Representation(OCTETS))

    found = np.frombuffer(b"".join(parts), "<f8").reshape(2, 3)
    np.testing.assert_array_equal(found, array)
    assert headers["Geodesic-Shape"] == "2,3"


@pytest.mark.parametrize("media_type", [JSON, NPY, OCTETS])
def test_empty_arrays(media_type: str) -> None:
    answer = Answer({"points": np.empty((0, 3))}, ("points",))
    parts, _ = encode(answer, Representation(media_type))

    assert b"".join(parts) is not None


def test_npz_has_a_sparse_matrix_as_scipy_reads_it() -> None:
    members = {
        "mesh_id": "abc",
        "shape": (2, 3),
        "rows": np.array([1, 0, 1], np.int32),
        "columns": np.array([2, 1, 0], np.int32),
        "distances": np.array([0.5, 0.0, 2.0]),
    }
    parts, headers = encode(Answer(members, ("distances", "rows", "columns")), Representation(NPZ))

    table = load_npz(BytesIO(b"".join(parts)))
    assert table.shape == (2, 3)
    assert table.nnz == 3, "a distance of zero is one"
    assert table.toarray().tolist() == [[0, 0, 0], [2, 0, 0.5]]
    assert headers == {
        "Geodesic-Dtype": "<f8",
        "Geodesic-Shape": "2,3",
        "Geodesic-Mesh-Id": "abc",
    }


def test_blocks_make_one_document() -> None:
    """Above 2¹¹ values JSON is made in blocks; whole, by `json`, it has to read the same."""
    numbers = np.random.default_rng(0).random(20_000)
    numbers[::1000] = np.inf
    members: dict[str, Any] = {
        "numbers": numbers,
        "rows": numbers.reshape(-1, 4),
        "wide": np.ones((2, 5_000)),
        "bare": numbers[::2],
        "indices": Indices(np.arange(-1, 5_000)),
        "places": [{"face": i} for i in range(5_000)],
        "none": [],
        "empty": np.empty((0, 3)),
        "text": "π",
    }
    found = json.loads(b"".join(encode(Answer(members), Representation(JSON))[0]))

    plain = [x if np.isfinite(x) else None for x in numbers.tolist()]
    assert list(found) == list(members)
    assert found["numbers"] == plain
    assert found["rows"] == [plain[i : i + 4] for i in range(0, 20_000, 4)]
    assert found["wide"] == [[1.0] * 5_000] * 2
    assert found["bare"] == plain[::2]
    assert found["indices"] == [None, *range(5_000)]
    assert found["places"] == members["places"]
    assert (found["none"], found["empty"], found["text"]) == ([], [], "π")


MILLION = np.random.default_rng(1).random(1_000_000)
MANY = MILLION[:200_000]  # to watch each row's memory takes long
LARGE = Answer(
    {"distances": MILLION, "nearest_source": Indices(np.zeros(1_000_000, np.int32))},
    ("distances",),
    table=Table.of({"vertex": range(1_000_000), "distance": MILLION}),
    surface=Surface(np.zeros((1_000_000, 3)), np.zeros((1, 3), np.int32), {"distance": MILLION}),
)


@pytest.mark.slice(2)
@pytest.mark.parametrize(
    ("form", "most"),
    [
        (Representation(JSON), 1e6),
        (Representation(JSON, coding="gzip"), 2e6),
        (Representation(CSV), 3e6),
        (Representation(NPY), 1e5),
        (Representation(OCTETS), 1e5),
        (Representation(OCTETS, "float32"), 4.1e6),
        (Representation(PLY), 2e6),
    ],
)
def test_large_answers_are_never_there_as_a_whole(form: Representation, most: float) -> None:
    size, peak = size_and_peak(LARGE, form)
    assert size >= 4e6
    assert peak < most


@pytest.mark.slow
@pytest.mark.slice(1)
@pytest.mark.parametrize(
    "table",
    [
        table_of_matrix(MANY.reshape(500, 400)),
        table_of_matrix(MANY.reshape(2, 100_000)),
        table_of_matrix(MANY),
        table_of_sparse(np.arange(len(MANY)), np.arange(len(MANY)), MANY),
    ],
)
def test_large_matrices_become_rows_one_after_the_other(table: Table) -> None:
    size, peak = size_and_peak(Answer({}, table=table), Representation(CSV))
    assert size >= 5e6
    assert peak < 3e6


def size_and_peak(answer: Answer, form: Representation) -> tuple[int, int]:
    """Return how many bytes an answer has, and how many are in memory at most."""
    colours_of(np.zeros(1), 1.0)  # imports the colour map, whose memory is not the answer's
    tracemalloc.start()
    try:
        size = sum(map(len, encode(answer, form)[0]))
        return size, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_members_are_headers_where_they_are_short() -> None:
    answer = Answer({"points": [1] * 10**6, "status": "ok", "warnings": []}, shown=("points",))
    answer = replace(answer, lines=list)

    assert encode(answer, Representation(OBJ))[1] == {
        "Geodesic-Status": "ok",
        "Geodesic-Warnings": "[]",
    }


def test_long_members_are_left_out_of_headers() -> None:
    answer = Answer({"values": np.zeros(1), "sources": list(range(10_000))}, ("values",))

    assert "Geodesic-Sources" not in encode(answer, Representation(NPY))[1]


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
        ("application/json;q=0.5, */*", None, NPY),
        ("*/*;q=0.1, application/*;q=0.2, application/json;q=0.1", None, NPY),
        ("*/*, application/*;q=0", None, OBJ),
        ("*/*;q=0", None, None),
        ("application/json;q=0, application/json", None, JSON),
        # Of those liked equally, the client's first.
        ("text/csv, application/json", None, CSV),
        ("text/csv, */*", None, CSV),
        ("*/*, text/csv", None, JSON),
        ("application/json;q=0.5, text/*, text/csv;q=0.9, */*;q=0.9", None, CSV),
        ("application/json;q=nan", None, JSON),
        ("text/csv;q=-1, application/json;q=2", None, CSV),
        ("Application/JSON; charset=utf-8", None, JSON),
        ("application/json;q=high", None, JSON),
        ("text/html", None, None),
        ("text/html", "npy", NPY),
    ],
)
def test_negotiation(accept: str | None, name: str | None, expected: str | None) -> None:
    assert negotiate(accept, name) == expected
