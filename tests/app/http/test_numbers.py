"""Numbers in the bodies of queries: as JSON has them, not texts in quotes."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.exceptions import RequestValidationError
from pydantic import create_model

from app.http.routes.query_route import read
from app.queries import KINDS
from app.settings import Settings

POINTS = [
    7,
    {"vertex": 7},
    {"edge": [0, 1], "t": 0.5},
    {"face": 3, "barycentric": [1, 0, 0.0]},
    {"position": [1, 2.5, 3], "max_distance": 4},
]
SOURCES = [
    7,
    *({**point, "start_distance": 1} for point in POINTS if isinstance(point, dict)),
    {"polyline": POINTS, "start_distance": 0.5},
]
ACCURACY = {"relative_error": 0.1, "absolute_error": 1}
LIMITS = {"max_distance": 9, "barriers": [5]}
LINES = {"sources": SOURCES, "chord_error": 1, **LIMITS}
BODIES: dict[str, dict[str, Any]] = {
    "distances": {"sources": SOURCES, "targets": POINTS, "effort": 2, **ACCURACY, **LIMITS},
    "path": {"source": 1, "target": 2, "waypoints": POINTS, "effort": 4, **ACCURACY, **LIMITS},
    "steps": {"source": 1, "target": 2, "waypoints": POINTS, **LIMITS},
    "sweep": {"sources": POINTS, "steps": 20, "barriers": [5]},
    "paths": {"source": 1, "targets": POINTS, "effort": 8, **ACCURACY, **LIMITS},
    "isolines": {"values": [1, 1.5], "levels": [1, 1.5], "count": 3, **LINES, **ACCURACY},
    "borders": LINES,
    "boundaries": {"barriers": [5]},
    "cut": {"curves": [{"polyline": POINTS}]},
    "samples": {"count": 3, "radius": 9, "starts": POINTS, "iterations": 2, "barriers": [5]},
    "cells": LINES,
    "mean": {"points": POINTS, "weights": [1, 0.5], "barriers": [5]},
    "loop": {"through": POINTS[3], "curves": [{"polyline": POINTS}], "barriers": [5]},
    "matrix": {"sources": POINTS, "targets": POINTS, "effort": 1, **ACCURACY, **LIMITS},
    "nearest": {"source": 1, "candidates": POINTS, "k": 2, **LIMITS},
    "log_map": {"source": POINTS[3], "x_axis": [1, 0.5, 0], **LIMITS},
    "trace": {"starts": POINTS, "directions": [[1, 0.5, 0]], "lengths": [2], "barriers": [5]},
    "locate": {"points": [[1, 2.5, 3]], "max_distance": 1},
}
"""For each kind of query a body with all members that are numbers"""


def read_body(kind: str, body: Any) -> Any:
    model: Any = create_model("Request", body=(KINDS[kind].model, ...))
    return read(model, {}, json.dumps(body).encode(), Settings()).body


def is_accepted(kind: str, body: Any) -> bool:
    try:
        read_body(kind, body)
    except RequestValidationError:
        return False
    return True


def quoted(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the value once for each number in it, with that number in quotes, and its place."""
    if isinstance(value, dict):
        for name, member in value.items():
            for where, changed in quoted(member, f"{place}/{name}"):
                yield where, {**value, name: changed}
    elif isinstance(value, list):
        for i, item in enumerate(value):
            for where, changed in quoted(item, f"{place}/{i}"):
                yield where, [*value[:i], changed, *value[i + 1 :]]
    else:
        yield place, str(value)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_numbers_in_quotes_are_refused(kind: str) -> None:
    assert is_accepted(kind, BODIES[kind])
    accepted = [place for place, body in quoted(BODIES[kind]) if is_accepted(kind, body)]
    assert accepted == []


@pytest.mark.parametrize(
    "kind", sorted(KINDS.keys() - {"boundaries", "cut", "loop", "samples", "mean", "sweep"})
)
def test_integers_are_numbers_as_well(kind: str) -> None:
    body = read_body(kind, BODIES[kind])
    (given,) = BODIES[kind]["lengths"] if kind == "trace" else [BODIES[kind]["max_distance"]]
    (limit,) = body.lengths if kind == "trace" else [body.max_distance]
    assert (limit, type(limit)) == (given, float)
