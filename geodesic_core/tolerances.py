"""Every numeric bound of the library: its name, its unit and its reason.

Each is tested as a bound beside what it bounds; ``tests/core/test_tolerances.py`` finds the tests.
"""

SADDLE_EXCESS = 1e-11
"""Radians by which a vertex's total angle must exceed 2π for it to be a pseudosource.

A flatter saddle hides a sector of at most this angle behind it; paths into it are straight but for
this angle, which bounds their relative error. Less would take the rounding of flat vertices for
saddles, which costs time only.
"""

SECTOR_MARGIN = 1e-8
"""Radians by which a pseudosource's shadow sector is widened on both sides.

Closes the gap that rounding may leave between its windows and those that pass beside it (section
3.4). A wider sector is never wrong: every window stands for real paths.
"""

FLAT = 1e-14
"""Share of an edge's length by which a pseudosource lies off the edge, at least.

On the line itself it would send no rays into the face beyond. Directions are off by this much.
"""

SHARP = 1e-2
"""Radians of the total angle below which an inner vertex is a tip that windows wind about for long.

A window whose rays meet the tip goes around it until it has turned by π: π / SHARP times here. At
such a tip crossings of edges are recorded, which ends that after a turn or two.
"""

NO_AREA = 1e-8
"""Sine of an angle of a face up to which it counts as one of no area.

All ways around such faces are as long, so that windows could go in a circle where there is no tip,
between several of them. Ends of one whose angle is larger differ by more than rounding.
"""

OVERLAP = 1e-6
"""Share of an edge's length up to which two windows may overlap untrimmed.

Every window stands for real paths, so that untrimmed ones cost time, not accuracy; to tell such
neighbours apart costs more: a tenth of the sweep on scans, against 1e-10.
"""

LOOSE_OVERLAP = 1e-2
"""The same for two windows of different σ, whose bisector costs four square roots.

A fifth of the sweep on scans, for a tenth more windows. Beyond 1e-1 the windows cost more than the
roots did.
"""

DOUBLE_ROOT = 1e-4
"""Share of an interval within which the two roots of a bisector's quadratic count as one.

A root loses as many digits as its distance from the other has; at this distance it has twelve left.
"""

DIVERGING = 1e-12
"""Difference of the slopes of two rays up to which they count as parallel: rounding.

Between rays that diverge by less, no merged window leaves a shadow that a path could run into.
"""

FALSE_POSITION_STEPS = 100
"""Steps of false position after which the bisector is taken as it is; it needs less than ten."""

HALF_ULP = 2.0**-53
"""Relative rounding of one operation, at which false position ends; certificates count it."""

GAP = 1e-12
"""Share of an edge's length up to which a gap between two windows is rounding and is closed.

A ray through the closed gap is off its true course by at most this much, which bounds its error.
"""

SLACK = 1e-12
"""Relative slack of the vertex filter, in favour of the window.

Distances at vertices are rounded differently from those along windows; a window that ties with the
path through the vertex must live, for the vertex may have its distance from that very window.
"""

BEND = 1e-13
"""Relative surcharge on a path that bends at a window's end.

Such a path is no geodesic: it stands in where rounding left a gap between windows at a vertex. A
path of the same length that is straight, or bends at a pseudosource, must take precedence: only it
can be traced back.
"""

MISS = 1e-9
"""Share of an edge's length by which a window may miss a vertex by rounding.

A ray rounds by about 1e-14 of its length, which is 1e-10 of an edge 1e-4 as long. A larger bound
would do no harm, since paths past the window's end are real; it would only cost time.
"""

TIE = 1e-12
"""Relative difference up to which the distances to two sources count as equal.

Symmetric meshes make equal distances that rounding tells apart; the lower index wins them.
"""

ON_PATH = 1e-12
"""Detour, relative to the path's length, up to which a vertex beside a path counts as on it.

A line that meets a vertex may pass it on either side only where the vertex is flat; through the
vertex itself the path goes on by the vertex's own winner, at most this much longer.
"""

PATH_LENGTH = 1e-9
"""Relative difference between a traced path's length and the field's value that is a defect.

Measured: 1e-12 and less. A path that is not the one the field promises is never handed out.
"""

