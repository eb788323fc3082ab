"""Check some faces of a certificate once more, in arithmetic of any precision.

    python -m geodesic_core.verify_slowly MESH CERTIFICATE --source 0 --faces 20

`geodesic_core.verify` bounds tau of all faces with numpy, by doubles that know their rounding. Here
tau of a few faces is computed in balls of 200 bits (Arb, by python-flint), straight from its
definition: the largest f(q) - f(p) - |pq| over p and q on the rim of the face, and f(q) - c - |sq|
for a source s in it that starts at c. No arithmetic is shared, only the numbering of edges. What is
found may exceed the bound nowhere, and be below it by no more than the rounding of doubles.
"""

import sys
from itertools import permutations, product
from typing import Any, NamedTuple

import numpy as np

from geodesic_core.extras import extra
from geodesic_core.verify import (
    Array,
    Proof,
    Refused,
    Source,
    Surface,
    check,
    parser,
    refuse_unless,
)

with extra("proof", "python-flint", "verify_slowly"):
    from flint import arb, ctx

BITS = 200
"""Of the midpoints of balls; what is left of rounding is far below that of doubles"""
ROUNDING = 1e-9
"""Share of the largest distance by which bounds by doubles may exceed tau"""

Place = tuple[arb, arb]


class Cone(NamedTuple):
    """Distances base + |apex q| from an apex; between ``tail`` and ``head`` a way crosses an edge.

    Without them it goes anywhere.
    """

    apex: Place
    base: arb
    tail: Place | None = None
    head: Place | None = None


def squared(x: arb) -> arb:
    """Return x * x: Arb's own power is not defined on a ball around 0."""
    return x * x


def away(p: Place, q: Place) -> arb:
    """Return the distance of two places."""
    square = squared(p[0] - q[0]) + squared(p[1] - q[1])
    # A ball around 0 has no root: the places may be the same.
    return arb(0).union(square.abs_upper().sqrt()) if square.contains(0) else square.sqrt()


def between(p: Place, q: Place, t: arb) -> Place:
    """Return the place at a share of the way."""
    return p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])


def side(p: Place, q: Place, r: Place) -> arb:
    """Twice the signed area of a triangle."""
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def way(cone: Cone, q: Place) -> arb:
    """Return the length of the shortest way from an apex to q through the part of an edge."""
    if cone.tail is None or cone.head is None:
        return cone.base + away(cone.apex, q)
    left, right = (side(cone.apex, end, q) for end in (cone.tail, cone.head))
    if left >= 0 and right <= 0:
        return cone.base + away(cone.apex, q)
    bent = [away(cone.apex, end) + away(end, q) for end in (cone.tail, cone.head)]
    return cone.base + min(bent, key=arb.mid)


def larger(worst: arb, rise: arb) -> arb:
    """Return the larger one of two finite numbers."""
    refuse_unless(rise.is_finite(), "a face is too thin even for balls of this many bits")
    return rise if rise.mid() > worst.mid() else worst


class Function:
    """The function of a certificate on the rim of one face, laid out in the plane."""

    def __init__(self, surface: Surface, given: dict[str, Array], row: int) -> None:
        self.surface, self.given, self.row = surface, given, row
        self.corners = [int(v) for v in surface.faces[row]]
        out = [self.length(k) for k in range(3)]  # of edges 01, 12 and 20
        x = (squared(out[0]) + squared(out[2]) - squared(out[1])) / (2 * out[0])
        height = squared(out[2]) - squared(x)
        refuse_unless(height > 0, "a face has no area")
        zero = arb(0)
        self.places = [(zero, zero), (out[0], zero), (x, height.sqrt())]

    def length(self, k: int) -> arb:
        """Return the length of the edge from corner k to the next."""
        if self.surface.vertices is None:
            return arb(float(self.surface.long_length.m[self.surface.of_face[self.row, k]]))
        ends = (self.corners[k], self.corners[(k + 1) % 3])
        p, q = ([arb(float(c)) for c in self.surface.vertices[v]] for v in ends)
        return sum((squared(a - b) for a, b in zip(p, q, strict=True)), arb(0)).sqrt()

    def cones(self, k: int) -> list[Cone]:
        """Return the cones over an edge, whose apexes lie outside, and its ends as cones."""
        i, j = k, (k + 1) % 3
        values = [arb(float(self.given["values"][self.corners[c]])) for c in (i, j)]
        ends = [Cone(self.places[c], value) for c, value in zip((i, j), values, strict=True)]
        edge = int(self.surface.of_face[self.row, k])
        count = np.asarray(self.given["pieces"], np.int64)
        if count[edge] == 0:
            return ends
        if int(self.surface.edges[edge, 0]) != self.corners[i]:
            i, j = j, i
        low, high = self.places[i], self.places[j]
        length = away(low, high)
        third = self.places[3 - i - j]
        along = ((high[0] - low[0]) / length, (high[1] - low[1]) / length)
        turn = 1 if side(low, high, third) > 0 else -1  # the face is to the left, or to the right
        first, t = int(count[:edge].sum()), arb(0)
        for n in range(first, first + int(count[edge])):
            a, h, sigma = (arb(float(self.given[name][n])) for name in ("a", "h", "sigma"))
            apex = (
                low[0] + a * along[0] + turn * h * along[1],
                low[1] + a * along[1] - turn * h * along[0],
            )
            until = arb(float(self.given["t"][n]))
            part = [between(low, high, t), between(low, high, until)]
            ends.append(Cone(apex, sigma, *(part if turn < 0 else part[::-1])))
            t = until
        return ends


