"""Curves pulled tight: each becomes a strip of faces, and the strip leads to the straight curve.

A loop is pulled tight from a base, as an open curve from there to itself. Then one of its bends
becomes the base, until that gains nothing: it is straight wherever it can be. A loop without bends
is a straight line in its unrolled strip. Once around, the strip is turned about a centre: beside
that centre, the loop passes the vertex that is farthest from it.
"""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from geodesic_core.arrays import Floats, Ints, Longs
from geodesic_core.control import Control, rounds
from geodesic_core.errors import InternalError, InvalidArgument, NoLoop
from geodesic_core.fields.free_ends import has_free_end, slid, string_of
from geodesic_core.kernels.mesh.half_edges import HEAD, OPPOSITE, TAIL
from geodesic_core.kernels.paths import funnel
from geodesic_core.kernels.paths.funnel import LEFT, NEITHER, RIGHT, String, Strip
from geodesic_core.mesh.surface_curve import SurfaceCurve, curve_through
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.tolerances import MOST_PASSES, SHORTER, STALLS, TAUT

_BYTES_OF_SEGMENT = 128
"""Memory that each face takes which a curve crosses: its segment, its portal, where it unfolds."""

_SLICE_CROSSINGS = 2**18
"""Crossings of edges that are passed between two checkpoints, some 50 ms."""


class Line(NamedTuple):
    """The segments of a curve, from a point to the next."""

    faces: Longs
    """(N,) inner faces"""
    starts: Floats
    """(N, 3) weights in them"""
    ends: Floats

    @classmethod
    def of(cls, curve: SurfaceCurve) -> "Line":
        """Return those of a curve."""
        _, starts, ends = curve._segments()
        return cls(curve._inner_faces, starts, ends)

    def part(self, first: int, end: int) -> "Line":
        """Return some of the segments."""
        return Line(self.faces[first:end], self.starts[first:end], self.ends[first:end])

    def turned(self, first: int) -> "Line":
        """Return the segments of a closed curve that begins with another one."""
        return joined([self.part(first, len(self.faces)), self.part(0, first)])

    def strips(self, mesh: TriangleMesh) -> list[Strip]:
        """Return strips along the line: more than one where it passes from one sheet to another."""
        strips, first = [], 0
        while first < len(self.faces):
            strip, first = funnel.strip_along(mesh.topology, *self, first)
            strips.append(strip)
        return strips

    def first_break(self, mesh: TriangleMesh) -> int | None:
        """Return the first segment of a closed curve that no strip joins to those before."""
        again = joined([self, self.part(0, 1)])
        first = funnel.strip_along(mesh.topology, *again, 0)[1]
        return None if first == len(again.faces) else first % len(self.faces)


def joined(lines: Sequence[Line]) -> Line:
    """Return lines, each from the end of the one before, as one."""
    return Line(
        np.concatenate([line.faces for line in lines]),
        np.concatenate([line.starts for line in lines]),
        np.concatenate([line.ends for line in lines]),
    )


def straightened_curve(
    curve: SurfaceCurve, control: Control, *, free_ends: bool = False
) -> SurfaceCurve:
    """Return a curve pulled tight; if ``free_ends``, those on the boundary slide along it.

    Raises
    ------
    InvalidArgument
        The curve has no mesh, or was resampled; or no end is free.
    NoLoop
        It is closed, or its ends are free, and it shrinks to a point.
    Cancelled, DeadlineExceeded, MemoryLimitExceeded
        As the control says.
    """
    if free_ends and curve.closed:
        raise InvalidArgument("no end of the curve is free: it is closed")
    if len(curve.faces):
        mesh, line = curve.on_mesh(), Line.of(curve)
        return straightened_line(mesh, line, control, closed=curve.closed, free_ends=free_ends)
    if curve.closed:
        raise _shrunk()
    return curve


