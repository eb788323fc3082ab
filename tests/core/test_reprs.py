"""Reprs of results: the facts in a line, and a table in notebooks."""

from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import geodesic_core as gc

SQUARE = gc.samples.plane(2)
APART = gc.TriangleMesh(
    np.vstack([SQUARE.vertices, SQUARE.vertices + 9.0]), np.vstack([SQUARE.faces, SQUARE.faces + 4])
)
FIELD = gc.exact_distance(SQUARE, 0)

SHOWN: list[tuple[Any, str]] = [
    (SQUARE, "TriangleMesh(4 vertices, 2 faces)"),
    (SQUARE.with_barriers([1]), "TriangleMesh(4 vertices, 2 faces, 1 of them blocked)"),
    (FIELD, "DistanceField(4 vertices, 1 source, 1.41421 farthest, exact)"),
    (
        gc.exact_distance(APART, [0, 1]),
        "DistanceField(8 vertices, 2 sources, 4 unreached, 1 farthest, exact)",
    ),
    (
        gc.approximate_distance(SQUARE, 0, 0.001),
        "DistanceField(4 vertices, 1 source, 1.41421 farthest, guaranteed relative error 0.001)",
    ),
    (gc.shortest_path(SQUARE, 1, 2), "GeodesicPath(3 points, length 1.41421, exact)"),
    (gc.shortest_path(SQUARE, 1, 1), "GeodesicPath(1 point, length 0, exact)"),
    (gc.Solver(SQUARE), "Solver(TriangleMesh(4 vertices, 2 faces))"),
    (FIELD.isolines([0.5])[0][0], "SurfaceCurve("),
]


@pytest.mark.parametrize(("thing", "line"), SHOWN, ids=[line for _, line in SHOWN])
def test_the_facts_are_in_one_line(thing: Any, line: str) -> None:
    assert repr(thing).startswith(line)
    assert "\n" not in repr(thing)
    assert len(repr(thing)) < 100


@pytest.mark.jit
def test_the_repr_of_a_large_field_is_as_short() -> None:
    assert len(repr(gc.exact_distance(gc.samples.sphere(2000), 0))) < 100


@pytest.mark.parametrize(
    ("thing", "facts"),
    [
        (SQUARE, {"vertices": "4", "faces": "2", "size": "1 × 1 × 0"}),
        (SQUARE.with_barriers([1]), {"blocked faces": "1"}),
        (FIELD, {"source": "1", "farthest": "1.41421", "accuracy": "exact"}),
        (
            gc.shortest_path(SQUARE, 1, gc.SurfacePoint.face(1, (0.5, 0.25, 0.25))),
            {"from": "vertex 1", "to": "the point (0.5, 0.25, 0.25) of face 1"},
        ),
    ],
    ids=repr,
)
def test_notebooks_show_a_table(thing: Any, facts: dict[str, str]) -> None:
    table = ET.fromstring(thing._repr_html_())  # noqa: S314 - our own
    caption, *rows = table
    assert caption.text == type(thing).__name__
    shown = {row[0].text: row[1].text for row in rows}
    assert shown.items() >= facts.items()
