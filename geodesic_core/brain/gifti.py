"""Files of GIFTI, by nibabel: arrays of one hemisphere, their intents and metadata."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from geodesic_core.brain.files import nibabel
from geodesic_core.brain.structures import STRUCTURE, Structure

LabelTable = Mapping[int, tuple[str, tuple[float, ...]]]
"""Name and colour of each label, red to opacity from 0 to 1, by its number"""


Array = tuple[NDArray[Any], str, Mapping[str, str]]
"""Values, float32 or int32; their intent, such as ``NIFTI_INTENT_SHAPE``; and metadata"""


def write_gifti(
    path: Path, structure: Structure, arrays: Sequence[Array], table: LabelTable | None = None
) -> None:
    """Write a file of a structure, with a table where its values are labels."""
    gifti = nibabel("gifti.gifti", "writing GIFTI")
    image = gifti.GiftiImage(
        darrays=[gifti.GiftiDataArray(values, intent, meta=meta) for values, intent, meta in arrays]
    )
    image.meta[STRUCTURE] = structure.name
    for key, (name, colour) in (table or {}).items():
        label = gifti.GiftiLabel(key, *colour)
        label.label = name
        image.labeltable.labels.append(label)
    image.to_filename(path)
