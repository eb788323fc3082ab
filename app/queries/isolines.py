"""Lines of equal distance."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from app.encoding import CSV, GEOJSON, JSON, OBJ, SVG, Answer
from app.queries.accuracy import (
    bound_of,
    likely_bound,
    method_of,
    solve_field,
    topics_of,
    with_its_error,
)
from app.queries.base import ExecutionContext, Likely, Query
from app.queries.cost_model import (
    ARC_IN_FACE,
    FACES_ON_LEVEL,
    PER_FACE_CROSSED,
    PER_POINT,
    PER_WINDOW_CROSSED,
    PIECES_BY_WINDOWS,
    PIECES_IN_FACE,
    Cost,
    rough_share,
    share_within,
    straight_to_nearest,
    sweep_cost,
    typical_edge,
)
from app.queries.places import Places
from app.queries.points import described_source
from app.queries.sources import named_sources, point_count, starts_of
from app.queries.stats import likely_stats, stats_of
from app.queries.validation import MeshSize, Named, refuse_large_json, refuse_more, refuse_places
from app.queries.views import lines_of
from app.schemas.requests import Accuracy, IsolinesRequest
from app.settings import Settings
from app.store.meshes import OpenMesh
from geodesic_core.fields.isolines import as_chord_error, spaced_levels

_VALUES_OF_POINT, _VALUES_OF_LEVEL = 4, 1
"""What the JSON of a point has: position, and the face of its piece; and what each level adds."""


class IsolinesQuery(Query[IsolinesRequest]):
    """The points at some distances from ``sources``, as polylines."""

    kind = "isolines"
    model = IsolinesRequest
    offers: Sequence[str] = (JSON, OBJ, CSV, SVG, GEOJSON)
    hint = "ask for fewer levels at once, or grant a larger chord_error"

    @classmethod
    def normal(cls, request: IsolinesRequest) -> IsolinesRequest:
        """Name the error that is granted; refuse levels that are told twice or not at all."""
        if request.levels is None and request.count is None:
            raise refuse_places(["/levels"], "give levels, or count for some evenly spaced")
        if request.levels is not None and request.count is not None:
            raise refuse_places(["/count"], "does not go with levels")
        return with_its_error(request)

    def refuse(self, settings: Settings) -> None:
        """Refuse too many sources or levels."""
        refuse_more("sources", point_count(*self.request.sources), settings, "max_sources")
        refuse_more("levels", self._level_count, settings, "max_levels")

    @property
    def affinity_keys(self) -> tuple[str, ...]:
        """The field of these sources, and the mesh."""
        return topics_of(self, self.request.sources)

    def points(self) -> Named:
        """Yield the sources."""
        return named_sources(self.request.sources)

    def rough_seconds(self, size: MeshSize) -> float:
        """Return the cost of a sweep to the limit, and of the lines."""
        request = self.request
        share = rough_share(size, point_count(*request.sources), request.max_distance)
        crossed = min(1.0, self._level_count * FACES_ON_LEVEL / math.sqrt(size.faces)) * share
        sweep = sweep_cost(size.faces, request, share, crossed=crossed)
        return sweep.seconds + PER_FACE_CROSSED * crossed * size.faces

    def solve(self, opened: OpenMesh, places: Places, grant: ExecutionContext) -> Answer:
        """Sweep, and draw level after level, as long as they fit into the answer."""
        chord_error = self._chord_error(opened.mesh)
        starts = starts_of(opened.mesh, self.request.sources, places)
        field = solve_field(
            opened,
            self.request,
            starts,
            grant.part(0, 2),
            max_distance=self.request.max_distance,
            isolines=True,
        )
        found: list[dict[str, Any]] = []
        values = 0
        levels = self._levels(field.distances)
        drawn = field.each_isoline(levels, chord_error, **grant.part(1, 2).options)
        for level, lines in zip(levels, drawn, strict=True):
            values += _VALUES_OF_LEVEL
            values += _VALUES_OF_POINT * sum(len(line.points) for line in lines)
            refuse_large_json(values, grant.max_values, self.hint)
            found.append(told_of(level, lines))
        bound, stats = bound_of(field.error_bound), stats_of(field.stats)
        return self._answer(opened, starts, chord_error, found, bound, stats)

    def likely(self, opened: OpenMesh, places: Places) -> Likely:
        """Return what a sweep and its lines cost, each as it would be were geodesics straight."""
        request, mesh = self.request, opened.mesh
        chord_error = self._chord_error(mesh)
        starts = starts_of(mesh, request.sources, places)
        share = 1.0
        if request.max_distance is not None:
            share = min(1.0, len(places) * float(share_within(mesh, request.max_distance)))
        away, _ = straight_to_nearest(mesh, places, None, request.max_distance)
        levels = self._levels(away)
        crossed = [_crossed_faces(mesh, away, level) for level in levels]
        found = [
            {"level": level, "lines": [_straight_line(mesh, level, faces)] if len(faces) else []}
            for level, faces in zip(levels, crossed, strict=True)
        ]
        counts = np.array([len(faces) for faces in crossed])
        sweep = sweep_cost(len(mesh.faces), request, share, crossed=counts.sum() / len(mesh.faces))
        per_face = PER_FACE_CROSSED
        if request.method == "exact":
            per_face += PER_WINDOW_CROSSED * math.sqrt(share * len(mesh.faces))
        seconds = sweep.seconds + PER_POINT * len(places) + per_face * float(counts.sum())
        pieces = _pieces(mesh, request, np.array(levels), chord_error)
        times = float(counts @ pieces) / counts.sum() if counts.any() else 1.0
        bound, stats = likely_bound(request), likely_stats(mesh, share)
        answer = self._answer(opened, starts, chord_error, found, bound, stats)
        return Likely(Cost(seconds, sweep.memory_bytes), answer, times)

    @property
    def _level_count(self) -> int:
        request = self.request
        return len(request.levels) if request.levels is not None else request.count or 0

    def _levels(self, distances: NDArray[np.float64]) -> list[float]:
        """Return the levels that are asked for, or refuse to space some where nothing is away."""
        request = self.request
        if request.levels is not None:
            return request.levels
        try:
            levels = spaced_levels(distances, self._level_count)
        except gc.errors.InvalidArgument as error:
            raise refuse_places(["/count"], str(error)) from None
        return [float(level) for level in levels]

    def _chord_error(self, mesh: gc.TriangleMesh) -> float:
        try:
            return as_chord_error(mesh, self.request.chord_error)
        except gc.errors.InvalidArgument as error:
            raise refuse_places(["/chord_error"], str(error)) from None

    def _answer(
        self,
        opened: OpenMesh,
        starts: Sequence[gc.Source],
        chord_error: float,
        found: Sequence[Mapping[str, Any]],
        error_bound: Mapping[str, Any],
        stats: Mapping[str, Any],
    ) -> Answer:
        return Answer(
            {
                "mesh_id": self.mesh_id,
                **method_of(self.request),
                "error_bound": error_bound,
                "chord_error": chord_error,
                "sources": [described_source(opened.mesh, start) for start in starts],
                "isolines": found,
                "stats": stats,
                "warnings": opened.warnings,
            },
            shown=("isolines",),
            lines=lambda: lines_of(found),
        )


def told_of(level: float, lines: Sequence[gc.Isoline]) -> dict[str, Any]:
    """Return what answers say of a level."""
    told = [
        {"closed": each.closed, "length": each.length, "points": each.points, "faces": each.faces}
        for each in lines
    ]
    return {"level": level, "lines": told}


def _crossed_faces(
    mesh: gc.TriangleMesh, away: NDArray[np.float64], level: float
) -> NDArray[np.int32]:
    """Return the faces that have corners on both sides of a level."""
    inside = away[mesh.faces] <= level
    return np.flatnonzero(inside.any(axis=1) & ~inside.all(axis=1)).astype(np.int32)


def _straight_line(mesh: gc.TriangleMesh, level: float, faces: NDArray[np.int32]) -> dict[str, Any]:
    """Return a line of a point for each face that is crossed."""
    points = mesh.vertices[mesh.faces[faces]].mean(axis=1)
    return {"closed": True, "length": level, "points": points, "faces": faces}


def _pieces(
    mesh: gc.TriangleMesh,
    request: Accuracy,
    levels: NDArray[np.float64],
    chord_error: float,
) -> NDArray[np.float64]:
    """Return in how many pieces a line of each level crosses a face.

    Windows cut it into arcs. An arc of radius r turns by its length over r, by a right angle at
    most, and each chord turns by √(8 c / r), for the error c.
    """
    least = PIECES_IN_FACE
    if request.method == "exact":
        least += PIECES_BY_WINDOWS * math.sqrt(len(mesh.faces))
    turns = np.minimum(ARC_IN_FACE * typical_edge(mesh) / levels, 0.5 * np.pi)
    pieces: NDArray[np.float64] = np.maximum(turns / np.sqrt(8.0 * chord_error / levels), least)
    return pieces
