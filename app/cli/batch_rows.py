"""Rows of the table of `geodesic batch`: the same questions, answered for one mesh."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

from app.cli.points import Point
from app.cli.words import with_options

if TYPE_CHECKING:
    from geodesic_core import DistanceField, SurfacePoint, TriangleMesh


@dataclass(frozen=True)
class Row:
    """A row of the table: a question to a mesh, or a mesh that failed."""

    mesh: str
    vertices: int | None = None
    faces: int | None = None
    source: str | None = None
    target: str | None = None
    """None where the row is of all vertices"""
    distance: float | None = None
    """From source to target, mesh units; None where there is no path"""
    farthest: float | None = None
    """Largest distance of a vertex from the source, mesh units; None where none was reached"""
    mean: float | None = None
    """Mean distance of the vertices that were reached"""
    unreachable: int | None = None
    """Vertices that were not reached"""
    error_bound: str | None = None
    read_s: float | None = None
    """Seconds of reading the mesh"""
    solve_s: float | None = None
    error: str | None = None
    """Why the mesh, or the question, has no answer"""
    warning: str | None = None
    """What is hardly meant with the points of the question"""


@dataclass(frozen=True)
class Questions:
    """The questions to each mesh."""

    sources: Sequence[Point]
    targets: Sequence[Point]
    options: dict[str, Any]
    """Of the solver, its method among them"""
    merge: Literal["none", "exact"] | float
    file_format: str | None = None


def ask(questions: Questions, file: Path) -> list[Row]:
    """Return the rows of a mesh, at least one; whatever fails is a row, and stops no other mesh."""
    import geodesic_core as gc

    start = perf_counter()
    try:
        mesh = gc.load_mesh(file, questions.file_format, questions.merge)
    except Exception as error:  # noqa: BLE001 - above
        return [Row(str(file), error=_reason(error))]
    read = Row(str(file), len(mesh.vertices), len(mesh.faces), read_s=perf_counter() - start)
    return [
        row for source in questions.sources for row in _rows_from(questions, source, mesh, read)
    ]


def _rows_from(questions: Questions, source: Point, mesh: "TriangleMesh", read: Row) -> list[Row]:
    """Return the rows of a source."""
    import geodesic_core as gc
    from app.queries.points import notes_on, resolve_point

    solvers: dict[str, Callable[..., DistanceField]] = {
        "exact": gc.exact_distance,
        "approximate": gc.approximate_distance,
        "fast": gc.fast_distance,
    }
    options = dict(questions.options)
    solve = solvers[options.pop("method")]
    read, start = replace(read, source=source.text), perf_counter()
    try:
        targets = [resolve_point(mesh, target.point) for target in questions.targets]
        point = resolve_point(mesh, source.point)
        written = [(each.text, each.point) for each in (source, *questions.targets)]
        notes = notes_on(mesh, written, [point, *targets])
        field = solve(mesh, point, targets=targets, retain="distances", **options)
        answers = _of_targets(questions, targets, field) if targets else [_of_all_vertices(field)]
    except Exception as error:  # noqa: BLE001 - see `ask`
        return [replace(read, error=_reason(error))]
    found = replace(
        read,
        error_bound=json.dumps(asdict(field.error_bound)),
        solve_s=(perf_counter() - start) / len(answers),
        warning=" ".join(notes) or None,
    )
    return [replace(found, **answer) for answer in answers]


def _of_targets(
    questions: Questions, targets: "Sequence[SurfacePoint]", field: "DistanceField"
) -> list[dict[str, Any]]:
    """Return what the row of each target tells."""
    return [
        {"target": target.text, "distance": distance if isfinite(distance) else None}
        for target, distance in zip(questions.targets, map(field.distance_at, targets), strict=True)
    ]


def _of_all_vertices(field: "DistanceField") -> dict[str, Any]:
    """Return what a row of all vertices tells."""
    import numpy as np

    reached = field.distances[np.isfinite(field.distances)]
    unreachable = {"unreachable": len(field.distances) - len(reached)}
    if not len(reached):
        return unreachable
    return unreachable | {"farthest": float(reached.max()), "mean": float(reached.mean())}


def _reason(error: Exception) -> str:
    """Return why a mesh or a question failed, in a line; what nobody expects has its kind."""
    from geodesic_core import GeodesicError

    line = with_options(" ".join(str(error).split()))
    is_expected = isinstance(error, GeodesicError | OSError)
    return line if is_expected else f"{type(error).__name__}: {line}"
