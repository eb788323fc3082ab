"""Errors as values: copies of them say the same."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import pytest

from geodesic_core import errors

EACH = [
    errors.InvalidMesh("an edge is too short", kind="edge", elements=[(3, 4)]),
    errors.TooManyFaces(7, 6),
    errors.TooManyVertices(7, 6),
    errors.UnknownFileType("unknown mesh file type"),
    errors.FileTooLarge(100),
    errors.InvalidPoint("the point is vertex 9"),
    errors.InvalidArgument("k is 0"),
    errors.NoHeight("the surface is not there"),
    errors.NoTangentPlane("vertex 0 has no tangent plane", 3),
    errors.NoDirection("direction 2 is zero", 2),
    errors.NoLoop("every loop shrinks"),
    errors.OtherSurface("there are 80 values", 80, 42),
    errors.NoSuchLabel("the roi has no vertex"),
    errors.InvalidPolygon("polygon 2 crosses itself", 2),
    errors.UnsuitableCrs("the CRS is not known"),
    errors.NotEmbedded("locate needs positions"),
    errors.NoPath("no path", "disconnected"),
    errors.Cancelled("cancelled with 0% done"),
    errors.DeadlineExceeded("not finished"),
    errors.MemoryLimitExceeded(100, 10),
    errors.MissingExtra("mesh.locate", "libigl", "locate"),
    errors.InternalError("a defect"),
]


def pickled(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))  # noqa: S301 - our own


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickled])
@pytest.mark.parametrize("error", EACH, ids=lambda error: type(error).__name__)
def test_copies_say_the_same(
    error: errors.GeodesicError, copied: Callable[[Any], errors.GeodesicError]
) -> None:
    error.add_note("in the third of many meshes")
    other = copied(error)
    assert type(other) is type(error)
    assert str(other) == str(error)
    assert other.__dict__ == error.__dict__
    assert other.__notes__ == error.__notes__


def test_each_kind_is_tried() -> None:
    kinds = {kind for kind in vars(errors).values() if isinstance(kind, type)}
    found = {k for k in kinds if issubclass(k, errors.GeodesicError)}
    assert found == {type(error) for error in EACH} | {errors.GeodesicError}
