import bz2
import gzip
import json
import tempfile
import threading
import zipfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any, get_args

import numpy as np
import pytest
from nibabel.gifti import GiftiDataArray, GiftiImage
from starlette.testclient import TestClient

import geodesic_core as gc
from app.cli.arguments import SampleName
from app.schemas import meshes as schemas
from app.settings import Settings
from app.store.mesh_home import MeshHome
from geodesic_core import samples
from geodesic_core.io.load import _READERS
from tests.support.service import (
    ServiceClient,
    check_problem,
    serving,
    stored_mesh,
    upload_sample,
)


def zipped(name: str, content: str) -> bytes:
    archive = BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(name, content)
    return archive.getvalue()


TETRAHEDRON = {
    "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "faces": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
}
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in TETRAHEDRON["vertices"]) + "".join(
    f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in TETRAHEDRON["faces"]
)
OFF = "OFF\n4 4 0\n" + "".join(
    " ".join(map(str, row)) + "\n"
    for row in [*TETRAHEDRON["vertices"], *([3, *face] for face in TETRAHEDRON["faces"])]
)
GIFTI = GiftiImage(
    darrays=[
        GiftiDataArray(np.array(TETRAHEDRON["vertices"], np.float32), "NIFTI_INTENT_POINTSET"),
        GiftiDataArray(np.array(TETRAHEDRON["faces"], np.int32), "NIFTI_INTENT_TRIANGLE"),
    ]
).to_bytes()
FREESURFER = (
    b"\xff\xff\xfeby hand\n\n"
    + np.array([4, 4], ">i4").tobytes()
    + np.array(TETRAHEDRON["vertices"], ">f4").tobytes()
    + np.array(TETRAHEDRON["faces"], ">i4").tobytes()
)
VTK = "# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n" + "".join(
    [" ".join(map(str, row)) + "\n" for row in TETRAHEDRON["vertices"]]
    + ["POLYGONS 4 16\n"]
    + [" ".join(map(str, [3, *face])) + "\n" for face in TETRAHEDRON["faces"]]
)
TYPE_OBJ = {"Content-Type": "model/obj"}
TYPE_BYTES = {"Content-Type": "application/octet-stream"}
GZIPPED = {**TYPE_OBJ, "Content-Encoding": "gzip"}


def test_upload_answers_with_a_report(client: TestClient) -> None:
    response = client.post("/v1/meshes", json=TETRAHEDRON)

    assert response.status_code in (200, 201)
    report = response.json()
    assert response.headers["location"] == f"/v1/meshes/{report['id']}"
    assert "load;dur=" in response.headers["server-timing"]
    assert (report["vertices"], report["faces"], report["edges"]) == (4, 4, 6)
    assert report["euler_characteristic"] == 2
    assert report["boundary_loops"] == 0
    assert report["bounds"] == [[0, 0, 0], [1, 1, 1]]
    assert client.get(response.headers["location"]).json() == report


@pytest.mark.parametrize(
    "upload",
    [
        {"json": TETRAHEDRON},
        {"content": OBJ, "params": {"format": "obj"}},
        {"content": OBJ, "headers": TYPE_OBJ},
        {"content": OFF, "params": {"format": "off"}},
        {"content": OFF, "params": {"format": "off"}, "headers": TYPE_OBJ},
        {"content": iter([OBJ.encode()]), "headers": TYPE_OBJ},
        {"content": gzip.compress(OBJ.encode()), "headers": GZIPPED},
        {"content": iter([gzip.compress(OBJ.encode(), 1)]), "headers": GZIPPED},
        {
            "content": gzip.compress(OBJ[:50].encode()) + gzip.compress(OBJ[50:].encode()),
            "headers": {**TYPE_OBJ, "Content-Encoding": "GZIP"},
        },
        {"content": OBJ, "headers": {**TYPE_OBJ, "Content-Encoding": "identity"}},
        {"content": OBJ, "params": {"format": "OBJ"}},
        {"content": OBJ, "headers": {"Content-Disposition": 'attachment; filename="t.obj"'}},
        {
            "content": OBJ,
            "headers": {**TYPE_BYTES, "Content-Disposition": "inline; filename=t.OBJ"},
        },
        {"content": OBJ, "headers": {"Content-Disposition": "inline; filename*=UTF-8''%CE%94.obj"}},
        {"content": OFF},
        {"content": OFF, "headers": TYPE_BYTES},
        {"content": gzip.compress(OFF.encode())},
        {"files": {"file": ("tetrahedron.obj.gz", gzip.compress(OBJ.encode()))}},
        {"files": {"file": ("tetrahedron", bz2.compress(OFF.encode()))}},
        {"files": {"file": ("tetrahedron.zip", zipped("tetrahedron.obj", OBJ))}},
        {"files": {"file": ("tetrahedron.json", json.dumps(TETRAHEDRON))}},
        {"files": {"file": ("tetrahedron.surf.gii", GIFTI)}},
        {"content": GIFTI, "params": {"format": "Gii"}},
        {"files": {"file": ("tetrahedron.surf.gii.gz", gzip.compress(GIFTI))}},
        {"files": {"file": ("lh.tetrahedron", FREESURFER)}},
        {"content": VTK, "params": {"format": "vtk"}},
        {"files": {"file": ("tetrahedron.vtp", VTK)}},
        {"files": {"file": ("tetrahedron.OBJ", OBJ)}},
        {"files": {"mesh": ("tetrahedron", OBJ, "model/obj")}},
        {"files": {"mesh": ("tetrahedron", OBJ)}, "params": {"format": "obj"}},
    ],
)
def test_all_spellings_of_a_mesh_are_one(client: TestClient, upload: dict) -> None:
    mesh_id = client.post("/v1/meshes", json=TETRAHEDRON).json()["id"]

    response = client.post("/v1/meshes", **upload)

    assert response.status_code == 200
    assert response.json()["id"] == mesh_id


