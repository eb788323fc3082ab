"""The sources of a sweep: where they are, and what answers say of them."""

from collections.abc import Mapping, Sequence
from typing import Any

import geodesic_core as gc
from app import schemas
from app.points import described
from app.queries.places import Places


def starts_of(written: Sequence[schemas.Source], places: Places) -> list[gc.Source]:
    """Return sources as the library has them."""
    return [
        gc.Source(place, source.start_distance)
        for source, place in zip(written, places, strict=True)
    ]


def described_sources(
    mesh: gc.TriangleMesh, written: Sequence[schemas.Source], places: Places
) -> list[Mapping[str, Any]]:
    """Return what answers say of resolved sources."""
    return [
        {**described(mesh, place), "start_distance": source.start_distance}
        for source, place in zip(written, places, strict=True)
    ]
