"""From an answer to bytes, by media type."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray
from scipy.sparse import coo_array, save_npz

JSON = "application/json"
NPY = "application/x-npy"
NPZ = "application/x-npz"
OCTETS = "application/octet-stream"
FORMATS: Mapping[str, str] = {"json": JSON, "npy": NPY, "npz": NPZ, "octets": OCTETS}

# Servers and proxies refuse longer header lines; what does not fit is in the JSON answer.
_LONGEST_HEADER = 4096


@dataclass(frozen=True)
class Answer:
    """An answer on its way out: members of all sizes, among them the arrays asked for.

    Attributes
    ----------
    members
        In the order of the JSON object; arrays where they are large.
    arrays
        Names of the members that are the body in binary formats (empty where that is ``None``); the
        small ones become headers. The distances of a sparse matrix come with their rows and
        columns. No names for an answer that comes as JSON only.
    values
        How many values its JSON has, where the query did not tell before it was answered.
    """

    members: Mapping[str, Any]
    arrays: tuple[str, ...] = ()
    values: int = 0


@dataclass(frozen=True)
class Encoded:
    """What is sent: the parts of the body, one after the other, and headers of its own."""

    parts: Sequence[bytes | memoryview]
    headers: Mapping[str, str] = field(default_factory=dict)


def to_json(answer: Answer) -> Encoded:
    """Encode all members; what is not finite becomes ``null``."""
    return Encoded([_dump(answer.members)])


def to_npy(answer: Answer) -> Encoded:
    """Encode the array in numpy's own format, the rest as headers."""
    array = _little_endian(answer)
    header = BytesIO()
    np.lib.format.write_array_header_1_0(header, np.lib.format.header_data_from_array_1_0(array))
    return Encoded([header.getvalue(), _raw(array)], _array_headers(array) | _headers(answer))


def to_npz(answer: Answer) -> Encoded:
    """Encode a sparse matrix as `scipy.sparse.load_npz` reads it, the rest as headers."""
    distances, rows, columns = (answer.members[name] for name in answer.arrays)
    table = coo_array((distances, (rows, columns)), shape=answer.members["shape"]).tocsr()
    file = BytesIO()
    save_npz(file, table, compressed=False)
    headers = {"Geodesic-Dtype": "<f8", "Geodesic-Shape": ",".join(map(str, table.shape))}
    return Encoded([file.getbuffer()], headers | _headers(answer))


def to_octets(answer: Answer) -> Encoded:
    """Encode the bare array, little-endian and in C order, the rest as headers."""
    array = _little_endian(answer)
    return Encoded([_raw(array)], _array_headers(array) | _headers(answer))


ENCODERS: Mapping[str, Callable[[Answer], Encoded]] = {
    JSON: to_json,
    NPY: to_npy,
    NPZ: to_npz,
    OCTETS: to_octets,
}


def encode(answer: Answer, media_type: str) -> Encoded:
    """Encode ``answer`` as ``media_type``, one of ``ENCODERS``."""
    return ENCODERS[media_type](answer)


def negotiate(
    accept: str | None, name: str | None, offers: Sequence[str] = tuple(FORMATS.values())
) -> str | None:
    """Return the media type for ``Accept``, or for ``name`` of ``FORMATS``, which overrides it.

    None where it is not one of the ``offers``.
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


def _accepted(header: str) -> list[tuple[str, float]]:
    ranges = []
    for item in header.split(","):
        media, *parameters = (part.strip().lower() for part in item.split(";"))
        quality = next((text[2:] for text in parameters if text.startswith("q=")), "1")
        try:
            ranges.append((media, float(quality)))
        except ValueError:
            ranges.append((media, 1.0))
    return ranges


def _matches(media: str, offered: str) -> bool:
    kind, _, subtype = media.partition("/")
    offered_kind, _, offered_subtype = offered.partition("/")
    return kind in ("*", offered_kind) and subtype in ("*", offered_subtype)


def _little_endian(answer: Answer) -> NDArray[Any]:
    array: NDArray[Any] | None = answer.members[answer.arrays[0]]
    if array is None:  # no path: the headers say why
        return np.empty(0)
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))


def _raw(array: NDArray[Any]) -> memoryview | bytes:
    return array.data.cast("B") if array.size else b""


def _dump(value: Any) -> bytes:
    # orjson reads contiguous arrays of the machine's own numbers by itself; others go as lists.
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY, default=np.ndarray.tolist)


def _array_headers(array: NDArray[Any]) -> dict[str, str]:
    return {"Geodesic-Dtype": array.dtype.str, "Geodesic-Shape": ",".join(map(str, array.shape))}


def _headers(answer: Answer) -> dict[str, str]:
    headers = {}
    for name, value in answer.members.items():
        if name in (*answer.arrays, "shape"):
            continue
        text = value if isinstance(value, str) else _ascii(value)
        if text is not None and len(text) <= _LONGEST_HEADER:
            headers["Geodesic-" + name.replace("_", "-").title()] = text
    return headers


def _ascii(value: Any) -> str | None:
    """Return JSON as headers have it, None where it is too long: json is slow, and adds escapes."""
    dumped = _dump(value)
    if len(dumped) > _LONGEST_HEADER:
        return None
    return json.dumps(orjson.loads(dumped), separators=(",", ":"))  # headers are Latin-1
