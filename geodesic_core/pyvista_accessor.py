"""Geodesics on PyVista's own meshes: ``dataset.geodesics``.

PyVista (0.48 and later) imports this module when ``geodesics`` is first asked for, by the entry
point that the distribution declares. Its own ``geodesic`` goes along edges, by Dijkstra.
"""

from typing import Any

import pyvista

from geodesic_core.mesh.surface_curve import Sources
from geodesic_core.mesh.surface_point import Point, Points
from geodesic_core.plotting import with_distances
from geodesic_core.solvers import exact_distance, shortest_path


@pyvista.register_dataset_accessor("geodesics", pyvista.PolyData)
class GeodesicsAccessor:
    """Geodesics on a ``pyvista.PolyData``, whose points are the vertices.

    Each call prepares the mesh anew. To ask several questions, make a `geodesic_core.Solver` of it.

    Examples
    --------
    >>> import pyvista
    >>> ball = pyvista.Icosphere(nsub=2)
    >>> ball.geodesics.distance(0).point_data["distance"].shape
    (162,)
    >>> ball.geodesics.path(0, 9).n_lines
    1
    """

    def __init__(self, dataset: pyvista.PolyData) -> None:
        self._dataset = dataset

    def distance(self, sources: Sources, max_distance: float | None = None) -> Any:
        """Return a copy of the mesh with the exact distance from the nearest source.

        Parameters
        ----------
        sources, max_distance
            As in `geodesic_core.exact_distance`.

        Returns
        -------
        pyvista.PolyData
            With ``distance``, float64 in mesh units, infinite where unreachable, and
            ``nearest_source`` at its points.

        Raises
        ------
        GeodesicError
            As in `geodesic_core.exact_distance`.
        """
        field = exact_distance(self._dataset, sources, max_distance)
        return with_distances(self._dataset.copy(), field.distances, field.nearest_source)

    def path(self, source: Point, target: Point, waypoints: Points = ()) -> Any:
        """Return the exact shortest path between two points as a line.

        Parameters
        ----------
        source, target, waypoints
            As in `geodesic_core.shortest_path`.

        Returns
        -------
        pyvista.PolyData
            A line, with its length in ``field_data["length"]``.

        Raises
        ------
        GeodesicError
            As in `geodesic_core.shortest_path`.
        """
        return shortest_path(self._dataset, source, target, waypoints).to_pyvista()
