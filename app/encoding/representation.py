"""Representations of an answer: media type, width of numbers, content coding."""

from collections.abc import Mapping
from dataclasses import dataclass

JSON = "application/json"
NPY = "application/x-npy"
NPZ = "application/x-npz"
OCTETS = "application/octet-stream"
OBJ = "model/obj"
PLY = "model/ply"
CSV = "text/csv"

FORMATS: Mapping[str, str] = {
    "json": JSON,
    "npy": NPY,
    "npz": NPZ,
    "octets": OCTETS,
    "obj": OBJ,
    "ply": PLY,
    "csv": CSV,
}
ARRAYS = frozenset({NPY, NPZ, OCTETS})
"""The media types whose numbers have a chosen width."""
TEXTS = frozenset({JSON, OBJ, CSV})
"""The media types that are worth compressing: the bytes of float64 are nearly random."""


@dataclass(frozen=True)
class Representation:
    """One way to write an answer; each representation of an answer is a result of its own."""

    media_type: str
    dtype: str = "float64"
    coding: str | None = None
    """The content coding of HTTP: ``gzip``, ``zstd`` or none."""