def tau(surface: Surface, given: dict[str, Array], row: int, sources: list[Source]) -> arb:
    """Return the largest rise of f beyond the distance between two points of the rim of a face.

    From a cone over one edge to one over another, f(q) is the one less the way from the other. On
    each part of the edge on which that way bends likewise the difference has its maximum at an end,
    or where both apexes are in line.
    """
    function = Function(surface, given, row)
    worst = arb(0)
    inside = [s for s in sources if s.vertex < 0 and s.face == surface.kept[row]]
    starts = [[_source(function, source) for source in inside]]
    rims = [function.cones(k) for k in range(3)]
    for k, ways in [
        *product(range(3), starts),
        *((g, rims[e]) for e, g in permutations(range(3), 2)),
    ]:
        for one, other in product(rims[k], ways):
            for q in _candidates(function, k, one, other):
                rise = one.base + away(one.apex, q) - way(other, q)
                worst = larger(worst, rise)
    for cones in rims:  # along one edge, where f rises no faster than distances but for jumps
        for one, other in product(cones, cones):
            for p, q in product(_ends(one), _ends(other)):
                rise = other.base + away(other.apex, q) - one.base - away(one.apex, p) - away(p, q)
                worst = larger(worst, rise)
    return worst


def _source(function: Function, source: Source) -> Cone:
    """Return a point of the face as a cone; its weights are for the corners as they are given."""
    weights = [arb(float(w)) for w in source.weights]
    total = sum(weights, arb(0))
    place = tuple(
        sum((w * p[axis] for w, p in zip(weights, function.places, strict=True)), arb(0)) / total
        for axis in (0, 1)
    )
    return Cone((place[0], place[1]), arb(float(source.start)))


def _ends(cone: Cone) -> list[Place]:
    return [cone.apex] if cone.tail is None or cone.head is None else [cone.tail, cone.head]


def _candidates(function: Function, k: int, one: Cone, other: Cone) -> list[Place]:
    """Return the points of edge k at which the rise of one cone over another may be most."""
    start, stop = _ends(one)[0], _ends(one)[-1]
    found = [start, stop]
    if one.tail is None:
        return found
    low, high = function.places[k], function.places[(k + 1) % 3]
    centres = [other.apex, *_ends(other)]
    lines = [(other.apex, end) for end in _ends(other) if other.tail is not None]
    # A way in line with an end of the part begins to bend there; apexes in line, mirrored or not.
    lines += [(one.apex, centre) for centre in centres]
    lines += [(_mirrored(one.apex, low, high), centre) for centre in centres]
    for p, q in lines:
        below, above = side(low, high, p), side(low, high, q)
        if (below - above).contains(0):
            continue
        place = between(p, q, below / (below - above))
        if all((away(place, end) <= away(start, stop)) is True for end in (start, stop)):
            found.append(place)
    return found


def _mirrored(p: Place, low: Place, high: Place) -> Place:
    """Return a place on the other side of a line."""
    square = squared(high[0] - low[0]) + squared(high[1] - low[1])
    t = ((p[0] - low[0]) * (high[0] - low[0]) + (p[1] - low[1]) * (high[1] - low[1])) / square
    foot = between(low, high, t)
    return 2 * foot[0] - p[0], 2 * foot[1] - p[1]


def disagreements(
    surface: Surface, given: dict[str, Array], sources: list[Source], proof: Proof, rows: Array
) -> list[tuple[int, Any, float]]:
    """Return the faces whose bound is below tau, or above it by more than rounding; with both."""
    largest = float(np.abs(given["values"][np.isfinite(given["values"])]).max())
    found = []
    for row in rows:
        face = int(surface.kept[row])
        bound, exact = float(proof.tau[face]), tau(surface, given, int(row), sources)
        if not (exact <= bound and bound - exact <= ROUNDING * largest):
            found.append((face, exact, bound))
    return found


def main() -> int:
    """Check some faces, chosen at random. Return 0, or 1 where a bound does not hold."""
    arguments = parser()
    arguments.add_argument("--faces", type=int, default=20, help="how many faces to check")
    arguments.add_argument("--seed", type=int, default=None, help="for the same faces once more")
    options = arguments.parse_args()
    try:
        surface, given, proof, _, _ = check(options)
        rng = np.random.default_rng(options.seed)
        rows = rng.permutation(len(surface.faces))[: options.faces]
        wrong = disagreements(surface, given, options.source, proof, rows)
    except Refused as error:
        print(f"refused: {error}", file=sys.stderr)
        return 1
    for face, exact, bound in wrong:
        print(f"face {face}: tau is {exact}, and the bound {bound:.17g}", file=sys.stderr)
    print(f"checked   {len(rows)} faces in balls of {BITS} bits, {len(wrong)} do not agree")
    return 1 if wrong else 0


ctx.prec = BITS

if __name__ == "__main__":
    sys.exit(main())