def test_new_is_201_and_known_is_200(client: TestClient) -> None:
    mesh = {**TETRAHEDRON, "vertices": [[0, 0, 0], [7, 0, 0], [0, 7, 0], [0, 0, 7]]}

    assert [client.post("/v1/meshes", json=mesh).status_code for _ in range(2)] == [201, 200]


def test_the_service_reads_what_the_library_reads(client: TestClient) -> None:
    formats = list(_READERS)
    assert list(schemas.MESH_FORMATS) == formats
    assert client.get("/v1").json()["mesh_formats"] == [*formats, "json"]


def test_a_surface_may_be_given_by_its_lengths(client: TestClient) -> None:
    mesh, archive = gc.samples.plane(8), BytesIO()
    corners = mesh.vertices[mesh.faces]
    lengths = 3.0 * np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    np.savez(archive, faces=mesh.faces, lengths=lengths, vertices=mesh.vertices)
    made = client.post("/v1/meshes", params={"format": "npz"}, content=archive.getvalue())
    assert made.status_code == 201
    plain = client.post("/v1/meshes", content=off_of(mesh), params={"format": "off"})
    assert plain.json()["id"] != made.json()["id"]
    answer = client.post(f"/v1/meshes/{made.json()['id']}/distances", json={"sources": [0]})
    exact = 3.0 * gc.exact_distance(mesh, 0).distances
    np.testing.assert_allclose(answer.json()["distances"], exact, atol=1e-12)
    drawn = {"faces": mesh.faces, "lengths": lengths, "vertices": mesh.vertices}
    same = client.post("/v1/meshes", json={name: each.tolist() for name, each in drawn.items()})
    assert (same.status_code, same.json()["id"]) == (200, made.json()["id"])


def off_of(mesh: gc.TriangleMesh) -> str:
    rows = [" ".join(map(repr, row)) for row in mesh.vertices.tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    return "\n".join(["OFF", f"{len(mesh.vertices)} {len(mesh.faces)} 0", *rows, ""])


@pytest.mark.parametrize(
    ("content", "code", "words"),
    [
        (b"v 0 0 0\n", "unsupported_media_type", "the file type is missing"),
        (b"<!DOCTYPE html><p>gone", "unsupported_media_type", "an HTML page"),
        (b"version https://git-lfs.github.com/spec/v1\n", "unsupported_media_type", "Git LFS"),
        (gzip.compress(b"not a mesh"), "unsupported_media_type", "the file type is missing"),
        (gzip.compress(OFF.encode())[:-9], "invalid_mesh", "gzip cannot unpack"),
        (zipped("readme.txt", "no mesh"), "invalid_mesh", "must hold one mesh"),
    ],
    ids=["text", "page", "pointer", "packed text", "cut", "archive"],
)
def test_a_body_that_tells_no_type_is_refused_with_what_it_is(
    client: TestClient, content: bytes, code: str, words: str
) -> None:
    status = 415 if code == "unsupported_media_type" else 422
    response = client.post("/v1/meshes", content=content)
    assert words in check_problem(response, status, code)["detail"]


def test_samples_have_the_same_names_everywhere(client: TestClient) -> None:
    names = list(samples.SAMPLES)

    assert list(get_args(schemas.SampleName)) == names
    assert list(get_args(SampleName)) == names, "the command line's"
    assert client.get("/v1").json()["samples"] == names


@pytest.mark.parametrize("name", samples.SAMPLES)
def test_samples(client: TestClient, name: str) -> None:
    mesh_id = upload_sample(client, name, 500)

    sample = samples.SAMPLES[name](500)
    vertices, faces = sample.vertices, sample.faces
    mesh = stored_mesh(client, mesh_id)
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)


