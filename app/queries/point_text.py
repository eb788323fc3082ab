"""Points as a line of text, for a ``GET`` and for the command line.

::

    12 or v12         a vertex
    e12-13:0.3        on the edge between two vertices, at this share of the way
    f7:0.2,0.3,0.5    in a face, by the weights of its corners
    p1,2,3            the point nearest to a position
"""

import re

from app.schemas.points import EdgePoint, FacePoint, Point, PositionPoint, VertexPoint

_INDEX, _NUMBER = r"(-?[0-9]{1,18})", r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
_THREE = ",".join([_NUMBER] * 3)
_VERTEX = re.compile(f"v?{_INDEX}")
_EDGE = re.compile(f"e{_INDEX}-{_INDEX}:{_NUMBER}")
_FACE = re.compile(f"f{_INDEX}:{_THREE}")
_POSITION = re.compile(f"p{_THREE}")


def parse(text: str) -> Point:
    """Return the point that a text stands for.

    Raises
    ------
    ValueError
        It stands for none, or one of its numbers is too large.
    """
    if found := _VERTEX.fullmatch(text):
        return VertexPoint(vertex=int(found[1]))
    if found := _EDGE.fullmatch(text):
        return EdgePoint(edge=(int(found[1]), int(found[2])), t=_number(found[3]))
    if found := _FACE.fullmatch(text):
        u, v, w = map(_number, found.groups()[1:])
        return FacePoint(face=int(found[1]), barycentric=(u, v, w))
    if found := _POSITION.fullmatch(text):
        x, y, z = map(_number, found.groups())
        return PositionPoint(position=(x, y, z))
    shown = text if len(text) <= _SHOWN else text[:_SHOWN] + "…"
    raise ValueError(
        f"{shown!r} is not a point: write a vertex as 12 or v12, a point of an edge as e12-13:0.3, "
        f"of a face as f7:0.2,0.3,0.5, and a position as p1,2,3"
    )


_SHOWN = 60  # characters of a wrong text in its message


def _number(text: str) -> float:
    number = float(text)
    if number in (float("inf"), float("-inf")):
        raise ValueError(f"{text} is too large")
    return number
