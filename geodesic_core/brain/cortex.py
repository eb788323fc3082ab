"""The cortex: surfaces of hemispheres, the region that counts, and what its wall means."""

import hashlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats, Longs
from geodesic_core.brain.maps import Maps, MapSource, read_maps, read_values
from geodesic_core.brain.structures import Side, Structure, side_of_file, side_of_image
from geodesic_core.control import Control
from geodesic_core.errors import BlockedSource, InvalidArgument, NoSuchLabel
from geodesic_core.io.annotation import check_vertices
from geodesic_core.io.as_mesh import as_mesh, join_meshes
from geodesic_core.io.unpacking import read_unpacked
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.mesh.vertex_areas import vertex_areas, with_vertex_areas
from geodesic_core.validation import check_choice

Wall = Literal["blocks", "passes"]
"""What is outside of the region is to paths"""

_NO_PARCEL = {"???", "unknown", "medialwall", "none", "background", "unassigned"}
"""Names of labels that stand for no parcel, in lower case and without blanks and underscores; and
what begins as the next one does"""
_BACKGROUND = "background+"


@dataclass(frozen=True, eq=False)
class Cortex:
    """Surfaces of one hemisphere or both, as one mesh, and the vertices that count.

    Vertices of the second hemisphere follow those of the first. No path leads from one to the
    other.

    Examples
    --------
    >>> ball = gc.samples.sphere(80)
    >>> cortex = gc.brain.load_cortex({"left": ball, "right": ball}, np.ones(84), "passes")
    >>> cortex.structures[1]
    Structure(side='right', first=42, count=42, faces=80)
    """

    mesh: TriangleMesh
    """Whose barriers are the faces outside of the region, where the wall blocks"""
    structures: tuple[Structure, ...]
    region: Longs
    """(K,) vertices of the mesh that count, ascending"""
    wall: Wall | None
    """``"blocks"`` or ``"passes"``; None where the region is all"""
    areas: Floats
    """(V,) mm²: a third of the faces around each vertex, or the corrected areas"""
    corrected_areas: str | None
    """SHA-256 of the corrected areas, float64; None where there were none"""

    @cached_property
    def facts(self) -> dict[str, Any]:
        """What a file tells of it: units, wall, and the vertices of the region by structure."""
        return {
            "units": "mm",
            "wall": self.wall,
            "structures": {
                s.name: {"first": s.first, "vertices": s.count} for s in self.structures
            },
            "region": {s.name: self.region_of(s).tolist() for s in self.structures},
            "corrected_areas": self.corrected_areas,
        }

    def region_of(self, structure: Structure) -> Longs:
        """Return the vertices of a structure that count, in its own numbers.

        Parameters
        ----------
        structure
            One of `structures`.

        Returns
        -------
        (n,) int64
            Ascending.

        Examples
        --------
        >>> cortex = gc.brain.load_cortex({"right": gc.samples.sphere(80)}, [3, 5], "passes")
        >>> cortex.region_of(cortex.structures[0])
        array([3, 5])
        """
        return structure.of(self.region)

    def in_words(self, vertex: int) -> str:
        """Return a vertex of the mesh as users number it.

        Parameters
        ----------
        vertex
            Its number in the mesh.

        Returns
        -------
        str
            Such as ``"vertex 5 of the left surface"``.

        Examples
        --------
        >>> gc.brain.load_cortex({"right": gc.samples.sphere(80)}).in_words(5)
        'vertex 5 of the right surface'
        """
        structure = next(s for s in self.structures if s.part.start <= vertex < s.part.stop)
        return f"vertex {vertex - structure.first} of the {structure.side} surface"