@pytest.mark.parametrize(("name", "fewest"), [("knot", 500), ("terrain", 200), ("obstacles", 500)])
def test_a_sample_of_too_few_faces_is_refused_with_the_fewest(
    client: TestClient, name: str, fewest: int
) -> None:
    response = client.post("/v1/meshes", params={"sample": name, "faces": fewest - 1})

    assert f"{fewest} to" in check_problem(response, 422, "invalid_request")["detail"]


@pytest.mark.parametrize(
    ("upload", "name"),
    [
        ({"params": {"name": "tetra/4.obj", "format": "obj"}, "content": OBJ}, "tetra/4.obj"),
        ({"params": {"name": "Δ" * 255}, "json": TETRAHEDRON}, "Δ" * 255),
        ({"files": {"file": ("tetra.obj", OBJ)}}, "tetra.obj"),
        ({"files": {"file": ("../far/away.obj", OBJ)}}, "away.obj"),
        ({"files": {"file": ("x" * 300 + ".obj", OBJ)}}, "x" * 255),
        ({"files": {"file": ("tetra.obj", OBJ)}, "params": {"name": "better"}}, "better"),
        ({"json": TETRAHEDRON}, None),
        ({"params": {"sample": "plane", "faces": 8}}, "plane"),
        ({"params": {"sample": "plane", "faces": 8, "name": "a sheet"}}, "a sheet"),
    ],
    ids=str,
)
def test_the_name_of_a_mesh_comes_with_its_first_upload(
    tmp_path: Path, upload: dict, name: str | None
) -> None:
    again = {**upload, "params": {**upload.get("params", {}), "name": "another"}}
    with serving(tmp_path) as client:
        document = client.post("/v1/meshes", **upload).json()
        assert document["name"] == name
        assert client.post("/v1/meshes", **again).json() == document
    with serving(tmp_path) as client:
        (listed,) = client.get("/v1/meshes").json()["meshes"]
        assert listed.items() <= document.items()


@pytest.mark.parametrize("name", ["", "x" * 256, "a\x1b[31mb", "a\x9bb", "a\n"])
def test_names_that_are_refused(client: TestClient, name: str) -> None:
    response = client.post("/v1/meshes", params={"name": name}, json=TETRAHEDRON)
    problem = check_problem(response, 422, "invalid_request")
    assert [error["pointer"] for error in problem["errors"]] == ["/query/name"]


def test_merging_gives_a_vertex_map(client: TestClient) -> None:
    soup = {
        "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        "faces": [[0, 1, 2], [3, 4, 5]],
    }

    apart = client.post("/v1/meshes", json=soup).json()
    joined = client.post("/v1/meshes", params={"merge": "exact"}, json=soup).json()

    assert (apart["components"], joined["components"]) == (2, 1)
    assert any("merge" in warning for warning in apart["warnings"])
    vertex_map = np.load(BytesIO(client.get(joined["arrays"]["vertex_map"]).content))
    np.testing.assert_array_equal(vertex_map, [0, 1, 2, 1, 3, 2])
    missing = client.get(f"/v1/meshes/{apart['id']}/arrays/vertex_map")
    check_problem(missing, 404, "not_found")


APART = {
    "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1e-7, 0], [1, 1, 0], [0, 1, 1e-7]],
    "faces": [[0, 1, 2], [3, 4, 5]],
}


def test_merging_within_a_distance(client: TestClient) -> None:
    apart = client.post("/v1/meshes", json=APART).json()
    joined = client.post("/v1/meshes", params={"merge": "2e-7"}, json=APART).json()

    assert (apart["components"], joined["components"]) == (2, 1)
    assert apart["near_vertices"] == {"count": 2, "ids": [[1, 3], [2, 5]]}
    assert apart["near_distance"] == pytest.approx(1e-7)
    assert joined["near_vertices"] == joined["t_junctions"] == {"count": 0, "ids": []}
    assert any("merge=2e-07 joins them" in warning for warning in apart["warnings"])
    vertex_map = np.load(BytesIO(client.get(joined["arrays"]["vertex_map"]).content))
    np.testing.assert_array_equal(vertex_map, [0, 1, 2, 1, 3, 2])


