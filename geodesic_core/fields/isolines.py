"""Isolines: lines of equal distance on the surface."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Flags, Floats, Ints
from geodesic_core.control import Control, in_slices
from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.sources import Nodes
from geodesic_core.kernels.curves.chains import Chains, link_crossing_chains
from geodesic_core.kernels.curves.thinning import thin_lines
from geodesic_core.kernels.front.state import FACE, NODE
from geodesic_core.kernels.isolines.arc_chains import chain_arcs
from geodesic_core.kernels.isolines.cuts import Cuts, bound_faces, cross_edges, cut_faces
from geodesic_core.kernels.mesh.half_edges import LENGTH, LENGTH_LEFT, TAIL
from geodesic_core.kernels.retained.face_windows import FaceWindows, RetainedSweep
from geodesic_core.mesh.surface_curve import SurfaceCurve, curves_of
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import FINEST_CHORD, LEVEL, PIECE
from geodesic_core.validation import is_index, is_number

CHORD_SHARE = 1e-3
"""Share of the mean edge length that chords may stray from their arcs by default."""


def spaced_levels(distances: Floats, count: int) -> Floats:
    """Return levels evenly spaced between 0 and the largest finite distance, both left out.

    Parameters
    ----------
    distances
        (N,) float64, mesh units; infinite where unreachable.
    count
        The number of levels, 1 or more.

    Returns
    -------
    levels
        (count,) float64, mesh units, ascending.

    Raises
    ------
    InvalidArgument
        The count is not an integer, 1 or more; or no finite distance is above 0.

    Examples
    --------
    >>> import numpy as np
    >>> gc.spaced_levels(np.array([0.0, 1.0, 4.0, np.inf]), 3).tolist()
    [1.0, 2.0, 3.0]
    """
    check_level_count(count)
    largest = distances.max(where=np.isfinite(distances), initial=0.0)
    if largest == 0.0:
        raise InvalidArgument(
            "no vertex but the sources is reached: there is no distance to divide into levels"
        )
    spaced: Floats = np.arange(1, count + 1) * (largest / (count + 1))
    return spaced


def check_level_count(count: int) -> None:
    """Raise ``InvalidArgument`` where a number of levels is no integer, 1 or more."""
    if not is_index(count) or count < 1:
        raise InvalidArgument(f"the count of levels is {count!r}; it must be an integer, 1 or more")


def drawn_levels(
    isolines: int | Sequence[float], spaced: Callable[[int], Floats]
) -> Sequence[float]:
    """Return the levels of a picture, given as such or as their number; 0 for none."""
    if not isinstance(isolines, int):
        return isolines
    return spaced(isolines).tolist() if isolines else []


def as_levels(levels: Sequence[float]) -> list[float]:
    """Return levels as floats.

    Raises
    ------
    InvalidArgument
        They are no sequence, or one of them is not a finite number above 0.
    """
    if isinstance(levels, str | bytes) or not isinstance(levels, Sequence | np.ndarray):
        raise InvalidArgument(f"levels is {levels!r}; it must be a sequence of distances")
    for i, level in enumerate(levels):
        if not is_number(level) or not (math.isfinite(level) and level > 0.0):
            raise InvalidArgument(f"level {i} is {level!r}; it must be a finite number above 0")
    return [float(level) for level in levels]


def resolve_chord_error(mesh: TriangleMesh, chord_error: float | None = None) -> float:
    """Return the chord error that isolines on a mesh are drawn with.

    Parameters
    ----------
    mesh
        The surface.
    chord_error
        The largest distance of chords from their arcs, mesh units; None for the default, a
        thousandth of the mean edge length, or the least that is taken where that is more.

    Returns
    -------
    chord_error
        The same, or the default; mesh units.

    Raises
    ------
    InvalidArgument
        It is not a finite number, or less than a billionth of the bounding box's diagonal.

    Examples
    --------
    >>> mesh = gc.TriangleMesh([[0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    >>> gc.resolve_chord_error(mesh)
    0.004
    >>> gc.resolve_chord_error(mesh, 0.1)
    0.1
    """
    finest = FINEST_CHORD * mesh.extent
    if chord_error is None:
        return max(CHORD_SHARE * float(mesh.topology.geometry[:, LENGTH].mean()), finest)
    if not is_number(chord_error) or not (math.isfinite(chord_error) and chord_error >= finest):
        raise InvalidArgument(
            f"chord_error is {chord_error!r}; it must be a finite number, {finest:g} or more"
        )
    return float(chord_error)


def crossed_faces(
    mesh: TriangleMesh, distances: Floats, max_distance: float, levels: Sequence[float]
) -> Flags:
    """Return the inner faces that some levels may pass, flags (F,), by the exact vertex distances.

    Within a face no distance differs from that of a corner by more than the way there. A vertex
    beyond ``max_distance`` is at least as far as that. O(F log n) for n levels.
    """
    topology = mesh.topology
    corners = distances[topology.links[:, TAIL]]
    ways = topology.geometry[:, [LENGTH, LENGTH_LEFT]].max(axis=1)
    least = (np.minimum(corners, max_distance) - ways).reshape(-1, 3).max(axis=1)
    most = (corners + ways).reshape(-1, 3).min(axis=1)
    ordered = np.sort(levels)
    below = np.searchsorted(ordered, least * (1.0 - PIECE), "left")  # rounding
    crossed: Flags = np.searchsorted(ordered, most * (1.0 + PIECE), "right") > below
    return crossed


def retained_sweep(windows: FaceWindows, distances: Floats, nodes: Nodes) -> RetainedSweep:
    """Return what distances in faces follow from: a sweep's windows, and its distances by node."""
    sites = nodes.sites
    site_rows = np.argsort(sites.ints[: nodes.first_target, FACE], kind="stable")
    piece_rows = np.argsort(sites.segment_ints[:, FACE], kind="stable")
    return RetainedSweep(
        face_windows=windows,
        distance=distances,
        site_ints=sites.ints[site_rows],
        site_weights=sites.weights[site_rows],
        segment_ints=sites.segment_ints[piece_rows],
        segment_ends=sites.segment_ends[piece_rows],
        first_segment=nodes.first_segment,
    )


class Drawing:
    """Lines of a finished sweep, drawn level by level."""

    def __init__(
        self,
        mesh: TriangleMesh,
        windows: FaceWindows,
        distances: Floats,
        nodes: Nodes,
        control: Control,
    ) -> None:
        """Look up between which distances each face lies: O(windows + F).

        ``distances`` are by node. Raises as `lines` does.
        """
        swept = retained_sweep(windows, distances, nodes)
        count = len(mesh.topology.links) // 3
        least, most = np.full(count, np.inf), np.full(count, np.inf)
        self._mesh, self._swept, self._least, self._most = mesh, swept, least, most
        self._nbytes = sum(array.nbytes for array in (*windows, least, most))
        control.check_memory(self._nbytes)

        def bound(first: int, last: int) -> int:
            bound_faces(mesh.topology, swept, first, last, least, most)
            return count

        in_slices(count, bound, control)
        for inside in (swept.site_ints, swept.segment_ints):
            np.minimum.at(least, inside[:, FACE], distances[inside[:, NODE]])

    def lines(self, level: float, chord_error: float, control: Control) -> list[SurfaceCurve]:
        """Return the lines of a level: O(F + n² log n) for n windows in each face that it passes.

        Raises
        ------
        Cancelled, DeadlineExceeded, MemoryLimitExceeded
            As the control says; what the lines are drawn from counts as memory of the call.
        """
        topology, distances = self._mesh.topology, self._swept.distance
        slack = LEVEL * level
        passed = np.flatnonzero((self._least <= level + slack) & (self._most >= level - slack))
        if len(passed) == 0:
            return []
        rank = np.full(len(self._least), -1, np.int32)
        control = control.holding(self._nbytes + rank.nbytes)
        cuts = self._cut(passed.astype(np.int32), level, rank, control.for_part(0, 2))
        crossings = cross_edges(topology, distances, cuts, level, rank)
        held = sum(array.nbytes for array in (*cuts, *crossings))
        control = control.holding(held).for_part(1, 2)
        parts: list[Arrays] = []

        def chain(first: int, last: int) -> int:
            weights, chains = chain_arcs(
                topology, distances, cuts, crossings, level, 0.5 * chord_error, first, last
            )
            parts.append((weights, *chains))
            control.check_memory(bytes_of(parts))
            return len(cuts.faces)

        in_slices(len(cuts.faces), chain, control)
        weights, sizes, nodes, faces = joined(parts)
        chains = Chains(weights, starts_of(sizes), nodes, faces)
        lines = link_crossing_chains(topology, crossings.half_edges, chains, PIECE * level)
        thin_lines(topology.geometry, lines, 0.5 * chord_error)
        return curves_of(self._mesh, lines)

    def _cut(self, passed: Ints, level: float, rank: Ints, control: Control) -> Cuts:
        """Cut the faces that a level may pass: by their bounds, then neighbours that cuts lead to.

        ``rank`` (F,) is -1 all over; the call sets it to the row of each face among those cut.
        """
        rank[passed] = np.arange(len(passed))
        faces = passed
        parts: list[Arrays] = []

        def cut(first: int, last: int) -> int:
            nonlocal faces
            spans, spans_of, arcs, arcs_of, more = cut_faces(
                self._mesh.topology, self._swept, faces[first:last], len(faces), level, rank
            )
            parts.append((spans, spans_of, arcs, arcs_of))
            faces = np.concatenate([faces, more])
            control.check_memory(faces.nbytes + bytes_of(parts))
            return len(faces)

        in_slices(len(faces), cut, control)
        spans, spans_of, arcs, arcs_of = joined(parts)
        return Cuts(faces, spans, starts_of(spans_of), arcs, starts_of(arcs_of))


Arrays = Sequence[NDArray[Any]]


def bytes_of(parts: Sequence[Arrays]) -> int:
    """Return the memory of all arrays of all parts."""
    return sum(array.nbytes for part in parts for array in part)


def joined(parts: Sequence[Arrays]) -> list[NDArray[Any]]:
    """Return the first arrays of all parts as one, then the second ones, and so on."""
    return [np.concatenate(arrays) for arrays in zip(*parts, strict=True)]


def starts_of(counts: NDArray[Any]) -> NDArray[Any]:
    """Return where each of some runs begins, and the last one ends, from their lengths (n,)."""
    starts = np.zeros(len(counts) + 1, counts.dtype)
    np.cumsum(counts, out=starts[1:])
    return starts
