"""The client with a service that runs, against the library."""

from io import BytesIO
from pathlib import Path
from typing import Any

import anyio
import httpx2
import numpy as np
import pytest
from geodesic_client import (
    AsyncClient,
    Client,
    Mesh,
    ProblemError,
    curve,
    edge,
    face,
    flow,
    position,
    progress_bar,
    starting_at,
)
from starlette.testclient import TestClient

import geodesic_core as gc
from tests.support.processes import Server
from tests.support.service import TWO_TRIANGLES, stored_mesh

SOURCES = [0, edge(1, 2, 0.3), starting_at(face(5, (0.2, 0.3, 0.5)), 0.5), curve([0, 1])]


@pytest.fixture(scope="module")
def service(client: TestClient) -> Client:
    return Client(http=client)


@pytest.fixture(scope="module")
def mesh(service: Client) -> Mesh:
    return service.sample("knot", 3000)


@pytest.fixture(scope="module")
def same(client: TestClient, mesh: Mesh) -> gc.TriangleMesh:
    """The mesh, as the library has it."""
    return stored_mesh(client, mesh.id)


@pytest.fixture(scope="module")
def apart(service: Client) -> Mesh:
    """A mesh of two components."""
    return service.upload((TWO_TRIANGLES["vertices"], TWO_TRIANGLES["faces"]))


def test_distances_are_the_library_s_to_the_bit(
    service: Client, mesh: Mesh, same: gc.TriangleMesh
) -> None:
    found = service.distances(mesh, [0, 7])
    field = gc.exact_distance(same, [0, 7])
    np.testing.assert_array_equal(found.distances, field.distances)
    assert (found.method, found.error_bound.kind, found.error_bound.value) == (
        "exact",
        "guaranteed",
        0.0,
    )
    assert found.nearest_source is None
    rich = service.distances(mesh.id, np.array([0, 7]), include=["nearest_source", "gradient"])
    np.testing.assert_array_equal(rich.distances, field.distances)
    np.testing.assert_array_equal(rich.nearest_source, field.nearest_source)
    np.testing.assert_allclose(rich.gradient, field.gradient, equal_nan=True)


def test_certificates_are_the_library_s_to_the_bit(
    service: Client, mesh: Mesh, same: gc.TriangleMesh
) -> None:
    field = gc.exact_distance(same, [0, 7])
    certificate = field.certify()
    found = service.distances(mesh, [0, 7], certify=True, include=["lower", "upper"])
    np.testing.assert_array_equal(found.lower, certificate.lower)
    np.testing.assert_array_equal(found.upper, certificate.upper)
    bare = service.distances(mesh, [0, 7], certify=True)
    assert bare.certificate == found.certificate
    assert bare.error_bound == found.error_bound
    assert (bare.error_bound.kind, bare.error_bound.value) == ("certified", field.error_bound.value)
    assert (bare.lower, bare.upper) == (None, None)
    assert vars(bare.certificate) == {
        "holds": True,
        "relative_gap": certificate.relative_gap,
        "worst_face": certificate.worst_face,
        "worst_violation": certificate.worst_violation,
    }


def test_a_path_is_certified(service: Client, mesh: Mesh) -> None:
    path = service.path(mesh, 0, 7, certify=True)
    assert path.error_bound.kind == "certified"
    assert path.certificate is not None
    assert path.certificate.holds
    assert path.certificate.relative_gap <= 1e-9
    assert service.path(mesh, 0, 7).certificate is None


@pytest.mark.parametrize("source", [7, np.int64(7), {"vertex": 7}], ids=repr)
def test_a_single_source_needs_no_list(service: Client, mesh: Mesh, source: Any) -> None:
    distances, lines = service.distances(mesh, source), service.isolines(mesh, source, count=3)
    np.testing.assert_array_equal(distances.distances, service.distances(mesh, [7]).distances)
    assert [level.level for level in lines.levels] == [
        level.level for level in service.isolines(mesh, [7], count=3).levels
    ]


def test_what_cannot_be_reached_is_infinite(service: Client, apart: Mesh) -> None:
    for include in ((), ("nearest_source",)):
        found = service.distances(apart, [0], include=include)
        assert np.isinf(found.distances).tolist() == [False] * 3 + [True] * 3
        assert found.unreachable == {"disconnected": 3, "beyond_max_distance": 0}
    assert found.nearest_source is not None
    assert found.nearest_source.tolist() == [0] * 3 + [-1] * 3
    missing = service.path(apart, 0, 4)
    assert (missing.reason, missing.length) == ("disconnected", np.inf)
    assert missing.points.shape == (0, 3)


