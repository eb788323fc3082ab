"""Barriers of a call: faces that act as holes for it alone."""

from collections.abc import Iterable, Sequence

import numpy as np

from geodesic_core.control import Control
from geodesic_core.mesh.surface_point import UNPLACED, SurfacePoint
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.validation import as_barriers


def with_barriers(
    mesh: TriangleMesh, barriers: Iterable[int], control: Control
) -> tuple[TriangleMesh, Control]:
    """Return the mesh with its barriers, and the control of a call that holds what that takes.

    Raises
    ------
    InvalidArgument
        They are not ids of faces, or leave no face free.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    faces = as_barriers(barriers, len(mesh.faces))
    if len(faces) == 0:
        return mesh, control
    control = control.holding(sum(a.nbytes for a in (*mesh.topology, mesh.positions)))
    control.check_memory(0)
    control.checkpoint(0.0)
    return mesh.with_barriers(faces), control


def walled_in(mesh: TriangleMesh, points: Sequence[SurfacePoint]) -> list[int]:
    """Return which points are vertices all of whose faces are blocked: no path leads there.

    Parameters
    ----------
    mesh
        The surface, with its barriers; see `TriangleMesh.with_barriers`.
    points
        Of this mesh, as `TriangleMesh.point` returns them.

    Returns
    -------
    list of int
        Indices into the points, in order.

    Notes
    -----
    O(points), and O(barriers) where there is such a vertex.

    Examples
    --------
    >>> mesh = gc.samples.plane(2).with_barriers([0])  # the unit square, in two triangles
    >>> gc.walled_in(mesh, [mesh.point(vertex) for vertex in range(4)])
    [1]
    """
    alone = [i for i, point in enumerate(points) if point.face_index == UNPLACED]
    if not alone:
        return []
    inner = mesh.topology.inner_vertex
    nodes = inner[np.array([points[i].vertex_index for i in alone], np.int64)]
    is_blocked = np.isin(nodes, inner[mesh.faces[mesh.barriers]])
    return [i for i, blocked in zip(alone, is_blocked.tolist(), strict=True) if blocked]