def straightened_line(
    mesh: TriangleMesh, line: Line, control: Control, *, closed: bool, free_ends: bool
) -> SurfaceCurve:
    """Return the curve of a line pulled tight, see `straightened_curve`."""
    control.check_memory(_BYTES_OF_SEGMENT * len(line.faces))
    pieces = np.inf
    for part in rounds(control):
        part.checkpoint(0.0)
        first = line.first_break(mesh) if closed else 0
        if first is None:
            return straight_loop(mesh, line.strips(mesh)[0], part)
        strips = line.turned(first).strips(mesh)
        is_free = _free_ends_of(mesh, strips) if free_ends else (False, False)
        if len(strips) >= pieces:
            break
        # Where a piece between two sheets has shrunk to nothing, those beside it may be one
        pieces = len(strips)
        pulled = [
            _freed(
                mesh,
                strip,
                (is_free[0] and i == 0, is_free[1] and i == pieces - 1),
                part.for_part(i, pieces),
            )
            for i, strip in enumerate(strips)
        ]
        curve = curve_in(mesh, pulled, closed=closed)
        if pieces == 1 or len(curve.faces) == 0:
            break
        line = Line.of(curve)
    if closed and len(curve.faces) == 0:
        raise _shrunk()
    return curve


def _free_ends_of(mesh: TriangleMesh, strips: Sequence[Strip]) -> tuple[bool, bool]:
    """Return which ends of strips are on the boundary: one at least."""
    is_free = has_free_end(mesh, strips[0], 0), has_free_end(mesh, strips[-1], 1)
    if not any(is_free):
        raise InvalidArgument("no end of the curve is free: none is on the boundary of the surface")
    return is_free


def _freed(
    mesh: TriangleMesh, strip: Strip, is_free: tuple[bool, bool], control: Control
) -> tuple[Strip, String]:
    """Return a strip whose string is straight, and shortest among those of its free ends.

    Each round but the last makes it shorter, by more than SHORTER of its length.
    """
    if not any(is_free):
        return _straightened(mesh, strip, control)
    longest, best = 0.0, None
    for part in islice(rounds(control), MOST_PASSES):
        strip, string = _straightened(mesh, strip, part.for_part(0, 2))
        longest = max(longest, string.length)
        if string.length <= SHORTER * longest:
            raise _shrunk()
        if best is not None and string.length >= best[1].length * (1.0 - SHORTER):
            return best
        best = strip, string
        strip = slid(mesh, strip, is_free, part.for_part(1, 2))
    raise _endless()


def loop_of(mesh: TriangleMesh, portals: Ints, control: Control) -> SurfaceCurve:
    """Return the straight loop through a cycle of faces, which are entered over portals."""
    return straight_loop(mesh, _based(mesh, portals, 0, LEFT), control)


def straight_loop(mesh: TriangleMesh, strip: Strip, control: Control) -> SurfaceCurve:
    """Return the loop pulled tight in whose strip both ends are one point.

    Each round but the last makes it shorter, by more than SHORTER of its length.
    """
    length, best = np.inf, None
    for part in islice(rounds(control), MOST_PASSES):
        strip, string = _straightened(mesh, strip, part)
        if len(strip.portals) == 0:
            raise _shrunk()
        if best is not None and string.length >= length * (1.0 - SHORTER):
            return curve_in(mesh, [best], closed=True)
        length, best = string.length, (strip, string)
        base = _at_bend(mesh, strip, string) if len(string.bends) else _beside(mesh, strip, string)
        if base is None:
            return curve_in(mesh, [best], closed=True)
        strip = base
    raise _endless()


def _straightened(mesh: TriangleMesh, strip: Strip, control: Control) -> tuple[Strip, String]:
    """Return a strip whose string is straight, and the string; asks before each slice of passes."""
    most, parts = MOST_PASSES + len(mesh.faces), rounds(control)
    while most > 0:
        next(parts).checkpoint(0.0)
        # A slice is longer than passes may be that gain nothing
        passes = STALLS + 2 + _SLICE_CROSSINGS // max(len(strip.portals), 1)
        strip, string, is_done = funnel.straightened(mesh.topology, strip, TAUT, 0.0, passes)
        if is_done:
            return strip, string
        most -= passes
    raise _endless()


def _shrunk() -> NoLoop:
    return NoLoop("the curve shrinks to a point: none of its kind is shortest")


def _endless() -> InternalError:
    return InternalError("a curve is not straight after many passes; please report this mesh")