ROUNDED_POSITION = 1e-14
"""Share of the bounding box's diagonal by which such a length may differ anyway: rounding.

Points on edges and in faces are rounded as positions, however near they are to each other.
"""

LOCAL_SHARE = 0.05
"""Share of the error granted that a single merge of windows may use up (section 4.1).

What merges near the source use up is not there for merges far from it.
"""

GRAZING = 3e-4
"""Sine of the angle to the edge below which no merged pseudosource is put.

Rays that graze the edge multiply the rounding of its place: at 1e-4, distances on slivers of aspect
1e-5 came out 5e-8 above the exact ones.
"""

LOWER_BOUND = 1e-13
"""Relative amount by which a merged window may exceed what it replaces: rounding.

A field is a lower bound of the exact distance up to this much per merge.
"""

RUNS = 1000
"""How often a list may be propagated in a merging sweep before the sweep begins anew, exactly.

The paper's argument has no proof that merged windows cannot go in a circle (monotonicity, section
4.1). Windows that go in none wind about a tip all the same, exact ones as well: their lists come up
2π times the inverse of its angle, which is at least SHARP. Elsewhere on scans: 24 times at most.
"""

MOST_RUNS = 10_000
"""How often a list may be propagated in an exact sweep before the sweep ends in an `InternalError`.

No list of a sweep that ends comes up so often (`RUNS`); windows that go in a circle without end
would. They are not known on any mesh.
"""

MOST_CROSSINGS = 1000
"""Windows per half-edge that a fast sweep may cross before it ends in an `InternalError`.

Each must be the nearest so far at a place of its half-edge. Measured: 3 with eight places.
"""

WIDEST_ERROR = 2e-3
"""Relative error beyond which a sweep merges no more, whatever it is granted.

There is little left to merge, while the bounds that vertices give loosen: fewer windows can be
dropped than are merged. At 1e-2 a sweep keeps up to a third more windows than at 2e-3.
"""

SHARP_SADDLE = 0.03
"""Radians by which a vertex's total angle must exceed 2π for it to count as a sharp saddle.

Its shadow is so wide that it cuts many of the windows that pass.
"""

ROUGH = 0.14
"""Least share of sharp saddles among the vertices of a rough mesh.

Saddles cut windows short. Exact sweeps of a rough mesh have so few windows that merging costs more
than it saves: a merging sweep takes 0.86 to 1.0 of the exact time where the share is 0.10 to 0.12,
1.04 at 0.16, and 1.02 to 1.25 at 0.23 to 0.32.
"""

ROUGH_VERTICES = 5000
"""Fewest vertices of a rough mesh: on a smaller one any sweep takes a few milliseconds."""

STRAIGHT = 1e-5
"""Relative gain, or radians, below which a path along edges is not shortened any further.

It bounds a search that bounds the next: there, tighter bounds save less than they cost here.
"""

LANDMARK_ERROR = 1e-3
"""Relative error of the distances from landmarks.

Exact ones would cost up to ten times as much, and bound by a thousandth better.
"""

SINGLE_PRECISION = 1e-6
"""Relative error of a number that was rounded to single precision: 6e-8, with room to spare.

Distances from landmarks are stored so.
"""

SEARCH_SLACK = 1e-10
"""Relative amount by which a search between two points looks beyond its upper bound.

The path itself must not be pruned by rounding.
"""

AT_LIMIT = 1e-12
"""Relative distance from ``max_distance`` at which a search asks a field whether a path is within.

Their sums are rounded differently; so all questions have one answer.
"""

SAME_PLACE = 1e-9
"""Relative difference up to which a vertex counts as where a path unfolds its pseudosource to.

Up to it, too, a straight piece counts as no longer than the distance. Asked only where several
faces may be behind an edge, of which the others lead elsewhere.
"""

WEIGHT = 2.0**-41
"""Barycentric weight up to which a point counts as lying on the opposite edge: rounding.

Half a step of `EDGE_STEPS`, so that a point near a vertex has one spelling there, too.
"""

WEIGHT_ERROR = 1e-9
"""How far barycentric weights may be below zero, or their sum from one: written with ten digits."""

