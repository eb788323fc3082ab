"""Content negotiation: from what a client accepts to one media type and one coding."""

from collections.abc import Sequence
from functools import lru_cache

from app.encoding.codings import CODINGS
from app.encoding.representation import FORMATS


def negotiate(
    accept: str | None, name: str | None, offers: Sequence[str] = tuple(FORMATS.values())
) -> str | None:
    """Return the media type for ``Accept``, or for ``name`` of ``FORMATS``, which overrides it.

    Returns None where none of the ``offers`` is acceptable.
    """
    if name is not None:
        return FORMATS[name] if FORMATS[name] in offers else None
    wanted = sorted(_accepted(accept or "*/*"), key=lambda item: -item[1])
    refused = {media for media, quality in wanted if quality <= 0}
    for media, quality in wanted:
        for offered in offers:
            if quality > 0 and offered not in refused and _matches(media, offered):
                return offered
    return None


def negotiate_coding(accept_encoding: str | None) -> str | None:
    """Return the content coding for ``Accept-Encoding``: the fastest of those liked best."""
    wanted = {coding: coding_quality(accept_encoding, coding) for coding in CODINGS}
    best = max(wanted, key=lambda coding: wanted[coding])
    plain = dict(_accepted(accept_encoding or "")).get("identity", 0.0)
    return best if wanted[best] > 0 and wanted[best] >= plain else None


def coding_quality(accept_encoding: str | None, coding: str) -> float:
    """Return how much ``Accept-Encoding`` likes a coding, from 0, not at all, to 1."""
    qualities = dict(_accepted(accept_encoding or ""))
    return qualities.get(coding, qualities.get("*", 0.0))


@lru_cache  # a client sends the same headers with each request
def _accepted(header: str) -> tuple[tuple[str, float], ...]:
    ranges = []
    for item in header.split(","):
        media, *parameters = (part.strip().lower() for part in item.split(";"))
        quality = next((text[2:] for text in parameters if text.startswith("q=")), "1")
        try:
            ranges.append((media, float(quality)))
        except ValueError:
            ranges.append((media, 1.0))
    return tuple(ranges)


def _matches(media: str, offered: str) -> bool:
    kind, _, subtype = media.partition("/")
    offered_kind, _, offered_subtype = offered.partition("/")
    return kind in ("*", offered_kind) and subtype in ("*", offered_subtype)