def _at_bend(mesh: TriangleMesh, strip: Strip, string: String) -> Strip:
    """Return the strip of a loop whose base is the bend in the middle."""
    middle = len(string.bends) // 2
    _, junction = next(_junctions(mesh, strip))
    portals = np.concatenate([strip.portals, junction])
    return _based(mesh, portals, int(string.bends[middle]), int(string.sides[middle]))


def _beside(mesh: TriangleMesh, strip: Strip, string: String) -> Strip | None:
    """Return the strip of a loop without bends whose base is a vertex that it passes when shorter.

    None where it is straight at its base as well. The loop leads from the origin to x. Around it,
    the strip is turned by some angle about a centre, which takes the origin to x; the loop turns at
    its base by as much. It is shorter nearer to the centre, as far as vertices let it.
    """
    x, y = string.ends[-1, :2].tolist()
    for side, junction in _junctions(mesh, strip):
        portals = np.concatenate([strip.portals, junction])
        ends = _unrolled(mesh, strip, portals)
        (ax, ay), (bx, by) = (ends[i, 2:] - ends[i, :2] for i in (0, len(portals)))
        turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
        if abs(turn) <= TAUT or side == (LEFT if turn > 0.0 else RIGHT):
            continue
        centre = 0.5 * np.array([x, y]) + np.array([-y, x]) / (2.0 * np.tan(0.5 * turn))
        inner = ends[: len(portals), :2] if turn > 0.0 else ends[: len(portals), 2:]
        farthest = int((inner * (inner - 2.0 * centre)).sum(axis=1).argmax())
        return _based(mesh, portals, farthest, LEFT if turn > 0.0 else RIGHT)
    return None


def _unrolled(mesh: TriangleMesh, strip: Strip, portals: Ints) -> Floats:
    """Return the ends of the portals of a cycle, the first of which comes again at its end."""
    again = np.append(portals, portals[:1])
    faces = np.array([strip.faces[0], again[-1] // 3])
    weights = np.stack([strip.weights[0], np.full(3, 1.0 / 3.0)])
    return string_of(mesh, Strip(again, faces, weights)).ends


def _junctions(mesh: TriangleMesh, strip: Strip) -> Iterator[tuple[int, Ints]]:
    """Yield the ways from the end of a loop's strip to its beginning.

    They are the portals, and the side on which the base is: NEITHER where it is no vertex.
    """
    topology, (first, last), (start, end) = mesh.topology, strip.faces, strip.weights
    corners = np.flatnonzero(end == 1.0)
    if first == last or len(corners) == 0:
        line = Line(strip.faces[::-1].copy(), np.stack([end, start]), np.stack([end, start]))
        yield NEITHER, line.strips(mesh)[0].portals
        return
    corner = int(corners[0])
    v = topology.links[3 * last + corner, TAIL]
    room = int(topology.first_corner[v + 1] - topology.first_corner[v])
    for side in (LEFT, RIGHT):
        portals = np.empty(room, np.int32)
        row = funnel.around_vertex(topology.links, int(last), corner, int(first), side, portals, 0)
        if row >= 0:
            yield side, portals[:row]


def _based(mesh: TriangleMesh, portals: Ints, i: int, side: int) -> Strip:
    """Return the strip of a loop through a cycle of portals, whose base is an end of one."""
    links, portals = mesh.topology.links, np.roll(portals, -i)
    v = links[portals[0], TAIL if side == LEFT else HEAD]
    face = int(links[portals[0], OPPOSITE]) // 3
    weights = (links[3 * face : 3 * face + 3, TAIL] == v).astype(np.float64)
    return Strip(portals, np.array([face, face]), np.stack([weights, weights]))


def curve_in(
    mesh: TriangleMesh, strips: Sequence[tuple[Strip, String]], *, closed: bool
) -> SurfaceCurve:
    """Return the curve of strings, each of which begins where the one before ends."""
    parts = [funnel.points_of(strip, string) for strip, string in strips]
    faces, weights = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    return curve_through(mesh, faces, weights, faces[:-1], closed=closed)


def portals_along(*curves: SurfaceCurve, closed: bool) -> Ints:
    """Return the portals along curves, each of which begins where the one before ends.

    If they are closed, also those around the point where they meet again.
    """
    lines = [Line.of(each) for each in curves]
    line = joined([*lines, lines[0].part(0, 1)] if closed else lines)
    return line.strips(curves[0].on_mesh())[0].portals