@pytest.mark.parametrize("merge", ["near", "-1", "nan", "inf", ""])
def test_what_is_no_way_of_merging(client: TestClient, merge: str) -> None:
    response = client.post("/v1/meshes", params={"merge": merge}, json=APART)
    problem = check_problem(response, 422, "invalid_request")
    assert {error["pointer"] for error in problem["errors"]} == {"/query/merge"}


QUADS = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 1 9 0\nf 1 2 3 4\nf 1 1 2\nf 4 3 5\nl 1 2"


def test_polygons_get_a_map_back(client: TestClient) -> None:
    report = client.post("/v1/meshes", content=QUADS, headers=TYPE_OBJ).json()

    assert (report["faces"], report["triangulated_polygons"]) == (4, 1)
    assert report["repeated_vertex_faces"] == {"count": 1, "ids": [2]}
    assert "1 lines" in report["warnings"][0]
    face_map = np.load(BytesIO(client.get(report["arrays"]["face_map"]).content))
    np.testing.assert_array_equal(face_map, [0, 0, 1, 2])
    faces = client.get(f"/v1/meshes/{report['id']}/arrays/faces").content
    np.testing.assert_array_equal(np.load(BytesIO(faces))[2], [0, 0, 1])
    plain = client.post("/v1/meshes", json=TETRAHEDRON).json()
    missing = client.get(f"/v1/meshes/{plain['id']}/arrays/face_map")
    check_problem(missing, 404, "not_found")


def test_the_report_names_what_a_mesh_is_made_of(client: TestClient) -> None:
    soup = {
        "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]],
        "faces": [[0, 1, 2], [3, 4, 5], [2, 1, 0], [6, 6, 0]],
    }
    report = client.post("/v1/meshes", json=soup).json()

    assert report["component_vertices"] == {"count": 2, "ids": [0, 3]}
    assert report["duplicate_vertices"] == {"count": 2, "ids": [3, 5]}
    assert report["duplicate_faces"] == {"count": 1, "ids": [2]}
    assert report["isolated_vertices"] == {"count": 1, "ids": [6]}
    assert report["repeated_vertex_faces"] == {"count": 1, "ids": [3]}
    assert len(report["warnings"]) == 5


def test_edges_of_no_length_are_reported_and_their_ends_are_one_place(client: TestClient) -> None:
    needle = {
        "vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]],
        "faces": [[0, 1, 2], [0, 2, 4], [4, 2, 3]],
    }
    report = client.post("/v1/meshes", json=needle).json()

    assert report["zero_length_edges"] == {"count": 1, "ids": [[0, 4]]}
    assert report["collapsed_faces"] == {"count": 1, "ids": [1]}
    assert "(0, 4)" in report["warnings"][0]
    queries = f"/v1/meshes/{report['id']}/distances"
    spellings: list[dict[str, object]] = [
        {"vertex": 0},
        {"vertex": 4},
        {"edge": [4, 0], "t": 0.5},
        {"face": 1, "barycentric": [0.5, 0, 0.5]},
    ]
    answers = [client.post(queries, json={"sources": [one]}).json() for one in spellings]
    assert [answer["distances"][4] for answer in answers] == [0, 0, 0, 0]
    for answer in answers:
        assert answer["sources"] == answers[0]["sources"]
        assert answer["distances"] == answers[0]["distances"]


# Refusals


def faults(problem: dict) -> list[str]:
    return [fault["pointer"] for fault in problem["errors"]]


@pytest.mark.parametrize(
    ("faces", "places"),
    [
        ([[0, 1, 2], [0, 1, 4]], ["/faces/1"]),
        ([[0, 1, -1]], ["/faces/0"]),
        ([[0, 1, 1]], ["/faces/0"]),
    ],
)
def test_bad_faces(client: TestClient, faces: list, places: list[str] | None) -> None:
    response = client.post("/v1/meshes", json={**TETRAHEDRON, "faces": faces})

    problem = check_problem(response, 422, "invalid_mesh")
    assert places is None or faults(problem) == places


@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
def test_coordinates_that_are_not_finite(client: TestClient, number: str) -> None:
    content = OBJ.replace("v 1 0 0", f"v 1 {number} 0")

    response = client.post("/v1/meshes", content=content, headers=TYPE_OBJ)

    check_problem(response, 422, "invalid_mesh")


