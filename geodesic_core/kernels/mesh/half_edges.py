r"""Half-edges: their columns, their frames, and the steps from one to another.

Half-edge ``h = 3 f + i`` runs along face f from its corner i, the *tail*, to the next corner, the
*head*; the third vertex is its *apex*. Its frame has the tail at the origin, the head on the
positive x axis and the face on y > 0::

                  apex
                  /  \
       length_left    length_right
                /      \
          tail +--------+ head
                 length

The two half-edges of an edge between two faces are opposite each other. An edge of three faces or
more is *irregular*, and so is one that both its faces run the same way. It has no opposites. Its
half-edges form a cycle instead, in which a bit tells whether the next one runs the same way. Faces
are turned over by `build`, so that only a one-sided surface has an irregular edge of two faces.

Faces of no area are *pinched*, and so are those around a tip as sharp as a needle's. Their edges
have opposites, but are crossed as irregular ones. Around them windows would wind almost without
end, if their crossings were not recorded (`irregular_edges`).

Vertices and faces have inner numbers, see `build`. `Topology` holds the way back; a corner keeps
its place in its face.
"""

from typing import NamedTuple

from geodesic_core.arrays import Flags, Floats, Ints
from geodesic_core.kernels.jit import kernel

# Columns of Topology.geometry, a row per half-edge: the triangle as seen from the half-edge
LENGTH = 0  # |tail head|, mesh units
COS_LEFT = 1  # of the angle at the tail
SIN_LEFT = 2
LENGTH_LEFT = 3  # |tail apex|
COS_RIGHT = 4  # of the angle at the head
SIN_RIGHT = 5
LENGTH_RIGHT = 6  # |head apex|
APEX_ANGLE = 7  # direction of the side toward the tail in the apex's unfolded fan, radians

# Columns of Topology.links, a row per half-edge
OUT_LEFT = 0  # the half-edge across (tail, apex), in the neighbour; or NO_FACE, or IRREGULAR
OUT_RIGHT = 1  # the same across (apex, head)
APEX = 2
TAIL = 3
HEAD = 4
OPPOSITE = 5  # the same across this edge; a pinched face has its opposites here
AROUND = 6  # of an irregular edge: the next half-edge h around it, 2 h + 1 if it runs the same way
SPARE = 7  # fills the row, half a cache line

NO_FACE = -1  # across a boundary edge
IRREGULAR = -2  # across an edge of several neighbours, of one that disagrees, or of a pinched face

ROW = 8  # columns of both arrays: a row of geometry is a cache line of 64 bytes

# Vertex flags
BOUNDARY = 1
SADDLE = 2  # the total angle exceeds 2π
FANS = 4  # several fans of faces meet: the link is neither one circle nor one path
SEAM = 8  # the vertex is an end of an edge of three faces or more, or of two that disagree
PINCHED = 16  # the vertex is a corner of a pinched face


class Topology(NamedTuple):
    """Connectivity and lengths of a surface, in inner numbering; read-only once built.

    All that sweeps and backtracing need: they know nothing of space. Both are one, as links depend
    on lengths: an edge of no length joins its ends, and a pinched face is crossed in another way.
    """

    geometry: Floats
    """(3F, 8): LENGTH … APEX_ANGLE"""
    links: Ints
    """(3F, 8): OUT_LEFT … SPARE"""
    first_corner: Ints
    """(V + 1,): start of each vertex's run in `corners`; it ends where the next one starts"""
    corners: Ints
    """(3F,): the half-edges that leave a vertex, counter-clockwise, fan after fan"""
    corner_angles: Floats
    """(3F,): direction of each of `corners` in the unfolded fan of its vertex, radians"""
    total_angle: Floats
    """(V,): sum of the angles at the vertex, radians"""
    flags: Flags
    """(V,): BOUNDARY | SADDLE | FANS | SEAM | PINCHED"""
    component: Ints
    """(V,): connected component, by the *caller's* vertex; isolated vertices have one each"""
    inner_vertex: Ints
    """(V,): the caller's vertex → inner vertex; the same for all that edges of no length join"""
    outer_vertex: Ints
    """(V,): inner vertex → the caller's, the lowest of several; the inner vertices of the others
    are in no face"""
    outer_face: Ints
    """(F,): inner face → the caller's"""


class Embedding(NamedTuple):
    """A surface in space, for what places points there."""

    topology: Topology
    positions: Floats
    """(V, 3): the inner vertices, mesh units from the mesh's origin"""


@kernel
def previous(h: int) -> int:
    """Half-edge before h in its face."""
    return h + 2 if h % 3 == 0 else h - 1


@kernel
def following(h: int) -> int:
    """Half-edge after h in its face."""
    return h - 2 if h % 3 == 2 else h + 1


@kernel
def point_in_frame(geometry: Floats, h: int, weights: Floats) -> tuple[float, float]:
    """Position in the frame of h of the point of its face with these barycentric weights."""
    along, up = weights[(h + 1) % 3], weights[(h + 2) % 3]
    reach = up * geometry[h, LENGTH_LEFT]
    x = along * geometry[h, LENGTH] + reach * geometry[h, COS_LEFT]
    return x, reach * geometry[h, SIN_LEFT]


@kernel
def weights_in_frame(geometry: Floats, weights: Floats, first: int, h: int) -> tuple[float, float]:
    """Position as `point_in_frame` has it, by raw pointers; the weights begin at ``first``."""
    row, i = ROW * h, h % 3
    along, up = weights[first + (i + 1) % 3], weights[first + (i + 2) % 3]
    reach = up * geometry[row + LENGTH_LEFT]
    x = along * geometry[row + LENGTH] + reach * geometry[row + COS_LEFT]
    return x, reach * geometry[row + SIN_LEFT]


@kernel
def half_edge_in_face(geometry: Floats, h: int) -> tuple[float, float, float, float]:
    """Tail and direction of h in the frame of its face's first half-edge."""
    first = h - h % 3
    if h == first:
        return 0.0, 0.0, 1.0, 0.0
    if h == first + 1:
        x = geometry[first, LENGTH]
        return x, 0.0, -geometry[first, COS_RIGHT], geometry[first, SIN_RIGHT]
    cosine, sine = geometry[first, COS_LEFT], geometry[first, SIN_LEFT]
    reach = geometry[first, LENGTH_LEFT]
    return reach * cosine, reach * sine, -cosine, -sine


@kernel
def next_around(links: Ints, h: int) -> int:
    """Half-edge of the same edge in the next of its faces; negative if there is none."""
    if links[h, OPPOSITE] == IRREGULAR:
        return links[h, AROUND] >> 1
    return links[h, OPPOSITE]


@kernel
def faces_beyond(links: Ints, g: int) -> int:
    """Return how many other faces the irregular edge of g has, by a raw pointer."""
    count, h = 0, links[ROW * g + AROUND] >> 1
    while h != g:
        count += 1
        h = links[ROW * h + AROUND] >> 1
    return count
