"""Parcels of a cortex, from files of labels."""

import warnings
from collections import Counter
from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats, Longs
from geodesic_core.brain.cortex import Cortex, is_labelled
from geodesic_core.brain.maps import Maps, MapSource, read_maps
from geodesic_core.errors import EmptyParcel, NoSuchLabel
from geodesic_core.fields.scalar_field import ScalarField
from geodesic_core.mesh.surface_curve import SurfaceCurve


@dataclass(frozen=True, eq=False)
class Parcellation:
    """Parcels of a cortex.

    Examples
    --------
    >>> ball = gc.samples.sphere(320)
    >>> cortex = gc.brain.load_cortex({"left": ball})
    >>> parcels = gc.brain.load_parcels(1 + (ball.vertices[:, 2] > 0), cortex)
    >>> parcels.names
    ('1', '2')
    >>> bool(np.isclose(parcels.areas.sum(), cortex.areas.sum()))
    True
    """

    cortex: Cortex
    parcel_of: Longs
    """(V,) index of the parcel of each vertex of the mesh; -1 for none"""
    names: tuple[str, ...]
    """(P,) no two the same"""
    keys: tuple[int, ...]
    """(P,) the number of each in its file"""

    @property
    def areas(self) -> Floats:
        """(P,) mm²: the sum of the areas of its vertices."""
        sums = np.bincount(self.parcel_of + 1, self.cortex.areas, minlength=1 + len(self.names))
        return sums[1:].astype(np.float64)  # the first is that of no parcel

    def borders(self) -> list[list[SurfaceCurve]]:
        """Return the border of each parcel: lines halfway between its vertices and others.

        Returns
        -------
        list of list of SurfaceCurve
            Those of each parcel, with the parcel on their left, as the faces are wound.

        Notes
        -----
        O(P F).

        Examples
        --------
        >>> ball = gc.samples.sphere(320)
        >>> cortex = gc.brain.load_cortex({"left": ball})
        >>> parcels = gc.brain.load_parcels(ball.vertices[:, 2] > 0, cortex)
        >>> [[line.closed for line in lines] for lines in parcels.borders()]
        [[True]]
        """
        mesh = self.cortex.mesh
        return [
            ScalarField(mesh, (self.parcel_of == k).astype(np.float64)).isolines([0.5])[0]
            for k in range(len(self.names))
        ]


def load_parcels(labels: MapSource, cortex: Cortex) -> Parcellation:
    """Return the parcels of a cortex: the labels of the vertices in its region.

    Parameters
    ----------
    labels
        ``.dlabel.nii``, ``.label.gii``, ``.annot``, ``.csv`` or ``.npy``, an array or an image: one
        for each surface, or one for all, as the ``roi`` of `load_cortex`. Vertices with a label
        such as *unknown*, *???* or the medial wall have none; where labels have no names, those
        that are not above 0.
    cortex
        The surfaces, and the region.

    Returns
    -------
    Parcellation
        In the order of surfaces, then of numbers in the file. A label of a CIFTI file is one
        parcel, also where both hemispheres have it. In other files, each hemisphere has its own,
        whose names begin with ``L_`` or ``R_`` where the other one has the same name.

    Raises
    ------
    InvalidArgument, OtherSurface, MissingExtra
        As in `load_cortex`.
    NoSuchLabel
        No vertex of the region has a label.

    Warns
    -----
    EmptyParcel
        Labels have vertices, but none in the region.

    Notes
    -----
    O(V).

    Examples
    --------
    >>> cortex = gc.brain.load_cortex({"left": gc.samples.sphere(80)})
    >>> gc.brain.load_parcels(np.arange(42) // 14, cortex).keys
    (1, 2)
    """
    maps = read_maps(labels, cortex.structures)
    is_shared = len(maps) > 1 and maps[0].table is not None and maps[0].table is maps[1].table
    groups: dict[tuple[int, int], Longs] = {}
    for k, (each, structure) in enumerate(zip(maps, cortex.structures, strict=True)):
        labelled = np.flatnonzero(is_labelled(each))
        keys = each.values[0, labelled].astype(np.int64)
        for key in np.unique(keys).tolist():
            group = (0 if is_shared else k, key)
            vertices = structure.first + labelled[keys == key]
            groups[group] = np.concatenate([groups.get(group, vertices[:0]), vertices])
    kept = {group: np.intersect1d(vertices, cortex.region) for group, vertices in groups.items()}
    names = _names_of(list(groups), maps, cortex)
    empty = [names[group] for group, vertices in kept.items() if not len(vertices)]
    if len(empty) == len(groups):
        raise NoSuchLabel("no vertex of the region has a label")
    if empty:
        message = f"{len(empty)} parcels have no vertex in the region: {', '.join(empty[:5])}"
        warnings.warn(message, EmptyParcel, stacklevel=2)
    parcel_of = np.full(len(cortex.areas), -1)
    filled = [group for group, vertices in kept.items() if len(vertices)]
    for number, group in enumerate(filled):
        parcel_of[kept[group]] = number
    return Parcellation(
        cortex, parcel_of, tuple(names[group] for group in filled), tuple(key for _, key in filled)
    )


def _names_of(
    groups: list[tuple[int, int]], maps: list[Maps], cortex: Cortex
) -> dict[tuple[int, int], str]:
    """Return a name for each group of vertices, of a surface and a label; no two the same."""
    names = {(k, key): (maps[k].table or {}).get(key, str(key)) for k, key in groups}
    for longer in ("{side}_{name}", "{name}_{key}"):
        given = Counter(names.values())
        for k, key in groups:
            name, side = names[k, key], cortex.structures[k].side[0].upper()
            if given[name] > 1:
                names[k, key] = longer.format(side=side, name=name, key=key)
    return names