@pytest.mark.parametrize(
    "content",
    [b"", b"\0" * 100, b"ply\nformat ascii 1.0\nelement vertex 9\n", b"\xff" * 1000],
)
@pytest.mark.parametrize("file_format", ["obj", "off", "ply", "stl", "glb"])
def test_nonsense_of_every_format(client: TestClient, content: bytes, file_format: str) -> None:
    response = client.post("/v1/meshes", params={"format": file_format}, content=content)

    check_problem(response, 422, "invalid_mesh")


def test_a_truncated_file(client: TestClient) -> None:
    response = client.post("/v1/meshes", params={"format": "off"}, content=OFF[:60])

    check_problem(response, 422, "invalid_mesh")


def test_nothing_is_left_of_a_refused_upload(client: TestClient) -> None:
    store: Path = client.app.state.service.settings.store
    before = sorted(store.rglob("*"))

    client.post("/v1/meshes", content="v 0 0 nonsense", headers=TYPE_OBJ)

    assert sorted(store.rglob("*")) == before


@pytest.mark.parametrize(
    ("upload", "status", "code"),
    [
        ({"content": b"x"}, 415, "unsupported_media_type"),
        (
            {"content": b"x", "headers": {"Content-Type": "image/png"}},
            415,
            "unsupported_media_type",
        ),
        ({"content": OBJ, "headers": GZIPPED}, 400, "malformed_body"),
        (
            {"content": gzip.compress(OBJ.encode())[:-1], "headers": GZIPPED},
            400,
            "malformed_body",
        ),
        (
            {"content": gzip.compress(OBJ.encode())[:-8] + bytes(8), "headers": GZIPPED},
            400,
            "malformed_body",
        ),
        (
            {"content": gzip.compress(OBJ.encode()) + b"more", "headers": GZIPPED},
            400,
            "malformed_body",
        ),
        ({"content": gzip.compress(b""), "headers": GZIPPED}, 422, "invalid_mesh"),
        (
            {"content": OBJ, "headers": {**TYPE_OBJ, "Content-Encoding": "zstd"}},
            415,
            "unsupported_media_type",
        ),
        (
            {"content": OBJ, "headers": {**TYPE_OBJ, "Content-Encoding": "gzip, gzip"}},
            415,
            "unsupported_media_type",
        ),
        (
            {"files": {"file": ("a.obj", OBJ)}, "headers": {"Content-Encoding": "gzip"}},
            415,
            "unsupported_media_type",
        ),
        ({"files": {"file": ("mesh.xyz", b"x")}}, 415, "unsupported_media_type"),
        ({"data": {"a": "b"}}, 415, "unsupported_media_type"),
        (
            {"content": b"x", "headers": {"Content-Type": "multipart/form-data"}},
            400,
            "malformed_body",
        ),
        (
            {"content": b"--b--", "headers": {"Content-Type": "multipart/form-data; boundary=b"}},
            400,
            "malformed_body",
        ),
        ({"content": b"{", "headers": {"Content-Type": "application/json"}}, 400, "malformed_body"),
        ({"json": {"vertices": []}}, 422, "invalid_request"),
        ({"json": {**TETRAHEDRON, "name": "x"}}, 422, "invalid_request"),
        ({"content": OBJ, "params": {"format": "fbx"}}, 422, "invalid_request"),
        ({"content": OBJ, "params": {"format": "obj", "colour": 1}}, 422, "invalid_request"),
        ({"content": OBJ, "params": {"format": "obj", "faces": 9}}, 422, "invalid_request"),
        ({"params": {"sample": "cube"}}, 422, "invalid_request"),
        ({"params": {"sample": "knot", "faces": 0}}, 422, "invalid_request"),
        ({"params": {"sample": "knot", "faces": 5_000_001}}, 422, "limit_exceeded"),
        ({"params": {"sample": "knot"}, "headers": {"X-Timeout-Ms": "0"}}, 422, "invalid_request"),
    ],
)
def test_refused_uploads(client: TestClient, upload: dict, status: int, code: str) -> None:
    check_problem(client.post("/v1/meshes", **upload), status, code)


