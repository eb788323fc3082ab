"""The points of lines as locations on the surface, each once, whatever faces it was found in."""

from typing import Any

import numpy as np

from geodesic_core.arrays import Ints, Longs
from geodesic_core.kernels.curves.chains import Lines
from geodesic_core.kernels.jit import borrowed, kernel
from geodesic_core.kernels.mesh.locations import Locations, empty_locations, locate_in_face


@kernel
def locate_lines(embedding: Any, faces: Ints, lines: Lines) -> tuple[Locations, Ints, Longs]:
    """Return the points of lines, the inner face of each point's segment, and where lines begin.

    ``faces`` are the caller's. Points that are the same as the one before are left out, and with
    them lines that are nothing else.
    """
    embedding, size = borrowed(embedding), len(lines.faces)
    located = empty_locations(size)
    segment_faces, first = np.empty(size, np.int32), np.zeros(len(lines.first), np.int64)
    count = 0
    for line in range(len(lines.closed)):
        begin, end, closed = lines.first[line], lines.first[line + 1], lines.closed[line]
        start = count
        for i in range(begin, end):
            face = lines.faces[i]
            locate_in_face(embedding, faces, face, lines.leaving, i, located, count)
            if count > start and are_same(located, count, count - 1):
                segment_faces[count - 1] = face
            else:
                segment_faces[count] = face
                count += 1
        if closed and count > start + 1 and are_same(located, start, count - 1):
            count -= 1
        if count == start + 1:
            count = start
        first[line + 1] = count
    located = Locations(
        located.faces[:count], located.weights[:count], located.vertices[:count],
        located.points[:count],
    )  # fmt: skip
    return located, segment_faces[:count], first


@kernel
def are_same(located: Locations, i: int, j: int) -> bool:
    """Tell whether two rows of locations are the same point."""
    same = located.faces[i] == located.faces[j]
    for k in range(3):
        same = same and located.weights[i, k] == located.weights[j, k]
    return same