def load_cortex(
    surfaces: Any,
    roi: MapSource | None = None,
    wall: Wall | None = None,
    *,
    corrected_areas: MapSource | None = None,
) -> Cortex:
    """Return one hemisphere or both as a `Cortex`.

    Parameters
    ----------
    surfaces
        A surface, or one for each side: paths, or anything else that `as_mesh` takes, among them
        images of nibabel and a ``PolyMesh`` or ``SurfaceImage`` of nilearn. The side is told by a
        GIFTI file's metadata, or by the name; or give a dictionary with the keys ``"left"`` and
        ``"right"``.
    roi
        The vertices that count: those of a value above 0, those of a label other than *unknown*,
        *???* or the medial wall, or those that a ``.label`` file or integers list. A file for each
        surface, in their order or by side, or one for all: GIFTI, CIFTI-2, ``.label``, ``.annot``
        and values of FreeSurfer, ``.npy``, ``.csv``; also arrays and images. None for all vertices.
    wall
        With a region: ``"blocks"`` keeps paths out of faces that have a corner outside of it, and
        so exactly along its rim; ``"passes"`` lets them through, as Workbench's ``-roi`` does.
    corrected_areas
        Area of each vertex, mm², as Workbench's ``-corrected-areas`` takes it: the mean of areas of
        individuals, for an average surface, which is too small. Each edge is longer by the ratio of
        the sums of the square roots of the areas at its ends, and the metric of faces is that of
        these lengths.

    Returns
    -------
    Cortex
        Surfaces in the order in which they are given.

    Raises
    ------
    InvalidArgument
        It is not told which side a surface is of, or what the wall means; a file is damaged.
    OtherSurface
        Values are not as many as the vertices of their surface.
    NoSuchLabel
        The region has no vertex of a surface.
    InvalidMesh
        A surface cannot be used; the corrected lengths are not those of triangles.
    MissingExtra
        A file needs nibabel, the extra ``brain``.

    Warns
    -----
    BlockedSource
        Vertices of the region have no face inside of it, and the wall blocks.

    Notes
    -----
    O(V + F).

    Examples
    --------
    >>> ball = gc.samples.sphere(320)
    >>> front = ball.vertices[:, 0] > 0
    >>> cortex = gc.brain.load_cortex({"left": ball}, front, wall="blocks")
    >>> bool(len(cortex.region) == front.sum())
    True
    """
    meshes = _meshes_by_side(surfaces)
    structures, first = [], 0
    for side, mesh in meshes.items():
        structures.append(Structure(side, first, len(mesh.vertices), len(mesh.faces)))
        first += len(mesh.vertices)
    mesh = join_meshes(list(meshes.values()))
    areas, digest = vertex_areas(mesh), None
    if corrected_areas is not None:
        corrected = read_values(corrected_areas, structures)[0]
        mesh = with_vertex_areas(mesh, areas, corrected)
        areas, digest = corrected, hashlib.sha256(corrected.tobytes()).hexdigest()
    if (roi is None) != (wall is None):
        raise InvalidArgument(
            "say what a wall means: wall='blocks' keeps paths inside of the roi, wall='passes' "
            "lets them through"
            if wall is None
            else "a wall needs a roi, outside of which it is"
        )
    if wall is None:
        region = np.arange(len(mesh.vertices))
    else:
        check_choice("wall", wall, ("blocks", "passes"))
        region = _region(roi, structures)
    cortex = Cortex(mesh, tuple(structures), region, wall, areas, digest)
    return _walled(cortex) if wall == "blocks" else cortex


def _meshes_by_side(surfaces: Any) -> dict[Side, TriangleMesh]:
    parts = getattr(getattr(surfaces, "mesh", surfaces), "parts", surfaces)  # of nilearn
    if not (isinstance(parts, Mapping) and set(parts) <= {"left", "right"}):
        several = list(surfaces) if isinstance(surfaces, list | tuple) else [surfaces]
        if len(several) > 2 or (len(several) == 2 and np.ndim(several[0]) > 0):
            several = [surfaces]  # arrays of one mesh
        parts = {_side_of(each): each for each in several}
        if len(parts) < len(several) or None in parts:
            unknown = parts.get(None)
            what = unknown if isinstance(unknown, str | Path) else "each"
            raise InvalidArgument(
                f"which hemisphere is {what}? Neither metadata nor name tell: "
                "give {'left': …, 'right': …}"
            )
    return {side: as_mesh(surface) for side, surface in parts.items()}


def _side_of(surface: Any) -> Side | None:
    if isinstance(surface, str | Path):
        return side_of_file(read_unpacked(surface, ("gii",), None, Control()))
    return side_of_image(surface) if hasattr(surface, "darrays") else None


def _region(roi: MapSource, structures: list[Structure]) -> Longs:
    total = sum(each.count for each in structures)
    if isinstance(roi, list) and all(isinstance(each, int | np.integer) for each in roi):
        roi = np.asarray(roi)
    listed: NDArray[Any] = roi if isinstance(roi, np.ndarray) else np.empty(0)
    if listed.ndim == 1 and listed.dtype.kind in "iu" and len(listed) != total:
        check_vertices(listed, total, "the roi")
        inside = np.isin(np.arange(total), listed)
    else:
        maps = read_maps(roi, structures)
        inside = np.concatenate([is_labelled(each) for each in maps])
    for each in structures:
        if not inside[each.part].any():
            raise NoSuchLabel(f"the roi has no vertex of the {each.side} surface")
    return np.flatnonzero(inside)


def is_labelled(maps: Maps) -> NDArray[np.bool_]:
    """Return which vertices have a value above 0 in the first map, or the label of a parcel."""
    values = maps.values[0]
    if maps.table is None:
        return np.asarray(np.nan_to_num(values, nan=0.0) > 0.0)
    keys = [key for key, name in maps.table.items() if not _stands_for_none(name)]
    return np.isin(values, keys)


def _stands_for_none(name: str) -> bool:
    plain = name.strip().lower()
    return plain.startswith(_BACKGROUND) or plain.replace("_", "").replace(" ", "") in _NO_PARCEL


def _walled(cortex: Cortex) -> Cortex:
    """Return a cortex whose faces with a corner outside of the region are blocked."""
    faces = cortex.mesh.faces
    is_free = np.isin(faces, cortex.region).all(axis=1)
    if not is_free.any():
        raise NoSuchLabel("no face has all of its corners in the roi: its wall would block all")
    alone = np.setdiff1d(cortex.region, faces[is_free])
    if len(alone):
        warnings.warn(
            f"{len(alone)} vertices of the roi have no face inside of it, such as "
            f"{cortex.in_words(int(alone[0]))}: as the wall blocks, no path leads there",
            BlockedSource,
            stacklevel=3,
        )
    return replace(cortex, mesh=cortex.mesh.with_barriers(np.flatnonzero(~is_free)))
