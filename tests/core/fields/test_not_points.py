"""Values that are no points, wherever points are asked for: the refusal names what helps."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc

pytestmark = pytest.mark.slice(8)

MESH = gc.samples.sphere(80)
SOLVER = gc.Solver(MESH)
FIELD = gc.exact_distance(MESH, 0)
POSITIONS = MESH.vertices[:4]
MASK = MESH.vertices[:, 2] > 0.5

SEVERAL: dict[str, Callable[[Any], Any]] = {
    "targets": lambda points: gc.exact_distance(MESH, 0, targets=points),
    "targets, approximate": lambda points: gc.approximate_distance(MESH, 0, targets=points),
    "targets, fast": lambda points: SOLVER.fast_distance(0, targets=points),
    "waypoints": lambda points: gc.shortest_path(MESH, 0, 7, points),
    "rows": lambda points: gc.distance_matrix(MESH, points),
    "columns": lambda points: SOLVER.distance_matrix(0, points),
    "candidates": lambda points: gc.nearest(MESH, 0, points),
    "rows of parts": lambda points: gc.MatrixParts(MESH, points),
    "rows of a file": lambda points: gc.write_matrix(MESH, Path("none.npy"), points),
}
"""Calls that take points, where a start distance or a curve has no meaning"""
SOURCES: dict[str, Callable[[Any], Any]] = {
    "sources": lambda points: gc.exact_distance(MESH, points),
    "sources, approximate": SOLVER.approximate_distance,
    "sources, fast": lambda points: gc.fast_distance(MESH, points),
    "a curve": lambda points: gc.exact_distance(MESH, gc.Curve(points)),
}
ONE: dict[str, Callable[[Any], Any]] = {
    "source of a path": lambda point: gc.shortest_path(MESH, point, 7),
    "target of a path": lambda point: SOLVER.shortest_path(7, point),
    "start": lambda point: gc.nearest(MESH, point, [1, 2]),
    "point": MESH.point,
    "position": MESH.position,
    "point of a field": FIELD.distance_at,
    "source of a point": FIELD.nearest_source_at,
    "end of a path": FIELD.path_to,
    "neighbour": lambda point: gc.share_a_face(MESH, 0, point),
}
LOCATE, FLATNONZERO, RAVEL = (
    r"mesh\.locate\(\[x, y, z\]\)",
    r"numpy\.flatnonzero\(mask\)",
    r"numpy\.ravel\(indices\)",
)
WRONG: dict[str, tuple[Any, str]] = {
    "a position": ([0.1, 0.2, 0.3], LOCATE),
    "an array of a position": (POSITIONS[0], LOCATE),
    "positions": (POSITIONS, LOCATE),
    "float32 positions": (POSITIONS.astype(np.float32), LOCATE),
    "lists of positions": (POSITIONS.tolist(), LOCATE),
    "positions of integers": ([[0, 0, 1], [1, 0, 0]], LOCATE),
    "positions in tuples": ([(0.0, 0.0, 1.0)], LOCATE),
    "a mask": (MASK, FLATNONZERO),
    "a list of truth values": (MASK.tolist(), FLATNONZERO),
    "a mask in a column": (MASK[:, None], FLATNONZERO),
    "indices by argwhere": (np.argwhere(MASK), RAVEL),
    "indices by nonzero": (np.nonzero(MASK), RAVEL),
}


@pytest.mark.jit
@pytest.mark.parametrize("place", [*SEVERAL, *SOURCES])
@pytest.mark.parametrize("kind", WRONG)
def test_points_of_another_kind(place: str, kind: str) -> None:
    points, helps = WRONG[kind]
    with pytest.raises(gc.errors.InvalidPoint, match=rf"(?s) 0 .*must be a vertex.*; .*{helps}"):
        (SEVERAL | SOURCES)[place](points)


@pytest.mark.jit
@pytest.mark.parametrize("place", ONE)
@pytest.mark.parametrize("kind", WRONG)
def test_one_point_of_another_kind(place: str, kind: str) -> None:
    point, helps = WRONG[kind]
    with pytest.raises(gc.errors.InvalidPoint, match=rf"(?s)must be a vertex.*; .*{helps}"):
        ONE[place](point)


@pytest.mark.jit
@pytest.mark.parametrize("place", SEVERAL)
def test_a_number_that_is_no_index(place: str) -> None:
    for number, helps in ((0.5, LOCATE), (np.float64(0.5), LOCATE), (True, FLATNONZERO)):
        with pytest.raises(gc.errors.InvalidArgument, match=f"a sequence of points; .*{helps}"):
            SEVERAL[place](number)


@pytest.mark.jit
@pytest.mark.parametrize("source", [gc.Source(3, 0.5), gc.Source(3), gc.Curve([0, 1])], ids=str)
def test_start_distances_and_curves_are_for_sources_of_fields(source: Any) -> None:
    """Elsewhere no other source competes: a start distance would be a constant added."""
    for ask in SEVERAL.values():
        for points in (source, [source], [0, source]):
            with pytest.raises(gc.GeodesicError, match="for the sources of exact_distance, approx"):
                ask(points)
    for ask in ONE.values():
        with pytest.raises(gc.errors.InvalidPoint, match="for the sources of exact_distance, appr"):
            ask(source)


@pytest.mark.jit
def test_what_refusals_name_is_taken() -> None:
    indices = np.flatnonzero(MASK)
    expected = gc.exact_distance(MESH, indices.tolist()).distances
    for sources in (np.flatnonzero(MASK), np.ravel(np.argwhere(MASK)), np.ravel(np.nonzero(MASK))):
        np.testing.assert_array_equal(gc.exact_distance(MESH, sources).distances, expected)
    places = [MESH.locate(position) for position in POSITIONS]
    np.testing.assert_array_equal(
        gc.distance_matrix(MESH, places), gc.distance_matrix(MESH, range(len(places)))
    )
    np.testing.assert_array_equal(
        gc.exact_distance(MESH, 0, barriers=np.flatnonzero(np.arange(80) > 77)).distances,
        gc.exact_distance(MESH, 0, barriers=[78, 79]).distances,
    )


@pytest.mark.parametrize("barriers", [np.arange(80) > 77, (np.arange(80) > 77).tolist()], ids=str)
def test_barriers_by_a_mask(barriers: Any) -> None:
    for ask in (
        lambda: gc.exact_distance(MESH, 0, barriers=barriers),
        lambda: gc.shortest_path(MESH, 0, 7, barriers=barriers),
        lambda: gc.nearest(MESH, 0, [7], barriers=barriers),
        lambda: MESH.with_barriers(barriers),
    ):
        with pytest.raises(gc.errors.InvalidArgument, match=r"barrier 0 .* numpy\.flatnonzero"):
            ask()


@pytest.mark.parametrize("face", [0.5, True, "7", None])
def test_a_face_that_is_no_index(face: Any) -> None:
    with pytest.raises(gc.errors.InvalidPoint, match=r"the point is in face .*; .* is an integer"):
        MESH.point(gc.SurfacePoint.face(face, (1.0, 0.0, 0.0)))


@pytest.mark.parametrize(
    "thing", [None, object(), "7", {}, [[0, 1], [2]], 1j], ids=lambda thing: type(thing).__name__
)
def test_other_things_are_refused_without_advice(thing: Any) -> None:
    with pytest.raises(gc.errors.InvalidPoint, match=r"\(an integer\) or a SurfacePoint$"):
        MESH.point(thing)
