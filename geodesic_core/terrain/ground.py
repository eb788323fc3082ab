"""Terrain: a surface, what its faces cost, and where on Earth it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_core.arrays import Floats
from geodesic_core.errors import InvalidArgument, NoHeight, UnsuitableCrs
from geodesic_core.mesh.surface_curve import SurfaceCurve
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.reprs import as_table
from geodesic_core.terrain.crs import as_crs, turned
from geodesic_core.terrain.map_files import write_map_file
from geodesic_core.validation import as_places


@dataclass(frozen=True, eq=False, repr=False)
class Terrain:
    """A surface over a map, with a cost for each face.

    Examples
    --------
    >>> land = gc.terrain.from_dem(np.zeros((3, 4)), transform=(10, 0, 500, 0, -10, 900))
    >>> land
    Terrain(12 vertices, 12 faces, 0 closed, CRS not known)
    >>> hut, lake = land.locate_xy([[505, 895], [535, 895]])
    >>> gc.shortest_path(land.mesh, hut, lake).length
    30.0
    """

    mesh: TriangleMesh
    costs: Floats
    """(F,) float64: the cost of each face, for `cost_distance` and `cheapest_path`; 1 where nothing
    was burnt, infinite where no path may go."""
    crs: str | None
    """The CRS of x and y, as WKT; None where it is not known."""
    notes: tuple[str, ...]
    """Sentences on how the raster was read."""

    def locate_xy(self, place: ArrayLike, crs: Any = None) -> Any:
        """Return the point of the surface at a place on the map, or several.

        Parameters
        ----------
        place
            (2,) or (N, 2): x and y, or longitude and latitude.
        crs
            Their CRS, where it is not that of the surface: such as ``"EPSG:4326"`` for WGS 84, or
            anything else that pyproj takes.

        Returns
        -------
        SurfacePoint or list of SurfacePoint
            Canonical.

        Raises
        ------
        NoHeight
            A place is outside of the surface, or in a gap.
        InvalidPoint
            A place is not two finite numbers.
        UnsuitableCrs
            That CRS is not known, or that of the surface.
        MissingExtra
            libigl or pyproj is not installed.

        Notes
        -----
        As `TriangleMesh.locate_xy`.

        Examples
        --------
        >>> land = gc.terrain.from_dem(np.eye(2), (10, 0, 500, 0, -10, 900), crs="EPSG:32632")
        >>> str(land.locate_xy([505, 895]))
        'vertex 0'
        """
        places: Any = place
        if crs is not None:
            rows, is_one = as_places("place", place, 2)
            places = turned(np.array([row for _, row in rows]), crs, self._known_crs("a place"))
            places = places[0] if is_one else places
        try:
            return self.mesh.locate_xy(places)
        except NoHeight as error:
            raise NoHeight(f"{error}: nothing was measured there, or it is off the map") from None

    def with_costs(self, costs: ArrayLike) -> "Terrain":
        """Return the terrain with other costs.

        Parameters
        ----------
        costs
            (F,): a factor above 0 for each face, infinite where no path may go.

        Returns
        -------
        Terrain
            On the same mesh.

        Raises
        ------
        InvalidArgument
            They are not as many numbers as faces.

        Examples
        --------
        >>> land = gc.terrain.from_dem(np.eye(2), (10, 0, 500, 0, -10, 900))
        >>> land.with_costs([1.0, np.inf]).costs.tolist()
        [1.0, inf]
        """
        given, count = np.array(costs), len(self.mesh.faces)
        if given.shape != (count,) or given.dtype.kind not in "iuf":
            raise InvalidArgument(
                f"the costs have shape {given.shape} and type {given.dtype}; they must be "
                f"({count},) numbers, one for each face"
            )
        return replace(self, costs=given.astype(np.float64))

    def open_mesh(self) -> TriangleMesh:
        """Return the surface with faces of infinite cost as barriers, for exact distances.

        Returns
        -------
        TriangleMesh
            Whose other faces all cost the same.

        Raises
        ------
        InvalidArgument
            Faces have other costs than 1 and infinity, which exact distances do not know.

        Examples
        --------
        >>> land = gc.terrain.from_dem(np.eye(2), (10, 0, 500, 0, -10, 900))
        >>> land.with_costs([1.0, np.inf]).open_mesh().barriers.tolist()
        [1]
        """
        is_closed = np.isinf(self.costs)
        if (self.costs[~is_closed] != 1.0).any():
            raise InvalidArgument(
                "faces have other costs than 1 and infinity: use cost_distance or cheapest_path"
            )
        closed = np.flatnonzero(is_closed)
        return self.mesh.with_barriers(closed) if len(closed) else self.mesh

    def save(
        self,
        path: str | Path,
        curves: SurfaceCurve | Sequence[SurfaceCurve],
        properties: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        """Write paths or lines of equal cost into a file for maps, by its suffix.

        Heights stay those of the surface. Lines are as they are: one that crosses the meridian of
        180° is not divided.

        Parameters
        ----------
        path
            ``.geojson``: a feature for each curve, in WGS 84, as RFC 7946 has it, with length and
            cost. ``.gpx``: a track for each curve, in WGS 84. ``.csv``: a row for each point, in
            the coordinates of the surface, with the distance from the start on the map, and in
            WGS 84 as well where the CRS is known.
        curves
            One or more, on the surface.
        properties
            More facts for each curve, such as its level.

        Raises
        ------
        InvalidArgument
            The suffix is none of these, the file cannot be written, or there are not as many
            properties as curves.
        UnsuitableCrs
            GPX is in WGS 84, and the CRS of the surface is not known.
        MissingExtra
            pyproj is not installed.

        Warns
        -----
        NotWgs84
            The CRS is not known: GeoJSON then has the coordinates of the surface.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> land = gc.terrain.from_dem(np.eye(2), (10, 0, 500, 0, -10, 900), crs="EPSG:32632")
        >>> file = Path(mkdtemp()) / "way.csv"
        >>> land.save(file, gc.shortest_path(land.mesh, 1, 2))
        >>> file.read_text().splitlines()[0]
        'curve,distance,x,y,z,longitude,latitude'
        """
        given = [curves] if isinstance(curves, SurfaceCurve) else list(curves)
        facts = list(properties) or [{} for _ in given]
        if len(facts) != len(given):
            raise InvalidArgument(f"there are {len(facts)} properties for {len(given)} curves")
        write_map_file(path, given, facts, self.crs)

    def _known_crs(self, wanted: str) -> str:
        if self.crs is None:
            raise UnsuitableCrs(f"{wanted} has a CRS, but that of the surface is not known")
        return self.crs

    @property
    def _shown(self) -> dict[str, object]:
        return {
            "vertices": len(self.mesh.vertices),
            "faces": len(self.mesh.faces),
            "closed": int(np.isinf(self.costs).sum()),
            "CRS": "not known" if self.crs is None else as_crs(self.crs).name,
        }

    def __repr__(self) -> str:
        vertices, faces, closed, crs = self._shown.values()
        return f"Terrain({vertices} vertices, {faces} faces, {closed} closed, CRS {crs})"

    def _repr_html_(self) -> str:
        return as_table("Terrain", self._shown)
