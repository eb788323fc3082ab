"""Where sweeps start: points and curves, as they were written, and as the library has them."""

from collections.abc import Sequence
from itertools import chain, islice, pairwise

import geodesic_core as gc
from app.errors import Fault
from app.queries.base import numbered
from app.queries.places import Places
from app.queries.validation import FAULTS_SHOWN, Named, refuse_points
from app.schemas.points import Origin, Polyline, Source
from geodesic_core.mesh.curve import share_a_face

_JUMPS = (
    "shares no face with the point before it; add those at which the curve crosses edges: a "
    "shortest path has them"
)


def named_origin(where: str, written: Origin | Source) -> Named:
    """Yield a point, or those of a curve, each with its place."""
    if isinstance(written, Polyline):
        return numbered(f"{where}/polyline", written.polyline)
    return iter([(where, written)])


def named_sources(written: Sequence[Source]) -> Named:
    """Yield the points of sources, each with its place."""
    return chain.from_iterable(
        named_origin(f"/sources/{i}", source) for i, source in enumerate(written)
    )


def point_count(*written: Origin | Source) -> int:
    """Return how many points there are, those of curves counted one by one."""
    return sum(len(each.polyline) if isinstance(each, Polyline) else 1 for each in written)


def origin_of(
    mesh: gc.TriangleMesh, where: str, written: Origin | Source, places: Places
) -> gc.SurfacePoint | gc.Curve:
    """Return a point, or a curve, as the library has it; refuse a curve that jumps."""
    if not isinstance(written, Polyline):
        return places[0]
    faults = (
        Fault(f"{where}/polyline/{i}", _JUMPS)
        for i, (start, end) in enumerate(pairwise(places), 1)
        if not share_a_face(mesh, start, end)
    )
    shown = tuple(islice(faults, FAULTS_SHOWN))
    if shown:
        raise refuse_points(shown)
    return gc.Curve(tuple(places))


def starts_of(mesh: gc.TriangleMesh, written: Sequence[Source], places: Places) -> list[gc.Source]:
    """Return sources as the library has them; refuse curves that jump."""
    rest = iter(places)
    return [
        gc.Source(
            origin_of(mesh, f"/sources/{i}", source, tuple(islice(rest, point_count(source)))),
            source.start_distance,
        )
        for i, source in enumerate(written)
    ]