def test_a_vertex_may_be_a_number_of_numpy(service: Client, mesh: Mesh) -> None:
    ids = np.arange(10)
    found = service.distances(mesh, [starting_at(ids[7], 0.5)], targets=ids[7:9])
    assert found.distances == pytest.approx(
        0.5 + service.distances(mesh, [7], targets=[7, 8]).distances
    )


def test_all_kinds_of_sources(service: Client, mesh: Mesh) -> None:
    found = service.distances(mesh, SOURCES, targets=[9, position((3, 1, 0))], method="fast")
    assert found.distances.shape == (2,)
    assert found.error_bound.kind == "estimated"


def test_paths_are_the_library_s(service: Client, mesh: Mesh, same: gc.TriangleMesh) -> None:
    path = gc.shortest_path(same, 3, 700)
    found = service.path(mesh, 3, 700)
    assert found.length == path.length
    np.testing.assert_array_equal(found.points, path.points)
    np.testing.assert_array_equal(found.faces, path.faces)
    assert len(found.locations) == len(found.points)
    one, other = service.paths(mesh, 3, [700, 5])
    assert one.length == pytest.approx(path.length)
    assert other.reason is None


def test_what_ways_cost_is_the_library_s(
    service: Client, mesh: Mesh, same: gc.TriangleMesh
) -> None:
    cost, faces = {"faces": np.linspace(1.0, 3.0, len(same.faces)).tolist()}, len(same.faces)
    field = gc.cost_distance(same, 3, np.linspace(1.0, 3.0, faces))
    own = field.path_to(700)
    found = service.distances(mesh, 3, cost=cost)
    np.testing.assert_array_equal(found.distances, field.costs)
    (path,) = service.paths(mesh, 3, [700], cost=cost)
    assert (path.cost, path.length) == (own.cost, own.length)
    assert service.path(mesh, 3, 700, cost=cost).cost == pytest.approx(own.cost)
    (level,) = service.isolines(mesh, 3, levels=[0.5 * own.cost], cost=cost).levels
    for line, expected in zip(level.lines, field.isochrones([level.level])[0], strict=True):
        np.testing.assert_array_equal(line.points, expected.points)


def test_a_mesh_is_cut_along_lines_of_answers(
    service: Client, mesh: Mesh, same: gc.TriangleMesh
) -> None:
    path = service.path(mesh, 3, 700)
    rings = service.isolines(mesh, [40], levels=[0.5], include=["locations"]).levels[0].lines
    cut = service.cut(mesh, [path, *rings, [0]], name="in parts")
    own_rings = gc.exact_distance(same, 40, retain="windows").isolines([0.5])[0]
    own = gc.cut(same, [gc.shortest_path(same, 3, 700), *own_rings, gc.Curve([0])])
    assert (cut.cut_from, cut.snapped, cut.parts) == (mesh.id, 0, own.parts.max() + 1)
    assert (cut.vertices, cut.faces) == (len(own.vertices), len(own.faces))
    assert (service.mesh(cut.mesh_id).name, cut.warnings) == ("in parts", [])
    for name in ("vertices", "faces", "face_of", "location_weights", "parts"):
        np.testing.assert_array_equal(service.array(cut.mesh_id, name), getattr(own, name))
    whole = service.cut(mesh, path, separate=False)
    assert whole.vertices == len(gc.cut(same, gc.shortest_path(same, 3, 700), False).vertices)
    with pytest.raises(ValueError, match="no locations"):
        service.cut(mesh, service.isolines(mesh, [40], levels=[0.5]).levels[0].lines)


