"""Notes of answers on points that are hardly meant: far from the surface, or walled in."""

import math
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc
from app.queries import KINDS, ExecutionContext, MeshSize, Query
from app.queries.points import FAR_SHARE
from app.store.meshes import OpenMesh

SQUARE = gc.samples.plane(32)
DIAGONAL = math.sqrt(2.0)
OPENED = OpenMesh.of(SQUARE)
FAR = {"position": [14.0, 14.0, 14.0]}
NEAR = {"position": [0.5, 0.5, 0.9 * FAR_SHARE * DIAGONAL]}
AWAY = "is 23.10844 away from the surface, at [14.0, 14.0, 14.0]; the nearest point of the surface"
RIGHT = np.flatnonzero((SQUARE.vertices[:, 0] > 0.6)[SQUARE.faces].all(axis=1)).tolist()
"""A wall from x = 0.75 on; the vertices 4 and 9 lie in it"""
BLOCKED = "lies in blocked faces only: no path leads there."

QUESTIONS: list[tuple[str, dict[str, Any], list[str]]] = [
    ("distances", {"sources": [0, FAR], "targets": [NEAR, FAR]}, ["Source 1", "Target 1"]),
    ("distances", {"sources": [{"polyline": [24, FAR]}]}, ["Point 1 of source 0"]),
    ("path", {"source": FAR, "target": NEAR, "waypoints": [3, FAR]}, ["The source", "Waypoint 1"]),
    ("path", {"source": NEAR, "target": FAR, "method": "fast"}, ["The target"]),
    ("paths", {"source": {"polyline": [FAR]}, "targets": [FAR]}, ["Point 0 of the source"]),
    ("isolines", {"sources": [FAR], "count": 2}, ["Source 0"]),
    ("borders", {"sources": [NEAR, FAR]}, ["Source 1"]),
    ("samples", {"count": 3, "starts": [NEAR, FAR]}, ["Start 1"]),
    ("cells", {"sources": [NEAR, FAR]}, ["Source 1"]),
    ("loop", {"curves": [{"polyline": [NEAR]}, {"polyline": [24, FAR]}]}, ["Point 1 of curve 1"]),
    ("nearest", {"source": 0, "candidates": [NEAR, FAR]}, ["Candidate 1"]),
    ("log_map", {"source": FAR, "x_axis": 3}, ["The source"]),
    ("sweep", {"sources": [NEAR, FAR]}, ["Source 1"]),
    ("trace", {"starts": [NEAR, FAR], "directions": [0.1], "lengths": [0.1]}, ["Start 1"]),
    ("matrix", {"sources": "all", "targets": [NEAR, FAR]}, ["Target 1"]),
    ("matrix", {"sources": [NEAR, FAR], "targets": "all"}, ["Source 1"]),
    ("matrix", {"sources": [FAR], "targets": [0], "layout": "pairs"}, ["Source 0"]),
]


def asked(kind: str, **members: Any) -> tuple[Query[Any], OpenMesh]:
    size = MeshSize(len(SQUARE.vertices), len(SQUARE.faces), 0.25)
    query = KINDS[kind].ask(OPENED.name[0], size, KINDS[kind].model.model_validate(members))
    return query, query.with_barriers(OPENED) if len(query.barriers) else OPENED


def warnings_of(kind: str, **members: Any) -> list[str]:
    query, opened = asked(kind, **members)
    context = ExecutionContext(lambda: False, lambda _share: None)
    return list(query.answer(opened, context).members["warnings"])


@pytest.mark.parametrize(("kind", "members", "names"), QUESTIONS)
def test_answers_name_positions_far_from_the_surface(
    kind: str, members: dict[str, Any], names: list[str]
) -> None:
    found = warnings_of(kind, **members)
    assert [warning.split(" is ")[0] for warning in found][: len(names)] == names
    assert all(AWAY in warning for warning in found)


def test_positions_near_the_surface_are_as_meant() -> None:
    """The share is the bound: on both sides of it, at any size and place."""
    for scale, shift in ((1.0, 0.0), (1e-6, 0.0), (1e5, 3e6)):
        mesh = gc.TriangleMesh(scale * SQUARE.vertices + shift, SQUARE.faces)
        opened = OpenMesh.of(mesh)
        for share, count in ((0.99, 0), (1.01, 1)):
            height = share * FAR_SHARE * DIAGONAL
            position = (scale * np.array([0.5, 0.5, height]) + shift).tolist()
            query, _ = asked("distances", sources=[{"position": position}])
            points = query.resolved(mesh, lambda: False)
            assert len(query.noted(opened, points).warnings) == count


def test_a_distance_that_is_allowed_is_no_news() -> None:
    allowed = FAR | {"max_distance": 24.0}
    assert warnings_of("distances", sources=[allowed]) == []
    assert warnings_of("locate", points=[FAR["position"]]) == [], "its answer has the distance"


@pytest.mark.parametrize(
    ("kind", "members", "names"),
    [
        ("distances", {"sources": [4, 0, {"vertex": 9}]}, ["Source 0, vertex 4", "Source 2, v"]),
        ("paths", {"source": 4, "targets": [0, 9]}, ["The source, vertex 4", "Target 1, vertex 9"]),
        ("path", {"source": 0, "target": 9}, ["The target, vertex 9"]),
        ("nearest", {"source": 9, "candidates": [0]}, ["The source, vertex 9"]),
        ("matrix", {"sources": "all", "targets": [3, 4]}, ["Target 1, vertex 4"]),
        ("isolines", {"sources": [4, 0], "levels": [0.1]}, ["Source 0, vertex 4"]),
        ("borders", {"sources": [0, 4]}, ["Source 1, vertex 4"]),
    ],
)
def test_answers_name_points_in_blocked_faces_only(
    kind: str, members: dict[str, Any], names: list[str]
) -> None:
    found = warnings_of(kind, **members, barriers=RIGHT)
    assert len(found) == len(names)
    for warning, name in zip(found, names, strict=True):
        assert warning.startswith(name)
        assert warning.endswith(BLOCKED)
    assert warnings_of(kind, **members) == [], "the wall is to blame"


def test_a_few_of_many_points_stand_for_all() -> None:
    found = warnings_of("matrix", sources=[FAR] * 13, targets=[FAR] * 9)
    assert len(found) == 11
    assert found[-1] == "The same holds for 12 more points."


def test_warnings_of_the_mesh_come_first() -> None:
    opened = OpenMesh(OPENED.name, OPENED.solver, ["Of the mesh."])
    query, _ = asked("distances", sources=[FAR])
    context = ExecutionContext(lambda: False, lambda _share: None)
    first, second = query.answer(opened, context).members["warnings"]
    assert first == "Of the mesh."
    assert AWAY in second


def test_parts_of_a_matrix_have_the_notes() -> None:
    query, opened = asked("matrix", sources=[FAR, 0], targets="all")
    answer = query.answer_of_parts(opened, 50, lambda: False)
    assert AWAY in answer.members["warnings"][0]
