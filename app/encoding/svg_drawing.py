"""SVG: lines seen from above, along z."""

from collections.abc import Iterator, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from app.encoding.answer import Answer, Buffer, Encoded
from app.encoding.colours import hex_colour
from app.encoding.headers import headers_of
from app.encoding.json_document import dumped
from app.encoding.views import Line

_MARGIN = 0.02
"""Margin around the drawing, as a share of its longer side."""
_STROKE = 0.003
"""Width of lines, likewise: some viewers know no width in pixels."""
_HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="%r %r %r %r" fill="none" '
    'stroke-width="%r" stroke-linejoin="round" stroke-linecap="round">\n'
    "<desc>Seen along z; mesh units</desc>\n"
)


def to_svg(answer: Answer) -> Encoded:
    """Encode the lines, x to the right and y up, in a picture that they fill."""
    assert answer.lines is not None, "an answer in SVG has lines"  # noqa: S101
    return Encoded(_written(answer.lines()), headers_of(answer, answer.shown))


def _written(lines: Sequence[Line]) -> Iterator[Buffer]:
    box = _view_box(lines)
    yield (_HEAD % (*box, _STROKE * max(box[2:]))).encode()
    for line in lines:
        if len(line.points):
            yield _element(line).encode()
    yield b"</svg>\n"


def _view_box(lines: Sequence[Line]) -> tuple[float, ...]:
    """Return left, top, width and height of the picture; y grows downwards."""
    ends = [end for p in lines if len(p.points) for end in (p.points.min(0), p.points.max(0))]
    if not ends:
        return 0.0, 0.0, 1.0, 1.0
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    margin = _MARGIN * float((high - low)[:2].max()) or 1.0
    left, top = low[0] - margin, -high[1] - margin
    width, height = (high - low)[:2] + 2 * margin
    return float(left), float(top), float(width), float(height)


def _element(line: Line) -> str:
    flat = line.points[:, :2] * (1.0, -1.0) + 0.0  # no -0.0
    points = ("%r,%r " * len(flat) % tuple(flat.ravel().tolist()))[:-1]
    if len(flat) == 1:
        points = f"{points} {points}"  # a dot, by its round caps
    data = "".join(
        f" data-{name}={quoteattr(value if isinstance(value, str) else dumped(value).decode())}"
        for name, value in line.properties.items()
        if value is not None
    )
    return (
        f'<{"polygon" if line.is_closed else "polyline"} stroke="{hex_colour(line.shade)}"{data} '
        f'points="{points}"/>\n'
    )