def test_isolines_matrices_and_candidates(
    service: Client, mesh: Mesh, same: gc.TriangleMesh
) -> None:
    lines = service.isolines(mesh, [0], levels=[0.5, 1.0])
    assert [each.level for each in lines.levels] == [0.5, 1.0]
    assert lines.levels[0].lines[0].points.shape[1] == 3

    values = same.vertices[:, 0].copy()
    values[5] = np.nan
    lines = service.isolines(mesh, values=values, levels=[0.0], include=["locations"])
    (own,) = gc.ScalarField(same, values).isolines([0.0])
    assert (lines.chord_error, lines.error_bound.value, len(own) > 0) == (0.0, 0.0, True)
    for line, expected_line in zip(lines.levels[0].lines, own, strict=True):
        np.testing.assert_array_equal(line.points, expected_line.points)
        assert [at["face"] for at in line.locations] == [
            at.face_index for at in expected_line.locations
        ]

    (rim,) = service.boundaries(mesh, barriers=[3])
    (expected_rim,) = same.with_barriers([3]).boundaries()
    np.testing.assert_array_equal(rim.points, expected_rim.points)
    assert rim.vertices.tolist() == [at.vertex_index for at in expected_rim.locations]
    assert (rim.closed, rim.locations) == (True, ())

    borders = service.borders(mesh, [0, 7, 9])
    expected = gc.exact_distance(same, [0, 7, 9]).borders()
    assert [line.sources for line in borders] == [line.sources for line in expected]
    np.testing.assert_array_equal(borders[0].points, expected[0].points)

    table = gc.distance_matrix(same, [0, 1], [7, 8, 9])
    np.testing.assert_array_equal(service.matrix(mesh, [0, 1], [7, 8, 9]).distances, table)
    sparse = service.matrix(mesh, [0, 1], [7, 8, 9], layout="sparse")
    assert sparse.rows is not None
    dense = np.zeros((2, 3))
    dense[sparse.rows, sparse.columns] = sparse.distances
    np.testing.assert_array_equal(dense, table)
    pairs = service.matrix(mesh, range(2), [7, 8], layout="pairs")
    np.testing.assert_allclose(pairs.distances, table.diagonal(), rtol=1e-12)

    near = service.nearest(mesh, 0, [7, 8, 9], k=2)
    assert [each.distance for each in near] == np.sort(table[0])[:2].tolist()


def test_log_maps_and_lines_are_the_library_s(
    service: Client, mesh: Mesh, same: gc.TriangleMesh
) -> None:
    found = service.log_map(mesh, 3, x_axis=9, max_distance=2.0)
    expected_map = gc.log_map(same, 3, x_axis=9, max_distance=2.0)
    for name in ("distances", "angles", "coordinates", "bends", "total_angle"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected_map, name))
    for starts, directions in ((3, [0.1, 2.0]), ([3, 9], np.array([[1, 0, 0.5], [0, 1, 0]]))):
        lines = service.trace(mesh, starts, directions, 1.5)
        expected = gc.trace(same, np.resize(starts, 2).tolist(), directions, 1.5)
        for line, own in zip(lines, expected, strict=True):
            np.testing.assert_array_equal(line.points, own.points)
            np.testing.assert_array_equal(line.faces, own.faces)
            assert (line.length, line.stopped) == (own.length, own.stopped)
            assert line.end_direction == own.end_direction


def test_the_steps_of_a_sweep_are_the_library_s(
    service: Client, mesh: Mesh, same: gc.TriangleMesh
) -> None:
    found = service.sweep_steps(mesh, [3, 9], 50, barriers=[5])
    own = gc.sweep_steps(same, [3, 9], 50, barriers=[5])
    for name in ("fronts", "created", "crossed", "waiting", "trimmed", "distances", "settled"):
        np.testing.assert_array_equal(getattr(found, name), getattr(own, name))
    for name, column in found.windows.items():
        np.testing.assert_array_equal(column, getattr(own.windows, name))


def test_samples_cells_and_means_are_the_library_s(
    service: Client, mesh: Mesh, same: gc.TriangleMesh
) -> None:
    found = service.samples(mesh, 6, start=[7, 3], barriers=[5], include=["distances"])
    spread = gc.farthest_points(same, 6, start=[7, 3], barriers=[5])
    assert [point["vertex"] for point in found.points] == spread.vertices.tolist()
    np.testing.assert_array_equal(found.positions, same.vertices[spread.vertices])
    np.testing.assert_array_equal(found.radii, spread.radius)
    np.testing.assert_array_equal(found.distances, spread.distances)
    np.testing.assert_array_equal(found.nearest, spread.nearest)
    assert (found.costs.tolist(), found.converged) == ([], None)
    moved = service.samples(mesh, radius=2.0, iterations=2)
    own = gc.relax_points(same, gc.farthest_points(same, radius=2.0).points, 2)
    np.testing.assert_array_equal(moved.costs, own.costs)
    assert (moved.converged, moved.distances, moved.nearest) == (own.converged, None, None)

    cells = service.cells(mesh, moved.points, chord_error=0.01)  # which can be sent again
    expected = gc.exact_distance(same, own.points).cells(0.01)
    np.testing.assert_array_equal(cells.areas, expected.areas)
    np.testing.assert_array_equal(cells.adjacency, expected.adjacency)
    np.testing.assert_array_equal(cells.border_lengths, expected.border_lengths)
    assert cells.centroids is not None
    assert [point and point["face"] for point in cells.centroids] == [
        point and point.face_index for point in expected.centroids
    ]
    assert service.cells(mesh, [curve([0, 1]), 900]).centroids is None

    mean = service.mean(mesh, [3, 9, 700], weights=[1, 2, 0.5])
    own_mean = gc.mean_point(same, [3, 9, 700], [1, 2, 0.5])
    np.testing.assert_array_equal(mean.position, same.position(own_mean.point))
    assert (mean.variance, mean.converged, mean.moves) == (
        own_mean.variance,
        own_mean.converged,
        own_mean.moves,
    )


