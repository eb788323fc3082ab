"""Members of an answer that a format has no room for, as headers of the response."""

import json
from collections.abc import Collection, Sized
from typing import Any

import orjson

from app.encoding.answer import Answer
from app.encoding.json_document import dumped

_LONGEST = 4096
"""Longest value of a header: servers and proxies refuse longer lines. JSON has all members."""


def headers_of(answer: Answer, left_out: Collection[str]) -> dict[str, str]:
    """Return the members of an answer, except some, as headers ``Geodesic-…``.

    ``Geodesic-Omitted`` names those that are too long.
    """
    headers, omitted = {}, []
    for name, value in answer.members.items():
        if name in left_out:
            continue
        text = value if isinstance(value, str) else _ascii(value)
        if text is not None and len(text) <= _LONGEST:
            headers["Geodesic-" + name.replace("_", "-").title()] = text
        else:
            omitted.append(name)
    return headers | ({"Geodesic-Omitted": ",".join(omitted)} if omitted else {})


def _ascii(value: Any) -> str | None:
    """Return a value as JSON in ASCII; None where that is too long for a header."""
    if isinstance(value, Sized) and 2 * len(value) > _LONGEST:
        return None  # each element has a character and a comma
    text = dumped(value)  # shorter, and faster than json
    if len(text) > _LONGEST:
        return None
    return json.dumps(orjson.loads(text), separators=(",", ":"))  # headers are Latin-1