@pytest.mark.parametrize("excess", [0, 1])
def test_a_compressed_body_is_bounded_by_what_it_holds(tmp_path: Path, excess: int) -> None:
    """A megabyte can hold a gigabyte; no more than the limit is ever written."""
    limit = 3 * 2**20
    noise = b"\n#" + Random(1).randbytes(limit).hex().encode()
    content = (OBJ.encode() + noise)[: limit + excess]
    with serving(tmp_path, max_upload_bytes=limit, max_query_bytes=100) as client:
        response = client.post("/v1/meshes", content=gzip.compress(content), headers=GZIPPED)
        if not excess:
            assert response.status_code == 201
            return
        problem = check_problem(response, 413, "upload_too_large")
        assert problem["limit"] == limit
        assert problem["setting"] == "max_upload_bytes"
        assert client.get("/v1/meshes").json()["meshes"] == []


BOMB = gzip.compress(b"#" * 10**7)


@pytest.mark.parametrize(
    "upload",
    [
        {"content": BOMB, "headers": GZIPPED},
        {"content": BOMB, "headers": TYPE_OBJ},
        {"content": zipped("a.obj", "#" * 10**7), "headers": TYPE_OBJ},
    ],
    ids=["coding", "gzip", "zip"],
)
def test_a_packed_file_may_not_grow_a_thousandfold(
    client: TestClient, upload: dict[str, Any]
) -> None:
    """Ten kilobytes would cost as much as ten megabytes."""
    problem = check_problem(client.post("/v1/meshes", **upload), 413, "upload_too_large")
    assert problem["limit"] == 2**20 + 100 * len(upload["content"]) < 10**7


def test_ratios_do_not_multiply(client: TestClient) -> None:
    twice = gzip.compress(gzip.compress(OBJ.encode()))
    response = client.post("/v1/meshes", content=twice, headers=GZIPPED)
    assert "so is the body" in check_problem(response, 415, "unsupported_media_type")["detail"]


def test_an_upload_without_room_is_refused_before_it_is_read(tmp_path: Path) -> None:
    """So is one that would wait for a worker without room."""

    def never() -> Iterator[bytes]:
        pytest.fail("the body is read")
        yield b""

    def post(client: ServiceClient) -> Any:
        headers = {**TYPE_OBJ, "Content-Length": "1000"}
        return client.post("/v1/meshes", content=never(), headers=headers)

    with serving(tmp_path) as client:
        client.app.state.service.scratch.change("somebody", 8 * 512 * 2**20 - 999)
        problem = check_problem(post(client), 503, "queue_full")
        assert problem["setting"] == "scratch_bytes"
        client.app.state.service.scratch.change("somebody", 999 - 8 * 512 * 2**20)
        client.engine.drain()
        check_problem(post(client), 503, "draining")


