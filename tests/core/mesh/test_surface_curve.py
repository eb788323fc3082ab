"""Curves of every kind have the same answers; boundaries are the edges of one face."""

import copy
import csv
import json
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import pyvista

import geodesic_core as gc
from geodesic_core.errors import InvalidArgument, InvalidPoint
from tests.support import zoo
from tests.support.isoline_checks import check_locations, check_pieces, edge_kinds
from tests.support.meshes import mesh_of

PLANE = gc.samples.plane(200)


def ring(level: float = 0.3) -> gc.SurfaceCurve:
    """A closed line around the middle of a plane."""
    middle = PLANE.locate([0.5, 0.5, 0.0])
    (line,) = gc.exact_distance(PLANE, middle).isolines([level], chord_error=1e-6)[0]
    return line


def curves() -> dict[str, gc.SurfaceCurve]:
    field = gc.exact_distance(PLANE, [0, 10], retain="windows")
    return {
        "path": field.path_to(len(PLANE.vertices) - 1),
        "line": gc.trace(PLANE, 0, 0.3, 0.8),
        "isoline": ring(),
        "border": field.borders()[0],
        "boundary": PLANE.boundaries()[0],
        "level set": gc.ScalarField(PLANE, PLANE.vertices[:, 0]).isolines([0.43])[0][0],
    }


CURVES = curves()
each = pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)


@each
def test_segments_lie_in_their_faces(curve: gc.SurfaceCurve) -> None:
    check_pieces(PLANE, curve)
    check_locations(PLANE, curve)
    ends = np.vstack([curve.points, curve.points[: int(curve.closed)]])
    steps = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    assert curve.length == pytest.approx(steps.sum(), rel=1e-12)


@each
def test_each_can_be_a_source(curve: gc.SurfaceCurve) -> None:
    """On a plane, against the distance of each vertex from the nearest segment."""
    ends = np.vstack([curve.points, curve.points[: int(curve.closed)]])
    start, way = ends[:-1], np.diff(ends, axis=0)
    offset = PLANE.vertices[:, None] - start
    share = np.clip((offset * way).sum(axis=2) / (way * way).sum(axis=1), 0.0, 1.0)
    expected = np.linalg.norm(offset - share[..., None] * way, axis=2).min(axis=1)
    found = gc.exact_distance(PLANE, [curve]).distances
    np.testing.assert_allclose(found, expected, atol=1e-12)
    late = gc.exact_distance(PLANE, gc.Source(curve, 2.0)).distances
    np.testing.assert_allclose(late, expected + 2.0, atol=1e-12)


@each
def test_reversed_twice_is_the_same(curve: gc.SurfaceCurve) -> None:
    turned = curve.reversed()
    check_pieces(PLANE, turned)
    check_locations(PLANE, turned)
    assert turned.length == curve.length
    again = turned.reversed()
    assert (again.locations, again.faces.tolist()) == (curve.locations, curve.faces.tolist())
    first = curve.points[0] if curve.closed else curve.points[-1]
    np.testing.assert_array_equal(turned.points[0], first)


@each
def test_resampled_points_are_evenly_spaced_along_the_curve(curve: gc.SurfaceCurve) -> None:
    spacing = curve.length / 7.3
    even = curve.resample(spacing)
    assert len(even.points) == 7 + (not curve.closed)
    assert (even.closed, even.length) == (curve.closed, curve.length)
    ends = np.vstack([curve.points, curve.points[: int(curve.closed)]])
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(ends, axis=0), axis=1).cumsum()])
    steps = along[-1] * np.arange(len(even.points)) / 7
    expected = np.stack([np.interp(steps, along, axis) for axis in ends.T], axis=1)
    np.testing.assert_allclose(even.points, expected, atol=1e-12)
    positions = [PLANE.position(point) for point in even.locations]
    np.testing.assert_allclose(even.points, positions, atol=1e-11)
    assert set(even.faces.tolist()) == {-1}


def test_closed_curves_begin_near_a_point_so_that_seams_are_in_line() -> None:
    for near in (PLANE.point(20), [1.0, 0.5, 0.3]):
        place = PLANE.position(near) if isinstance(near, gc.SurfacePoint) else np.array(near)
        for level in (0.1, 0.2, 0.3):
            first, middle = ring(level).resample(0.05, start_near=near).points[0], [0.5, 0.5, 0.0]
            toward = (place - middle) * [1, 1, 0]
            toward /= np.linalg.norm(toward)
            np.testing.assert_allclose(first, middle + level * toward, atol=1e-3)


def test_resampled_curves_are_no_sources() -> None:
    even = ring().resample(0.2)
    with pytest.raises(InvalidPoint, match="have no face in common"):
        gc.exact_distance(PLANE, even)
    with pytest.raises(InvalidArgument, match="resample the one that it came from"):
        even.resample(0.1)


@pytest.mark.parametrize("spacing", [0.0, -1.0, np.nan, np.inf, "1", None, True])
def test_other_spacings_are_refused(spacing: float) -> None:
    with pytest.raises(InvalidArgument, match=r"spacing is .*above 0"):
        ring().resample(spacing)


@pytest.mark.parametrize("near", [[0.0, 1.0], "here", [np.nan, 0, 0]])
def test_other_beginnings_are_refused(near: object) -> None:
    with pytest.raises(InvalidArgument, match="start_near is"):
        ring().resample(0.1, start_near=near)  # type: ignore[arg-type]


def test_a_copy_has_no_mesh() -> None:
    again = copy.copy(ring())
    assert again.mesh is None
    assert again.points.tolist() == ring().points.tolist()
    with pytest.raises(InvalidArgument, match="a copy of a curve has no mesh"):
        again.resample(0.1)