ROUNDED_SUM = 2.0**-50
"""By how much the sum of three barycentric weights may differ from one: a few roundings.

Weights that are divided by such a sum would change each time that a point is made canonical.
"""

EDGE_STEPS = 2.0**40
"""Into how many steps an edge is divided, to tell the points on it apart.

One spelling of a point differs from another by rounding: by 1e-16 of the edge as a share of it, by
1e-16 of the mesh as a position. A step is 1e-12 of an edge.
"""

MERGE = 2.0**-30
"""Share of an edge, or of a barycentric weight, within which points of a cut are one.

A curve that passes a vertex, an edge, a point of another curve or their crossing within this much
runs through it, so that no face of the cut mesh is thinner than the rounding of its corners. It
moves by 1e-9 of an edge.
"""

ALONG_EDGE = 1e-11
"""Barycentric weight by which an edge of a polygon may be outside of a face and count as on it.

That is rounding: on maps of 1e5 pixels a side, places have weights that are off by 1e-12. Well
below `MERGE`, within which a cut makes one of what both faces of an edge have found there.
"""

SNAP = 1e-12
"""Share of the bounding box's diagonal within which a position counts as on a vertex or an edge."""

ROUNDED_COORDINATE = 2.0**-50
"""Share of the largest coordinate within which it counts as such as well: a few roundings.

The positions of a georeferenced mesh round by more than `SNAP`: at 5e6 from the origin, by 1e-9.
"""

SAME_HEIGHT = 1e-9
"""Share of its extent up to which two heights of a surface above one place are one: rounding.

Faces that meet at the place are both found there.
"""

NEARLY_JOINED = 1e-3
"""Share of its height up to which a border vertex counts as nearly joined to another border.

The height of a vertex is its distance from the opposite edges of its faces, of which the least
counts. Every way over the surface to another vertex, or to an edge of which it is no end, is as
long: what is told as nearly joined is a thousand times as far over the surface as it is away.
Single precision leaves seams 1e-4 wide on a mesh of a million faces; sheets that are thin for their
faces are 1e-2 apart. An edge's height is half of those of its ends in its face; next to its ends,
this share of its length, it is not asked for vertices on it.
"""

FAN = 1e-9
"""Share of a polygon's area that each triangle of a fan must have for the fan to be taken.

Less is a sliver or rounding, where three corners lie on one line: another way to cut the polygon is
looked for. The surface of a flat polygon is the same either way.
"""

SLANT = 1e-9
"""Sine of the angle to an edge from which on the rays of a segment of a curve are sent across it.

Of rays that are flatter, those that meet the edge leave the segment within so small a share of the
edge from its end that the rays of that end are as near: the square of this share is no number.
"""

LEVEL = 1e-12
"""Relative difference within which two ways to a point of an isoline count as equally long.

Circles and lines that should be one, or touch, or run along an edge, differ by rounding; of them
one is taken, and what is at the level counts as within.
"""

CROSSING = 1e-11
"""Share of an edge's length within which two places where an isoline crosses it count as one."""

PIECE = 1e-9
"""Share of a level below which a piece of its isoline is left out: rounding, at ends of arcs."""

CUT_OFF = 3e-12
"""Share of ``max_distance`` that isolines and borders stay below it: rounding.

At its very limit a sweep is cut off by rounding. Three times `LEVEL`, so that a line with its
tolerance is still within the limit.
"""

PARALLEL = 1e-6
"""Sine of an angle below which the rays of two windows count as parallel.

Where such rays meet is not sure enough. So a cheap test, whether one of the windows is nearer
everywhere, is given up; this costs time only.
"""

FINEST_CHORD = 1e-9
"""Share of the bounding box's diagonal that a chord error must have at least.

The number of points of a line grows with the inverse of the error's root.
"""

LARGEST_COORDINATE = 1e50
"""Mesh units up to which a coordinate may be: sixth powers of lengths do not overflow."""

SHORTEST_EDGE = 1e-50
"""Mesh units that an edge must have at least: sixth powers of lengths do not vanish.

Edges of no length at all are contracted before.
"""

TRIES = 512
"""Edges over which a straight line of a path is tried, per point of the longest path.

Sheets upon each other, around a sharp tip, can be gone through in more ways than time allows.
Beyond the limit the line is lost, which is an internal error. Measured: 2.7 at most, but 340 in a
soup of needles that share a tip.
"""

