"""In which form an answer is written: its media type, the width of its numbers, its coding."""

from collections.abc import Mapping
from dataclasses import dataclass

JSON = "application/json"
NPY = "application/x-npy"
NPZ = "application/x-npz"
OCTETS = "application/octet-stream"
OBJ = "model/obj"
PLY = "model/ply"
CSV = "text/csv"
SVG = "image/svg+xml"
GEOJSON = "application/geo+json"

FORMATS: Mapping[str, str] = {
    "json": JSON,
    "npy": NPY,
    "npz": NPZ,
    "octets": OCTETS,
    "obj": OBJ,
    "ply": PLY,
    "csv": CSV,
    "svg": SVG,
    "geojson": GEOJSON,
}
ARRAYS = frozenset({NPY, NPZ, OCTETS})
"""Which have numbers of a chosen width."""
TEXTS = frozenset({JSON, OBJ, CSV, SVG, GEOJSON})
"""Which are worth compressing: the bytes of float64 are nearly random."""


@dataclass(frozen=True)
class Representation:
    """What is to be made of an answer; two forms of one answer are two results."""

    media_type: str
    dtype: str = "float64"
    coding: str | None = None
    """The content coding of HTTP: ``gzip``, ``zstd`` or none."""
