"""From an answer to bytes: one module for each format, and a registry of them.

An `Answer` is a JSON object whose members may be arrays. Beside it stand its views, which other
formats are written from: a `Table`, lines (`Line`), places (`Place`), a `Surface`. What encoders
return is a sequence of parts, made while it is written: no answer is in memory as a whole twice.
"""

from app.encoding.answer import Answer, Encoded
from app.encoding.form import (
    CSV,
    FORMATS,
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
from app.encoding.negotiation import negotiate, negotiate_coding
from app.encoding.registry import encode
from app.encoding.views import Indices, Line, Place, Surface, Table

__all__ = [
    "CSV",
    "FORMATS",
    "GEOJSON",
    "JSON",
    "NPY",
    "NPZ",
    "OBJ",
    "OCTETS",
    "PLY",
    "SVG",
    "Answer",
    "Encoded",
    "Indices",
    "Line",
    "Place",
    "Representation",
    "Surface",
    "Table",
    "encode",
    "negotiate",
    "negotiate_coding",
]
