"""The encoder of each media type."""

from collections.abc import Callable, Mapping
from functools import partial

from app.encoding.answer import Answer, Encoded
from app.encoding.arrays import to_npy, to_npz, to_octets
from app.encoding.blocks import joined
from app.encoding.codings import compressed
from app.encoding.csv_table import to_csv
from app.encoding.json_document import to_json
from app.encoding.obj_lines import to_obj
from app.encoding.ply_mesh import to_ply
from app.encoding.representation import (
    ARRAYS,
    CSV,
    JSON,
    NPY,
    NPZ,
    OBJ,
    OCTETS,
    PLY,
    Representation,
)

_ENCODERS: Mapping[str, Callable[..., Encoded]] = {
    JSON: to_json,
    NPY: to_npy,
    NPZ: to_npz,
    OCTETS: to_octets,
    OBJ: to_obj,
    PLY: to_ply,
    CSV: to_csv,
}


def encode(answer: Answer, representation: Representation) -> Encoded:
    """Encode ``answer`` in a representation that it has; the parts are made as they are read."""
    encoder = _ENCODERS[representation.media_type]
    if representation.media_type in ARRAYS:
        encoder = partial(encoder, dtype=representation.dtype)
    parts, headers = encoder(answer)
    encoded = joined(parts), headers
    return encoded if representation.coding is None else compressed(encoded, representation.coding)
