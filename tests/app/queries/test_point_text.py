"""Points as a line of text."""

import pytest

from app.queries.point_text import parse
from app.schemas.points import EdgePoint, FacePoint, PositionPoint, VertexPoint


@pytest.mark.parametrize(
    ("text", "point"),
    [
        ("v0", VertexPoint(vertex=0)),
        ("0", VertexPoint(vertex=0)),
        ("-7", VertexPoint(vertex=-7)),
        ("v-7", VertexPoint(vertex=-7)),
        ("e12-13:0.3", EdgePoint(edge=(12, 13), t=0.3)),
        ("e12--13:1", EdgePoint(edge=(12, -13), t=1.0)),
        ("f7:0.2,0.3,0.5", FacePoint(face=7, barycentric=(0.2, 0.3, 0.5))),
        ("f7:1.,-5e-17,.0", FacePoint(face=7, barycentric=(1.0, -5e-17, 0.0))),
        ("p1,2,3", PositionPoint(position=(1.0, 2.0, 3.0))),
        ("p-1e3,+2E+1,-.5", PositionPoint(position=(-1000.0, 20.0, -0.5))),
    ],
)
def test_points(text: str, point: object) -> None:
    assert parse(text) == point


@pytest.mark.parametrize(
    "text",
    [
        *("", "0.0", "٧", "v", "v1.0", "v 1", " v1", "v1\n", "V1", "v1,2", "v" + "9" * 19, "v١"),
        *("e1-2", "e1-2:", "e1:0.3", "e1-2-3:0.3", "e1,2:0.3", "e1-2:nan", "e1-2:0.3,0.7"),
        *("f7", "f7:1,0", "f7:1,0,0,0", "f7:a,b,c", "f7:1,0,inf", "f7:1,,0", "f1.5:1,0,0"),
        *("p1,2", "p1,2,3,4", "p1;2;3", "p1, 2, 3", "p1,2,nan", "p1,2,0x10", "p1,2,1_0"),
        *("p1,2,3:0.5", "x1,2,3", "p" + "1," * 1000),
    ],
)
def test_what_is_no_point(text: str) -> None:
    with pytest.raises(ValueError, match="write a vertex as 12 or v12") as caught:
        parse(text)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("text", ["p1e999,0,0", "f7:1,0,-1e400", "e1-2:1e309"])
def test_numbers_that_are_too_large(text: str) -> None:
    with pytest.raises(ValueError, match="is too large"):
        parse(text)
