"""OBJ: polylines, for modelling programs."""

from collections.abc import Iterator, Sequence

from app.encoding.answer import Answer, Buffer, Encoded
from app.encoding.headers import headers_of
from app.encoding.views import Line, embedded


def to_obj(answer: Answer) -> Encoded:
    """Encode the lines as ``l`` elements, single points as ``p``."""
    assert answer.lines is not None, "an answer in OBJ has lines"  # noqa: S101
    lines = answer.lines()
    for line in lines:
        embedded(line.points)
    return _written(lines), headers_of(answer, answer.shown)


def _written(lines: Sequence[Line]) -> Iterator[Buffer]:
    first, group = 1, ""
    for line in lines:
        if line.group != group:
            group = line.group
            yield b"g %b\n" % group.encode()
        count = len(line.points)
        if not count:
            known = (item for item in line.properties.items() if item[1] is not None)
            properties = " ".join(f"{name}={value}" for name, value in known)
            yield b"# no line: %b\n" % properties.encode()
            continue
        yield ("v %r %r %r\n" * count % tuple(line.points.ravel().tolist())).encode()
        indices = [*range(first, first + count), *([first] if line.is_closed else ())]
        element = "l " if count > 1 else "p "
        yield (element + " ".join(map(str, indices)) + "\n").encode()
        first += count