def test_files_of_a_closed_curve_join_its_last_point_to_its_first(tmp_path: Path) -> None:
    line = ring()
    count, points = len(line.points), line.points.tolist()
    suffixes = ("obj", "ply", "vtp", "dxf", "csv", "json", "geojson", "npz", "npy")
    files = {suffix: tmp_path / f"ring.{suffix}" for suffix in suffixes}
    for file in files.values():
        line.save(file)
    last = files["obj"].read_text().splitlines()[-1].split()
    assert last == ["l", *map(str, range(1, count + 1)), "1"]
    assert files["ply"].read_text().splitlines()[-1] == f"{count - 1} 0"
    shown = pyvista.read(files["vtp"])
    assert shown.points.shape == (count, 3)
    assert shown.lines.tolist() == [count + 1, *range(count), 0]
    assert shown.field_data["length"][0] == line.length
    (drawn,) = ezdxf.readfile(files["dxf"]).modelspace()
    assert drawn.is_closed
    np.testing.assert_allclose([vertex.dxf.location for vertex in drawn.vertices], points)
    with files["csv"].open() as file:
        assert [[float(row[x]) for x in "xyz"] for row in csv.DictReader(file)] == points
    assert json.loads(files["json"].read_text())["closed"] is True
    shape = json.loads(files["geojson"].read_text())["geometry"]
    assert shape == {"type": "LineString", "coordinates": [*points, points[0]]}
    arrays = np.load(files["npz"])
    assert arrays["points"].tolist() == points
    assert arrays["faces"].tolist() == line.faces.tolist()
    assert (bool(arrays["closed"]), float(arrays["length"])) == (True, line.length)
    assert np.load(files["npy"]).tolist() == points


@zoo.each({**zoo.SMALL, **zoo.IRREGULAR})
def test_boundaries_are_the_edges_of_one_face(case: zoo.Case | zoo.Irregular) -> None:
    """Each once, in loops, with its face on the left; open only at edges of three faces."""
    mesh = mesh_of(case)
    edges = [edge for edge, count in edge_kinds(mesh).items() if count == 1]
    found = mesh.boundaries()
    assert sorted(curve.length for curve in found) == [curve.length for curve in found][::-1]
    passed = []
    for curve in found:
        vertices = [point.vertex_index for point in curve.locations]
        steps = list(zip(vertices, vertices[1:] + vertices[:1], strict=True))
        steps = steps if curve.closed else steps[:-1]
        assert len(curve.faces) == len(steps)
        for face, (u, v) in zip(curve.faces.tolist(), steps, strict=True):
            assert {u, v} <= set(mesh.faces[face].tolist())
            passed.append((min(u, v), max(u, v)))
        if not curve.closed:
            odd = {v for edge, count in edge_kinds(mesh).items() if count > 2 for v in edge}
            assert {vertices[0], vertices[-1]} <= odd or isinstance(case, zoo.Irregular)
    assert sorted(passed) == sorted(edges)


def test_the_surface_is_on_the_left_of_its_boundary() -> None:
    """An annulus: counter-clockwise outside, clockwise inside; the other way where turned over."""
    case = zoo.SMALL["annulus"]
    for faces, sign in ((case.faces, 1), (np.asarray(case.faces)[:, ::-1], -1)):
        outer, inner = gc.TriangleMesh(case.vertices, faces).boundaries()
        areas = []
        for loop in (outer, inner):
            x, y, _ = loop.points.T
            areas.append(0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()))
        assert np.sign(areas).tolist() == [sign, -sign]


def test_the_rim_of_barriers_is_a_boundary() -> None:
    mesh = gc.samples.sphere(80).with_barriers([3])
    (rim,) = mesh.boundaries()
    assert sorted(point.vertex_index for point in rim.locations) == sorted(mesh.faces[3].tolist())


@pytest.mark.jit
def test_a_curve_through_points_is_that_of_their_curve():
    mesh = gc.samples.knot(2000)
    loop = gc.shortest_loop(mesh, 7)
    path = gc.shortest_path(mesh, 0, gc.SurfacePoint.face(700, (0.2, 0.3, 0.5)))
    for curve in (loop, path, loop.reversed()):
        again = mesh.curve(curve.locations, closed=curve.closed)
        assert again.closed == curve.closed
        assert again.length == pytest.approx(curve.length, rel=1e-12)
        assert again.locations == tuple(map(mesh.point, curve.locations))
        assert gc.straighten(again).length == pytest.approx(gc.straighten(curve).length, rel=1e-12)


def test_curves_leave_out_points_that_repeat():
    mesh = gc.samples.plane(2)
    curve = mesh.curve([0, 0, 1, 1, 3])
    assert [point.vertex_index for point in curve.locations] == [0, 1, 3]
    assert mesh.curve([2]).length == 0.0
    ring = mesh.curve([0, 1, 3, 0], closed=True)
    assert [point.vertex_index for point in ring.locations] == [0, 1, 3]
    assert ring.length == 2.0 + 2.0**0.5


@pytest.mark.parametrize(
    ("points", "closed", "message"),
    [
        ([], False, "without points"),
        ([0, 120], False, "no face in common"),
        ([0, 1, 2], True, "no face holds the last point"),
        ([0, 10**6], False, "point 1 of the curve"),
        ([60], False, "in no face that is free"),
        ([60, 60], False, "in no face that is free"),
        ([60, 61], False, "no face in common"),
    ],
)
def test_what_is_no_curve(points, closed, message):
    mesh = gc.samples.plane(200)
    walled = mesh.with_barriers(np.flatnonzero((mesh.faces == 60).any(axis=1)))
    with pytest.raises(gc.errors.GeodesicError, match=message):
        walled.curve(points, closed)
