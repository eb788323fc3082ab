"""Values at the vertices of a surface, linear on each face: their level sets and gradients."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core import plotting
from geodesic_core.arrays import Floats
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.isolines import check_level_count, drawn_levels
from geodesic_core.kernels.curves.chains import link_crossing_chains
from geodesic_core.kernels.curves.level_sets import chain_level_set
from geodesic_core.mesh.canonical import as_given, each_of
from geodesic_core.mesh.surface_curve import SurfaceCurve, curves_of, draw_over
from geodesic_core.mesh.surface_point import Point, Points
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.plotting import Camera
from geodesic_core.validation import is_number


@dataclass(frozen=True, eq=False, init=False)
class ScalarField:
    """Values at the vertices of a surface, linear on each face.

    They are the caller's own: a thickness, a curvature, a blend of distances.

    Parameters
    ----------
    mesh
        The surface.
    values
        (V,) real numbers; NaN or infinite where there is no value.

    Raises
    ------
    InvalidArgument
        There are not as many values as vertices, or they are no real numbers.

    Examples
    --------
    >>> mesh = gc.samples.plane(200)  # the unit square
    >>> heights = gc.ScalarField(mesh, mesh.vertices[:, 1])
    >>> (line,) = heights.isolines([0.25])[0]
    >>> line.closed, round(line.length, 12)
    (False, 1.0)
    >>> heights.at(gc.SurfacePoint.vertex(0))
    0.0
    """

    mesh: TriangleMesh
    values: Floats
    """(V,) float64"""

    def __init__(self, mesh: TriangleMesh, values: ArrayLike) -> None:
        """Hold the values, as a copy."""
        try:
            own = np.array(values, np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidArgument(f"the values are not real numbers: {error}") from error
        if own.shape != (len(mesh.vertices),):
            raise InvalidArgument(
                f"the values have shape {own.shape}; it must be ({len(mesh.vertices)},), one for "
                "each vertex"
            )
        own.flags.writeable = False
        object.__setattr__(self, "mesh", mesh)
        object.__setattr__(self, "values", own)

    def levels(self, count: int) -> Floats:
        """Return levels for `isolines`, evenly spaced between the lowest and the highest value.

        Parameters
        ----------
        count
            Number of levels, 1 or more.

        Returns
        -------
        numpy.ndarray
            (count,) float64, ascending; the lowest and the highest value are left out.

        Raises
        ------
        InvalidArgument
            The count is not an integer of 1 or more, or no two values differ.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> gc.ScalarField(mesh, mesh.vertices[:, 0]).levels(3).tolist()
        [0.25, 0.5, 0.75]
        """
        check_level_count(count)
        present = self.values[np.isfinite(self.values)]
        if not len(present) or present.min() == present.max():
            raise InvalidArgument("no two values differ, so that no level lies between")
        shares = np.arange(1, count + 1) / (count + 1)
        levels: Floats = present.min() * (1.0 - shares) + present.max() * shares
        return levels

    def isolines(self, levels: Sequence[float]) -> list[list[SurfaceCurve]]:
        """Return for each level, in their order, the lines of points with that value.

        They have the higher values on their left, as the faces are wound. They are closed, or end
        at the boundary, at an edge of more than two faces, or where values are missing. What is at
        the level itself counts as below it: a line follows the rim of a plateau at its height where
        values rise from there, and passes through vertices and along edges at the level likewise.

        Parameters
        ----------
        levels
            Finite numbers.

        Returns
        -------
        list of list of SurfaceCurve
            The lines of each level, longest first; their points are on edges and vertices.

        Raises
        ------
        InvalidArgument
            A level is not a finite number.

        Notes
        -----
        O(F) for each level.

        Examples
        --------
        >>> mesh = gc.samples.sphere(320)
        >>> tropics = gc.ScalarField(mesh, mesh.vertices[:, 2]).isolines([-0.4, 0.4])
        >>> [[line.closed for line in lines] for lines in tropics]
        [[True], [True]]
        """
        if isinstance(levels, str | bytes) or not isinstance(levels, Sequence | np.ndarray):
            raise InvalidArgument(f"levels is {levels!r}; it must be a sequence of numbers")
        for i, level in enumerate(levels):
            if not is_number(level) or not np.isfinite(level):
                raise InvalidArgument(f"level {i} is {level!r}; it must be a finite number")
        return [self._lines(float(level)) for level in levels]

    def _lines(self, level: float) -> list[SurfaceCurve]:
        topology = self.mesh.topology
        at_inner = self.values[topology.outer_vertex]
        half_edges, chains = chain_level_set(topology, at_inner, level)
        lines = link_crossing_chains(topology, half_edges, chains, 0.0)
        return sorted(curves_of(self.mesh, lines), key=lambda line: -line.length)

    def gradient(self) -> Floats:
        """Return the gradient on each face: the direction in which values rise most, and how fast.

        Returns
        -------
        numpy.ndarray
            (F, 3) float64, values by mesh units; NaN on faces without area, and where a value is
            missing.

        Raises
        ------
        InvalidArgument
            The mesh is given by lengths: its faces have no place in space.

        Notes
        -----
        O(F).

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> slope = gc.ScalarField(mesh, mesh.vertices @ [3.0, 4.0, 0.0])
        >>> slope.gradient()[0, :2].round(12).tolist()
        [3.0, 4.0]
        """
        self.mesh.require_embedded("a gradient")
        corners = self.mesh.vertices[self.mesh.faces]
        values = self.values[self.mesh.faces]
        across = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)  # opposite each corner
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        square = (normal * normal).sum(axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            rises = (values[:, :, None] * across).sum(axis=1)
            gradient: Floats = np.cross(rises, normal) / square
        gradient[~np.isfinite(gradient).all(axis=1)] = np.nan
        return gradient

    def at(self, points: Points) -> Any:
        """Return the value at a point, or the values at several.

        Parameters
        ----------
        points
            Vertex indices or `SurfacePoint`, one or several.

        Returns
        -------
        float or numpy.ndarray
            Of several points (N,) float64; NaN where a value is missing.

        Raises
        ------
        InvalidPoint, InvalidArgument
            One is not a point of the mesh.

        Examples
        --------
        >>> mesh = gc.samples.plane(2)
        >>> field = gc.ScalarField(mesh, [0.0, 1.0, 2.0, 3.0])
        >>> field.at(3), field.at([1, gc.SurfacePoint.face(0, (0.5, 0.5, 0.0))]).tolist()
        (3.0, [1.0, 0.5])
        """
        found = [self._at(point, f"point {i}") for i, point in enumerate(each_of(points, "point"))]
        one_or_all = as_given(points, found)
        return np.array(found) if one_or_all is found else one_or_all

    def _at(self, given: Point, name: str) -> float:
        point = self.mesh.point(given, name)
        if point.vertex_index is not None:
            return float(self.values[point.vertex_index])
        shares = zip(point.barycentric, self.values[self.mesh.faces[point.face_index]], strict=True)
        return float(sum(share * value for share, value in shares if share > 0.0))

    def plot(
        self,
        isolines: int | Sequence[float] = 0,
        paths: Iterable[SurfaceCurve] = (),
        points: Iterable[Point] = (),
        *,
        camera: Camera | None = None,
        title: str | None = None,
        save: str | Path | None = None,
    ) -> None:
        """Draw the surface in the colours of the values: in a window, a notebook, or a file.

        What has no value is grey.

        Parameters
        ----------
        isolines
            Levels of lines to draw, or how many, evenly spaced.
        paths, points
            Curves of any kind, and points, to draw as well.
        camera
            ``"iso"``, or the axis from which one looks: ``"+z"``, ``"-x"``…; by default ``"iso"``,
            and the flat side of what is flat.
        title
            A line above the picture.
        save
            A file to draw into, without a window: ``.png``, ``.jpg``, ``.tif`` or ``.bmp``.

        Raises
        ------
        MissingExtra
            PyVista is not installed; the extra ``plot`` brings it.
        InvalidArgument
            The suffix is not that of a picture, the file cannot be written, there is no such
            camera, or levels are to be spaced where no two values differ.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> file = Path(mkdtemp()) / "heights.png"
        >>> mesh = gc.samples.sphere(80)
        >>> gc.ScalarField(mesh, mesh.vertices[:, 2]).plot(isolines=5, save=file)
        >>> file.exists()
        True
        """
        with plotting.picture(save, camera, title, "ScalarField.plot") as plotter:
            surface = self.mesh.to_pyvista()
            surface.point_data["value"] = self.values
            surface.set_active_scalars("value")
            plotting.draw_surface(plotter, surface)
            levels = drawn_levels(isolines, self.levels)
            lines = [line.to_pyvista() for lines in self.isolines(levels) for line in lines]
            plotting.draw_lines(plotter, lines, plotting.ISOLINE, plotting.ISOLINE_WIDTH)
            draw_over(self.mesh, plotter, paths, points)
