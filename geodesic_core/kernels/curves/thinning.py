"""Lines with as few points in a face as a chord error allows.

Many windows meet in a face, so a line there consists of many short arcs, which hardly differ.
"""

from typing import Any

from geodesic_core.arrays import Floats
from geodesic_core.kernels.curves.face_points import copy_weights, step_between
from geodesic_core.kernels.jit import borrowed, kernel

MOST = 64
"""Points that one chord may stand for: each is looked at again for each point after it"""


@kernel
def thin_lines(geometry: Floats, lines: Any, error: float) -> None:
    """Drop the points of lines that lie within ``error`` of the chords that are left.

    Modifies ``lines`` (`Lines`), but for their ends. The ends of a line stay, and so do points
    between two faces. Of a closed line two more points stay, so that it remains one. O(n · MOST).
    """
    lines = borrowed(lines)
    faces, first = lines.faces, lines.first
    kept, end = 0, 0
    for line in range(len(lines.closed)):
        begin, end = end, first[line + 1]
        size, anchor = end - begin, begin
        for i in range(begin, end):
            stays = i == begin or i == end - 1 or faces[i] != faces[i - 1] or i - anchor >= MOST
            if lines.closed[line]:
                stays = stays or i == begin + size // 3 or i == begin + 2 * size // 3
            if stays or not are_near(geometry, lines, anchor, i + 1, error):
                copy_weights(lines.arriving, i, lines.arriving, kept)
                copy_weights(lines.leaving, i, lines.leaving, kept)
                faces[kept] = faces[i]
                kept, anchor = kept + 1, i
        first[line + 1] = kept


@kernel
def are_near(geometry: Floats, lines: Any, first: int, last: int, error: float) -> bool:
    """Tell whether the points between two of a line lie within ``error`` of their chord.

    All are in the face that the line enters at the first.
    """
    face = lines.faces[first]
    dx, dy = step_between(geometry, face, lines.leaving, first, lines.arriving, last)
    square = dx * dx + dy * dy
    for i in range(first + 1, last):
        px, py = step_between(geometry, face, lines.leaving, first, lines.arriving, i)
        share = min(max((px * dx + py * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
        px, py = px - share * dx, py - share * dy
        if px * px + py * py > error * error:
            return False
    return True
