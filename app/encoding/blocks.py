"""Blocks of a body: small parts joined."""

from collections.abc import Iterable, Iterator

from app.encoding.answer import Buffer

_LEAST = 2**16


def joined(parts: Iterable[Buffer], least: int = _LEAST) -> Iterator[Buffer]:
    """Yield the same bytes in fewer parts: small ones are joined to parts of ``least`` bytes."""
    pending: list[Buffer] = []
    size = 0
    for part in parts:
        if size >= least or len(part) >= least:  # a large part is not copied
            yield b"".join(pending)
            pending, size = [], 0
        if len(part) >= least:
            yield part
        else:
            pending.append(part)
            size += len(part)
    yield b"".join(pending)