def test_loops_are_the_library_s(service: Client, mesh: Mesh, same: gc.TriangleMesh) -> None:
    (loop,) = service.loops(mesh, 7, include=["locations"])
    handles = service.loops(mesh)
    way = service.path(mesh, 0, 900, waypoints=[500])
    tight = service.straighten(mesh, [way, loop, [0, 1]])
    (alone,) = service.straighten(mesh, way)
    own = [
        gc.shortest_loop(same, 7),
        *gc.handle_loops(same),
        *(
            gc.straighten(same.curve(curve.locations, closed=curve.closed))
            for curve in (gc.shortest_path(same, 0, 900, [500]), gc.shortest_loop(same, 7))
        ),
    ]
    for found, expected in zip([loop, *handles, *tight], own, strict=False):
        assert (found.closed, found.length) == (expected.closed, expected.length)
        np.testing.assert_array_equal(found.points, expected.points)
        np.testing.assert_array_equal(found.faces, expected.faces)
    assert len(own) == 5
    assert alone.length == tight[0].length
    assert len(loop.locations) == len(loop.points)
    with pytest.raises(ValueError, match="has no locations"):
        service.straighten(mesh, handles)


def test_points_of_a_surface_that_lies_nowhere(service: Client) -> None:
    archive = BytesIO()
    np.savez(archive, faces=[[0, 1, 2], [0, 2, 3]], lengths=np.ones((2, 3)))
    flat = service.upload(archive.getvalue(), format="npz")
    found = service.samples(flat, 2)
    assert (found.positions.shape, len(found.points)) == ((0, 3), 2)
    assert service.mean(flat, [0, 1]).position is None


def test_parts_that_have_no_point_are_infinitely_far(service: Client, apart: Mesh) -> None:
    found = service.samples(apart, 1, include=["distances"])
    assert found.radii.tolist() == [np.inf]
    assert found.nearest is not None
    assert found.nearest.tolist() == [0] * 3 + [-1] * 3


def test_points_that_were_located_are_points(service: Client, mesh: Mesh) -> None:
    found, missed = service.locate(mesh, np.array([[3, 1, 0.5], [99, 0, 0]]), max_distance=9)
    assert missed is None
    assert found is not None
    there = service.distances(mesh, [found.point], targets=[position(found.position)])
    assert there.distances == pytest.approx(0, abs=1e-9)