def test_all_of_an_upload_is_in_the_store(client: ServiceClient, tmp_path: Path) -> None:
    """The system's temporary folder may be in memory, beyond all limits."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
        response = client.post("/v1/meshes", files={"file": ("a.obj", OBJ + "#" * 2 * 2**20)})
    assert response.status_code in (200, 201)


def test_vertices_have_a_limit(tmp_path: Path) -> None:
    """Those without a face count: a few bytes each, when packed, and as costly as others."""
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    rows = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 2, 2]]
    with serving(tmp_path, max_vertices=3) as client:
        assert client.post("/v1/meshes", content=text, headers=TYPE_OBJ).status_code == 201
        for more in (
            {"content": text + "v 2 2 2\n", "headers": TYPE_OBJ},
            {"json": {"vertices": rows, "faces": [[0, 1, 2]]}},
            {"params": {"sample": "sphere", "faces": 20}},
        ):
            problem = check_problem(client.post("/v1/meshes", **more), 422, "limit_exceeded")
            assert (problem["limit"], problem["setting"]) == (3, "max_vertices")


def test_limits_of_uploads(tmp_path: Path) -> None:
    with serving(tmp_path, max_faces=3, max_upload_bytes=200, max_query_bytes=20) as client:
        many = check_problem(
            client.post("/v1/meshes", params={"format": "off"}, content=OFF), 422, "limit_exceeded"
        )
        assert (many["limit"], many["actual"]) == (3, 4)
        assert many["setting"] == "max_faces"
        assert client.get("/v1/meshes").json()["meshes"] == []

        large = OFF + "#" * 200
        declared = client.post("/v1/meshes", params={"format": "off"}, content=large)
        problem = check_problem(declared, 413, "upload_too_large")
        assert (problem["limit"], problem["actual"]) == (200, len(large))
        assert problem["setting"] == "max_upload_bytes"

        chunks = iter([large.encode()[:100], large.encode()[100:]])
        streamed = client.post("/v1/meshes", params={"format": "off"}, content=chunks)
        assert check_problem(streamed, 413, "upload_too_large")["limit"] == 200

        body = {"sources": [{"vertex": 0}]}
        query = client.post(f"/v1/meshes/{'0' * 32}/distances", json=body)
        problem = check_problem(query, 413, "upload_too_large")
        assert problem["setting"] == "max_query_bytes"


# Reading


def test_arrays(client: TestClient, plane: str) -> None:
    report = client.get(f"/v1/meshes/{plane}").json()
    arrays = {
        name: np.load(BytesIO(client.get(link).content)) for name, link in report["arrays"].items()
    }

    assert arrays["vertices"].shape == (report["vertices"], 3)
    assert arrays["faces"].shape == (report["faces"], 3)
    assert arrays["vertices"].dtype == np.float64
    assert set(arrays["components"]) == {0}


def test_arrays_are_immutable_and_cached(client: TestClient, plane: str) -> None:
    link = f"/v1/meshes/{plane}/arrays/faces"
    response = client.get(link)

    assert "immutable" in response.headers["cache-control"]
    again = client.get(link, headers={"If-None-Match": response.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize(
    ("requested", "expected"),
    [
        ("bytes=0-9", slice(0, 10)),
        ("bytes=6-", slice(6, None)),
        ("bytes=-5", slice(-5, None)),
    ],
)
def test_ranges(client: TestClient, plane: str, requested: str, expected: slice) -> None:
    link = f"/v1/meshes/{plane}/arrays/vertices"
    whole = client.get(link).content

    part = client.get(link, headers={"Range": requested})

    assert part.status_code == 206
    assert part.content == whole[expected]


@pytest.mark.parametrize("requested", ["bytes=9-2", "bytes=x", "bytes=", "lines=0-9", "bytes=-"])
def test_ranges_that_make_no_sense_are_ignored(
    client: TestClient, plane: str, requested: str
) -> None:
    link = f"/v1/meshes/{plane}/arrays/vertices"

    assert client.get(link, headers={"Range": requested}).content == client.get(link).content


def test_ranges_outside(client: TestClient, plane: str) -> None:
    link = f"/v1/meshes/{plane}/arrays/vertices"
    response = client.get(link, headers={"Range": "bytes=999999-"})

    check_problem(response, 416, "range_not_satisfiable")
    assert response.headers["content-range"].startswith("bytes */")


def test_unknown_array(client: TestClient, plane: str) -> None:
    check_problem(client.get(f"/v1/meshes/{plane}/arrays/links"), 404, "not_found")


@pytest.mark.parametrize("mesh_id", ["0" * 32, "x", "%2e%2e%2fmeshes", "0" * 500])
def test_unknown_mesh(client: TestClient, mesh_id: str) -> None:
    for path in ("", "/arrays/faces", "/path?from=v0&to=v1"):
        response = client.get(f"/v1/meshes/{mesh_id}{path}")
        assert response.status_code == 404
        assert response.json()["code"] in ("mesh_not_found", "not_found")
    check_problem(client.get(f"/v1/meshes/{'0' * 32}"), 404, "mesh_not_found")


def test_a_report_is_revalidated(client: TestClient, plane: str) -> None:
    link = f"/v1/meshes/{plane}"
    etag = client.get(link).headers["etag"]

    assert client.get(link, headers={"If-None-Match": f'"x", W/{etag}'}).status_code == 304
    assert client.get(link, headers={"If-None-Match": '"x"'}).status_code == 200


def test_a_report_that_has_changed_has_another_tag(client: TestClient) -> None:
    body = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 3, 0]], "faces": [[0, 1, 2]]}
    tags = []
    for name in ("first", "second"):
        link = client.post("/v1/meshes", params={"name": name}, json=body).headers["location"]
        tags.append(client.get(link).headers["etag"])
        again = client.get(link, headers={"If-None-Match": tags[0]})
        client.delete(link)

    assert len(set(tags)) == 2
    assert again.json()["name"] == "second"


def test_list_in_parts(tmp_path: Path) -> None:
    with serving(tmp_path) as client:
        ids = [upload_sample(client, "plane", faces) for faces in (50, 100, 200, 400, 800)]
        found, cursor, parts = [], None, 0
        while parts == 0 or cursor:
            params = {"limit": 2} | ({"cursor": cursor} if cursor else {})
            part = client.get("/v1/meshes", params=params).json()
            found += [mesh["id"] for mesh in part["meshes"]]
            cursor, parts = part["next_cursor"], parts + 1

        assert parts == 3
        assert found == ids[::-1], "the newest first"


def test_lists_tell_little_of_each_mesh(tmp_path: Path) -> None:
    body = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 3, 0]], "faces": [[0, 1, 2]]}
    with serving(tmp_path) as client:
        plane = upload_sample(client, "plane", 8)
        report = client.post("/v1/meshes", params={"name": "one"}, json=body).json()
        members = ("id", "name", "vertices", "faces", "created")
        listed = client.get("/v1/meshes").json()["meshes"]
        assert listed[0] == {name: report[name] for name in members}
        assert [each["id"] for each in listed] == [report["id"], plane]

        named = client.get("/v1/meshes", params={"name": "plane"}).json()["meshes"]
        assert [each["id"] for each in named] == [plane]
        assert client.get("/v1/meshes", params={"name": "pla"}).json()["meshes"] == []
        client.delete(f"/v1/meshes/{report['id']}")
        client.post("/v1/meshes", params={"name": "two"}, json=body)
        assert client.get("/v1/meshes").json()["meshes"][0]["name"] == "two"


@pytest.mark.parametrize("params", [{"limit": 0}, {"limit": 1001}, {"page": 2}])
def test_list_with_bad_parameters(client: TestClient, params: dict) -> None:
    check_problem(client.get("/v1/meshes", params=params), 422, "invalid_request")


def test_delete(client: TestClient) -> None:
    mesh_id = upload_sample(client, "plane", 32)
    query = {"sources": [{"vertex": 0}]}
    assert client.post(f"/v1/meshes/{mesh_id}/distances", json=query).status_code == 200

    response = client.delete(f"/v1/meshes/{mesh_id}")

    assert (response.status_code, response.content) == (204, b"")
    check_problem(client.delete(f"/v1/meshes/{mesh_id}"), 404, "mesh_not_found")
    check_problem(client.get(f"/v1/meshes/{mesh_id}"), 404, "mesh_not_found")
    after = client.post(f"/v1/meshes/{mesh_id}/distances", json=query)
    check_problem(after, 404, "mesh_not_found")
    settings: Settings = client.app.state.service.settings
    assert not list((settings.store / "results").glob(f"{mesh_id}/*"))


def test_a_damaged_mesh_does_not_hide_the_others(tmp_path: Path) -> None:
    with serving(tmp_path) as client:
        damaged, whole = (upload_sample(client, "plane", faces) for faces in (50, 100))
        (tmp_path / "meshes" / damaged / "manifest.json").write_bytes(b"{")

        assert [mesh["id"] for mesh in client.get("/v1/meshes").json()["meshes"]] == [whole]
        check_problem(client.get(f"/v1/meshes/{damaged}"), 500, "mesh_damaged")


def test_a_list_reads_its_manifests_beside_the_event_loop(
    client: ServiceClient, plane: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thousand of them are a thousand files."""
    readers: set[int] = set()
    read = MeshHome._readable

    def noted(home: MeshHome, mesh_id: str) -> Any:
        readers.add(threading.get_ident())
        return read(home, mesh_id)

    monkeypatch.setattr(MeshHome, "_readable", noted)
    listed = client.get("/v1/meshes", params={"limit": 1000}).json()["meshes"]
    assert plane in {mesh["id"] for mesh in listed}
    assert readers
    assert client.portal.call(threading.get_ident) not in readers


def test_meshes_and_results_survive_a_restart(tmp_path: Path) -> None:
    query = {"sources": [{"vertex": 0}]}
    with serving(tmp_path) as client:
        mesh_id = upload_sample(client, "plane", 45_000)  # the answer is more than memory keeps
        first = client.post(f"/v1/meshes/{mesh_id}/distances", json=query)

    with serving(tmp_path) as client:
        assert [mesh["id"] for mesh in client.get("/v1/meshes").json()["meshes"]] == [mesh_id]
        again = client.post(f"/v1/meshes/{mesh_id}/distances", json=query)

    assert again.content == first.content
    assert again.headers["server-timing"] == "kept"


@pytest.mark.parametrize(
    "packed", [gzip.compress(bytes(10**6)), zipped("a.off", " " * 10**6)], ids=["gzip", "zip"]
)
def test_a_packed_file_counts_by_its_size_when_unpacked(tmp_path: Path, packed: bytes) -> None:
    with serving(tmp_path, max_upload_bytes=10**5, max_query_bytes=100) as client:
        response = client.post("/v1/meshes", content=packed)
        assert check_problem(response, 413, "upload_too_large")["limit"] == 10**5
