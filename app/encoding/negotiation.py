"""Content negotiation: from what a client accepts to one media type and one coding."""

from collections.abc import Sequence
from functools import lru_cache

from app.encoding.codings import CODINGS
from app.encoding.representation import FORMATS
from app.errors import problem

MOST_RANGES = 50
"""Types or codings that a header may accept; browsers send ten. Thousands take a tenth of a second
of the event loop."""


def negotiate(
    accept: str | None, name: str | None, offers: Sequence[str] = tuple(FORMATS.values())
) -> str | None:
    """Return the media type for ``Accept``, or for ``name`` of ``FORMATS``, which overrides it.

    Returns None where none of the ``offers`` is acceptable. Raises ``ProblemError`` where a header
    accepts more than `MOST_RANGES`.
    """
    if name is not None:
        return FORMATS[name] if FORMATS[name] in offers else None
    return _best(accept or "*/*", tuple(offers))


@lru_cache  # a client sends the same headers with each request
def _best(accept: str, offers: tuple[str, ...]) -> str | None:
    """Return the offer of the highest quality; of several, one of the first range that has any."""
    ranges = _accepted(accept)
    qualities = {offer: _quality(offer, ranges) for offer in offers}
    best = max(qualities.values())
    liked = [offer for offer in offers if qualities[offer] == best > 0]
    return next((each for media, _ in ranges for each in liked if _matches(media, each)), None)


def _quality(offer: str, ranges: Sequence[tuple[str, float]]) -> float:
    """Return the quality of the most specific range that an offer matches; 0 without one."""
    matching = [(-media.count("*"), quality) for media, quality in ranges if _matches(media, offer)]
    return max(matching, default=(0, 0.0))[1]


@lru_cache
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


def _accepted(header: str) -> tuple[tuple[str, float], ...]:
    count = header.count(",") + 1
    if count > MOST_RANGES:
        detail = f"a header accepts {count} types or codings; at most {MOST_RANGES} are allowed"
        raise problem("header_too_large", detail, limit=MOST_RANGES, actual=count)
    ranges = []
    for item in header.split(","):
        media, *parameters = (part.strip().lower() for part in item.split(";"))
        quality = next((text[2:] for text in parameters if text.startswith("q=")), "1")
        ranges.append((media, _number(quality)))
    return tuple(ranges)


def _number(quality: str) -> float:
    """Return a quality as a number; one that is not valid counts as none."""
    try:
        number = float(quality)
    except ValueError:
        return 1.0
    return number if 0.0 <= number <= 1.0 else 1.0


def _matches(media: str, offered: str) -> bool:
    kind, _, subtype = media.partition("/")
    offered_kind, _, offered_subtype = offered.partition("/")
    return kind in ("*", offered_kind) and subtype in ("*", offered_subtype)
