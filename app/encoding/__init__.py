"""Encoders from answers to bytes: one module for each format, and a registry.

An `Answer` is a JSON object whose members may be arrays. It also has views for other formats: a
`Table`, lines (`Line`), a `Surface`. Encoders return an iterator of parts,
so that no answer is in memory as a whole twice.
"""

from app.encoding.answer import Answer
from app.encoding.arrays import array_headers, npy_parts, too_large_for
from app.encoding.negotiation import coding_quality, negotiate, negotiate_coding
from app.encoding.registry import encode
from app.encoding.representation import (
    CSV,
    FORMATS,
    JSON,
    NPY,
    NPZ,
    OBJ,
    OCTETS,
    PLY,
    Representation,
)
from app.encoding.views import Elements, Indices, Line, Surface, Table

__all__ = [
    "CSV",
    "FORMATS",
    "JSON",
    "NPY",
    "NPZ",
    "OBJ",
    "OCTETS",
    "PLY",
    "Answer",
    "Elements",
    "Indices",
    "Line",
    "Representation",
    "Surface",
    "Table",
    "array_headers",
    "coding_quality",
    "encode",
    "negotiate",
    "negotiate_coding",
    "npy_parts",
    "too_large_for",
]