THROUGH_VERTEX = 1e-13
"""Sine of an angle, or share of an edge, by which a straight line may miss a vertex that it meets.

A line drawn to a vertex comes as near as rounding lets it. One that misses by more passes the
vertex on a side, and behind a saddle or a tip goes on in another direction than one that meets it.
"""

NO_DIRECTION = 1e-12
"""Share of a vector's length up to which its projection to a tangent plane has no direction.

What is left of a vector along the normal is rounding.
"""

ROUNDED_LENGTH = 1e-9
"""Share by which given lengths of one edge may differ, or break the triangle inequality.

Averaged or rescaled lengths come from single precision or from sums. All faces then take the length
that the lowest of them has.
"""

STRAIGHT_THROUGH = 1e-6
"""Radians from half a turn at a vertex up to which a path is straight there on one side.

A path that passes a vertex by less than its length rounds may be led through it, with a bend of
some 1e-8.
"""

ROUNDED_TURN = 1e-9
"""Share of a full turn by which the angles around a flat vertex may exceed it by rounding."""

FORKS = 64
"""Irregular edges on one straight line at which other faces are still to be tried, at most.

Beyond them only the first face is tried. Measured: 9 at most.
"""

BEHIND = 1.5
"""Reach of a segment's band from its front, as a multiple of the segment's distance from there.

It ends beyond the segment, so that rounding leaves no gap, and before the front of the other side.
"""

ASTAR_WEIGHT = 1.15
"""Weight of the lower bound in the search along edges: its path may be longer by this factor.

Shortening makes up for that, but for turns around the other side of an obstacle. Against 1 it takes
a third to a half off the step's time; 1.3 gains little more and loses it in the next step.
"""

PASSES = 400
"""How often a strip is led past its bends before its path is taken as it is.

Each pass shortens the path, so that what is left is an upper bound in any case.
"""

TAUT = 1e-8
"""Radians by which a straightened curve may be bent where it could be straight.

A curve that is bent so little is longer than a straight one by the square of this, less than
rounding.
"""

STALLS = 16
"""Passes over a strip in a row that may gain nothing before its string is taken as it is.

What a pass gains may be less than rounding, and let the next one gain more.
"""

SHORTER = 1e-14
"""Share of its length that a loop is to gain by a round: less is rounding, and ends it."""

MOST_PASSES = 10_000
"""Passes over a strip, beside one for each face, after which straightening is an `InternalError`.

In a pass, a strip moves on by a vertex at each bend. Measured: 560 where a curve moves across half
of a sphere of 20,000 faces.
"""

FAR_NEARER = 1.01
"""How many times nearer a window is, at its middle, that goes on in a fast sweep without a place.

With 1.01 the mean error of one place a half-edge falls by a tenth, the largest errors on slivers by
far more, and time grows by 2 %.
"""

MOST_AT_LARGE = 4
"""Windows without a place that a half-edge passes on in a fast sweep: they may split without end.
"""

LAST_BUCKET = 1e18
"""Number of the bucket that all windows share whose distances are beyond it: integers end at 9e18.
"""

SMALLEST_MOVE = 1e-9
"""Share of the surface's extent: points that would move by less have reached their place.

What moves by the mean of distances cannot be placed better than these are squared and summed.
"""

NARROW = 1e-6
"""Share of its edge: a stretch that is shorter may be a gap between windows, by rounding.

In a certificate the windows on both sides then meet, if the function jumps less that way. The error
of that counts among the violations. Seen: gaps of 1e-9.
"""

CERTIFIED = 1e-8
"""Share of the largest distance by which bounds may miss distances that count as proved.

Bounds of exact fields miss them by 1e-12 to 1e-9, most of which is rounding in the proof.
"""

SLOPE_SAMPLING = 1e-6
"""Share of a cost by slope by which lines between its samples may be off.

A thousandth of what the graph of a cost sweep is off by. Tobler's rule takes a thousand samples.
"""

CONVEX = 2e-6
"""Share by which a cost by slope may exceed that of mixtures of other slopes: sampling.

Where it exceeds them by more, paths would zig-zag at as small a scale as they may.
"""
