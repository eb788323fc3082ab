"""Parts of a body, neither tiny nor the whole."""

from collections.abc import Iterable, Iterator

from app.encoding.answer import Buffer

_LEAST = 2**16


def joined(parts: Iterable[Buffer], least: int = _LEAST) -> Iterator[Buffer]:
    """Yield the same bytes in fewer parts: small ones joined to such of ``least`` bytes."""
    held: list[Buffer] = []
    size = 0
    for part in parts:
        if size >= least or len(part) >= least:  # a large one goes by itself: it is not copied
            yield b"".join(held)
            held, size = [], 0
        if len(part) >= least:
            yield part
        else:
            held.append(part)
            size += len(part)
    yield b"".join(held)
