"""Lines with as few points in a face as a chord error allows.

Many windows meet in a face, so a line there consists of many short arcs, which hardly differ.
"""

from geodesic_core.arrays import Flags, Floats, Ints, Longs
from geodesic_core.kernels.jit import borrowed, kernel

MOST = 64
"""Points that one chord may stand for: each is looked at again for each point after it"""


@kernel
def thin_lines(points: Floats, faces: Ints, first: Longs, closed: Flags, error: float) -> None:
    """Drop the points of lines that lie within ``error`` of the chords that are left.

    Modifies ``points`` (n, 3), ``faces`` (n,), which follow them, and ``first``, the rows at which
    the lines begin and the last one ends. The ends of a line stay, and so do points between two
    faces. Of a closed line two more points stay, so that it remains one. O(n · MOST).
    """
    points, faces = borrowed(points), borrowed(faces)
    kept, end = 0, 0
    for line in range(len(closed)):
        begin, end = end, first[line + 1]
        size, anchor = end - begin, begin
        for i in range(begin, end):
            stays = i == begin or i == end - 1 or faces[i] != faces[i - 1] or i - anchor >= MOST
            if closed[line]:
                stays = stays or i == begin + size // 3 or i == begin + 2 * size // 3
            if stays or not are_near(points, anchor, i + 1, error):
                for axis in range(3):
                    points[kept, axis] = points[i, axis]
                faces[kept] = faces[i]
                kept, anchor = kept + 1, i
        first[line + 1] = kept


@kernel
def are_near(points: Floats, first: int, last: int, error: float) -> bool:
    """Tell whether the points between two of a line lie within ``error`` of their chord."""
    x, y, z = points[first, 0], points[first, 1], points[first, 2]
    dx, dy, dz = points[last, 0] - x, points[last, 1] - y, points[last, 2] - z
    square = dx * dx + dy * dy + dz * dz
    for i in range(first + 1, last):
        px, py, pz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        along = px * dx + py * dy + pz * dz
        share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
        px, py, pz = px - share * dx, py - share * dy, pz - share * dz
        if px * px + py * py + pz * pz > error * error:
            return False
    return True
