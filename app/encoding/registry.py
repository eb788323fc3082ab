"""Which encoder writes which media type."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from app.encoding.answer import Answer, Encoded
from app.encoding.arrays import to_npy, to_npz, to_octets
from app.encoding.blocks import joined
from app.encoding.codings import compressed
from app.encoding.csv_table import to_csv
from app.encoding.form import (
    ARRAYS,
    CSV,
    GEOJSON,
    JSON,
    NPY,
    NPZ,
    OBJ,
    OCTETS,
    PLY,
    SVG,
    Representation,
)
from app.encoding.geojson import to_geojson
from app.encoding.json_document import to_json
from app.encoding.obj_lines import to_obj
from app.encoding.ply_mesh import to_ply
from app.encoding.svg_drawing import to_svg

_ENCODERS: Mapping[str, Callable[..., Encoded]] = {
    JSON: to_json,
    NPY: to_npy,
    NPZ: to_npz,
    OCTETS: to_octets,
    OBJ: to_obj,
    PLY: to_ply,
    CSV: to_csv,
    SVG: to_svg,
    GEOJSON: to_geojson,
}


def encode(answer: Answer, form: Representation) -> Encoded:
    """Encode ``answer`` in a form that it comes in; its parts are made when they are asked for."""
    encoder = _ENCODERS[form.media_type]
    if form.media_type in ARRAYS:
        encoder = partial(encoder, dtype=form.dtype)
    encoded = encoder(answer)
    encoded = replace(encoded, parts=joined(encoded.parts))
    return encoded if form.coding is None else compressed(encoded, form.coding)