def test_a_mesh_is_stored_read_listed_and_removed(service: Client, tmp_path: Path) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1 / 3, 0]])
    shares: list[float] = []
    mesh = service.upload((vertices, [[0, 1, 2]]), progress=shares.append)
    assert shares == [1.0]
    assert (mesh.vertices, mesh.faces, mesh.report["boundary_loops"]) == (3, 1, 1)
    assert mesh.name is None
    np.testing.assert_array_equal(service.array(mesh, "vertices"), vertices)
    assert service.mesh(mesh.id) == mesh
    assert mesh.id in [each.id for each in service.meshes()]
    file = tmp_path / "one.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    stored = service.upload(file)
    assert (stored.name, stored.vertices) == ("one.obj", 3)
    (listed,) = service.meshes(name="one.obj")
    assert (listed.id, listed.vertices, listed.faces) == (stored.id, 3, 1)
    assert service.meshes()[0] == listed, "the newest"
    assert service.upload(file.read_bytes(), format="obj") == service.upload(str(file))
    service.delete_mesh(mesh)
    with pytest.raises(ProblemError) as caught:
        service.distances(mesh, [0])
    assert caught.value.code == "mesh_not_found"


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (b"OFF", "give the format"),
        (([[0, 0]], [[0, 0, 0]]), "vertices have the shape"),
        (([[0, 0, 0]], [[0, 0]]), "faces have the shape"),
        (([[0, 0, 0]], [[0.0, 0, 0]]), "they must be integers"),
        (([[0, 0, 0]], [[0, 0, 1]]), "outside 0 to 0"),
    ],
)
def test_meshes_that_are_none(service: Client, mesh: object, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        service.upload(mesh)  # type: ignore[arg-type]


def test_a_refusal_names_the_element(service: Client, apart: Mesh) -> None:
    with pytest.raises(
        ProblemError, match="vertex 9 does not exist; the indices are 0 to 5"
    ) as caught:
        service.distances(apart, [0, 9])
    error = caught.value
    assert (error.status, error.code) == (422, "invalid_point")
    assert error.errors[0]["pointer"] == "/sources/1"
    assert error.request_id


def test_a_query_that_was_a_job_leaves_none(
    service: Client, mesh: Mesh, same: gc.TriangleMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flow, "JOB_AFTER_S", 0)
    before = service.jobs()
    shares: list[float] = []
    found = service.distances(mesh, [11], progress=shares.append)
    np.testing.assert_array_equal(found.distances, gc.exact_distance(same, 11).distances)
    assert shares[-1] == 1.0
    assert len(shares) > 1, "it was a job"
    assert service.jobs() == before


def test_a_query_that_is_stopped_leaves_no_job(
    service: Client, mesh: Mesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(_share: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(flow, "JOB_AFTER_S", 0)
    before = service.jobs()
    with pytest.raises(KeyboardInterrupt):
        service.distances(mesh, [12], progress=stop)
    assert service.jobs() == before


def test_jobs(service: Client, client: TestClient, mesh: Mesh) -> None:
    headers = {"Prefer": "respond-async"}
    link = f"/v1/meshes/{mesh.id}/distances"
    submitted = client.post(link, json={"sources": [13]}, headers=headers)
    client.get(f"{submitted.headers['location']}/events")  # until it has finished
    job = service.jobs()[0]
    assert service.job(job.id) == job
    assert (job.kind, job.status, job.is_finished) == ("distances", "successful", True)
    assert service.cancel_job(job) == job, "it has finished"
    service.delete_job(job)
    with pytest.raises(ProblemError, match="job_not_found"):
        service.job(job.id)


def test_about(service: Client) -> None:
    assert "exact" in service.about()["methods"]


def test_the_steps_of_a_search(service: Client, mesh: Mesh, same: gc.TriangleMesh) -> None:
    expected = gc.shortest_path(same, 0, 99, [7], explain=True).steps
    found = service.path_steps(mesh, 0, 99, waypoints=[7])
    assert expected is not None
    assert [(each.leg, each.name, each.bound) for each in found] == [
        (each.leg, each.name, each.bound) for each in expected
    ]
    for step, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(step.faces, other.faces)


def test_coroutines(client: TestClient, mesh: Mesh, service: Client, tmp_path: Path) -> None:
    expected = service.distances(mesh, [0]).distances
    file = tmp_path / "one.off"
    file.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")

    def answer(request: httpx2.Request) -> httpx2.Response:
        body, headers = request.content, request.headers
        found = client.request(request.method, str(request.url), content=body, headers=headers)
        return httpx2.Response(found.status_code, headers=found.headers, content=found.content)

    async def pass_on(request: httpx2.Request) -> httpx2.Response:
        await request.aread()
        return await anyio.to_thread.run_sync(answer, request)

    async def ask() -> None:
        transport = httpx2.MockTransport(pass_on)
        async with httpx2.AsyncClient(transport=transport, base_url="http://127.0.0.1") as http:
            asking = AsyncClient(http=http)
            np.testing.assert_array_equal((await asking.distances(mesh, [0])).distances, expected)
            assert (await asking.upload(file)).faces == 1

    anyio.run(ask)


def test_a_bar_moves(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("upload") as show:
        show(0.5)
        show(1.0)
    assert "upload 100%" in capsys.readouterr().err


@pytest.mark.service
def test_both_clients_by_the_address_and_the_key_of_a_service(tmp_path: Path) -> None:
    key = "0123456789abcdef0123456789abcdef"
    server = Server(tmp_path, GEODESIC_API_KEYS=f"ann:{key}")
    try:
        with Client(server.url, api_key=f"{key}\n") as client:
            mesh = client.sample("plane", 200)
            assert client.path(mesh, 0, 120).length == pytest.approx(2**0.5)

        async def ask() -> float:
            async with AsyncClient(server.url, api_key=key) as client:
                return (await client.path(mesh, 0, 120)).length

        assert anyio.run(ask) == pytest.approx(2**0.5)
        with Client(server.url) as client, pytest.raises(ProblemError, match="no API key"):
            client.about()
    finally:
        server.close()
