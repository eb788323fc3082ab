"""Cells: the parts of a surface that are nearest to each source, as meshes."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_core.arrays import Floats, Ints, sums_by
from geodesic_core.control import Control
from geodesic_core.cutting.cut import cut_along
from geodesic_core.cutting.cut_mesh import CutMesh
from geodesic_core.cutting.lines import NO_LINE, as_line
from geodesic_core.cutting.separation import parts_of
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.borders import Border
from geodesic_core.fields.charts import charts_of
from geodesic_core.fields.question import Question
from geodesic_core.mesh.surface_curve import SurfaceCurve
from geodesic_core.mesh.surface_point import Curve, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.reprs import as_table

if TYPE_CHECKING:
    from geodesic_core.fields.distance_field import DistanceField

_UNKNOWN = -2


@dataclass(frozen=True, eq=False, repr=False)
class Cells:
    """The cells of N sources: the mesh cut apart along their borders.

    Each face of the cut mesh belongs to the source that is nearest to it. Borders are chords of
    their curves, see `DistanceField.borders`; so are the areas.

    Examples
    --------
    >>> mesh = gc.samples.plane(200)  # the unit square
    >>> cells = gc.exact_distance(mesh, [0, 10, 110]).cells()  # three of its corners
    >>> cells.areas.round(6).tolist()
    [0.25, 0.375, 0.375]
    >>> cells.adjacency.tolist()
    [[0, 1], [0, 2], [1, 2]]
    """

    field: "DistanceField"
    borders: tuple[Border, ...]
    cut: CutMesh
    """The mesh, cut apart along the borders."""
    cell_of: Ints
    """(F',) int32: the source that each face of `cut` belongs to; -1 where unreachable, and in
    barriers."""

    def __len__(self) -> int:
        return len(self.field.sources)

    @cached_property
    def areas(self) -> Floats:
        """(N,) float64, mesh units squared; 0 where other sources are nearer everywhere."""
        reached = self.cell_of >= 0
        areas = self.cut.mesh.face_areas[reached]
        return sums_by(self.cell_of[reached], areas, len(self))

    @cached_property
    def adjacency(self) -> Ints:
        """(M, 2) int32: pairs of sources whose cells share a border, each once, in order."""
        return np.unique(self._pairs, axis=0)

    @cached_property
    def border_lengths(self) -> Floats:
        """(M,) float64, mesh units: the length of border that each pair of `adjacency` shares."""
        rows = np.unique(self._pairs, axis=0, return_inverse=True)[1]
        lengths = [border.length for border in self.borders]
        return sums_by(rows.reshape(-1), np.array(lengths), len(self.adjacency))

    @property
    def _pairs(self) -> Ints:
        return np.array([border.sources for border in self.borders], np.int32).reshape(-1, 2)

    @cached_property
    def centroids(self) -> tuple[SurfacePoint | None, ...]:
        """The middle of each cell, N points of the field's mesh; None for a cell of no area.

        Where the straight way ends that leads from the source to the centroid of the cell in the
        source's log map. In the plane that is the centroid; elsewhere `relax_points` finds points
        that are the centroids of their own cells. O(one sweep of the cut mesh).

        Raises
        ------
        InvalidArgument
            A source is a curve.
        NoTangentPlane
            A source has none.
        """
        points: list[Any] = [source.point for source in self.field.sources]
        if any(isinstance(point, Curve | SurfaceCurve) for point in points):
            raise InvalidArgument("cells of curves have no centroids: only points have log maps")
        rows = np.flatnonzero(self.areas > 0.0)
        mesh, places = self.cut.mesh, [self.field.mesh.point(points[i]) for i in rows]
        question = Question.of(mesh, self.cut.to_new(places), (), np.inf, Control())
        charts = charts_of(question, Control())
        faces = np.flatnonzero(np.isin(self.cell_of, rows) & (mesh.face_areas > 0.0))
        corners, cells = charts.coordinates[mesh.faces[faces]], self.cell_of[faces]
        moments = mesh.face_areas[faces, None] * corners.mean(axis=1)
        sums = [sums_by(cells, moment, len(self)) for moment in moments.T]
        vectors = np.stack(sums, axis=1)[rows] / self.areas[rows, None]
        found: list[SurfacePoint | None] = [None] * len(self)
        for i, point in zip(rows, self.cut.to_old(charts.moved(vectors, Control())), strict=True):
            found[i] = point
        return tuple(found)

    def meshes(self) -> list[TriangleMesh]:
        """Return each cell as a mesh of its own.

        Returns
        -------
        list of TriangleMesh
            N meshes; the faces of cell i are those of ``cut`` where ``cell_of == i``, in order, and
            its vertices those that they have, in order.

        Raises
        ------
        InvalidArgument
            A cell has no area.

        Examples
        --------
        >>> cells = gc.exact_distance(gc.samples.plane(200), [0, 10]).cells()
        >>> [mesh.report.components for mesh in cells.meshes()]
        [1, 1]
        """
        empty = np.flatnonzero(self.areas == 0.0)
        if len(empty):
            raise InvalidArgument(f"the cell of source {empty[0]} has no area, so it is no mesh")
        return [self._mesh_of(i) for i in range(len(self))]

    def _mesh_of(self, cell: int) -> TriangleMesh:
        cut, rows = self.cut, np.flatnonzero(self.cell_of == cell)
        used, faces = np.unique(cut.faces[rows], return_inverse=True)
        faces = faces.reshape(-1, 3)
        lengths = cut.mesh.lengths
        if lengths is None:
            return TriangleMesh(cut.vertices[used], faces)
        vertices = cut.vertices[used] if cut.old.has_positions else None
        return TriangleMesh.from_lengths(faces, lengths[rows], vertices)

    def __repr__(self) -> str:
        return f"Cells({len(self)} cells, {len(self.adjacency)} pairs of neighbours)"

    def _repr_html_(self) -> str:
        return as_table("Cells", {"cells": len(self), "pairs of neighbours": len(self.adjacency)})


def cells_of(
    field: "DistanceField",
    borders: list[Border],
    limits: list[SurfaceCurve],
    max_distance: float,
    control: Control,
) -> Cells:
    """Return the cells of a field between borders, and within the isolines of ``max_distance``.

    Raises
    ------
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    mesh = field.mesh
    curves = [*borders, *limits]
    lines = [as_line(mesh, curve, f"border {i}", control) for i, curve in enumerate(curves)]
    cut = cut_along(mesh, lines or [NO_LINE], control, separate=True)
    return Cells(field, tuple(borders), cut, _cell_of(field, cut, max_distance, control))


def _cell_of(field: "DistanceField", cut: CutMesh, max_distance: float, control: Control) -> Ints:
    """Return the source of each face of a mesh that was cut apart along borders.

    No border crosses a part: all of it belongs to the source of any vertex off all borders, or of
    any point inside. Barriers part the surface as borders do.
    """
    mesh = field.mesh
    free = np.flatnonzero(~np.isin(cut.face_of, mesh.barriers))
    vertices = cut.copy_of[cut.faces[free]]
    parts = parts_of(vertices, cut.curve_edges)
    on_border = np.zeros(len(cut.vertices), bool)
    on_border[cut.copy_of[cut.curve_edges]] = True
    tells = ~on_border[vertices] & (vertices < len(mesh.vertices))
    nearest = np.where(field.distances <= max_distance, field.nearest_source, -1)
    told, of_part = nearest[vertices[tells]], np.repeat(parts, 3)[tells.reshape(-1)]
    source_of = np.full(int(parts.max()) + 1, _UNKNOWN, np.int32)
    source_of[of_part] = told
    for part in control.watched(np.flatnonzero(source_of == _UNKNOWN)):
        faces = free[parts == part]
        largest = int(faces[cut.mesh.face_areas[faces].argmax()])
        middle = cut.to_old(SurfacePoint.face(largest, (1 / 3, 1 / 3, 1 / 3)))
        is_within = field.distance_at(middle) <= max_distance
        source_of[part] = field.nearest_source_at(middle) if is_within else -1
    found: Ints = np.full(len(cut.faces), -1, np.int32)
    found[free] = source_of[parts]
    return found
