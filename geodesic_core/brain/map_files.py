"""Files of values and labels at vertices: CIFTI-2, and GIFTI of one hemisphere."""

import colorsys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_core.arrays import Floats
from geodesic_core.brain.cifti import brain_models, kind_of, nibabel, write_cifti
from geodesic_core.brain.cortex import Cortex, as_values
from geodesic_core.brain.maps import MapSource, read_maps
from geodesic_core.brain.parcellation import Parcellation
from geodesic_core.errors import InvalidArgument

_METRICS = (".func.gii", ".shape.gii")
_HUE_STEP, _SATURATION, _VALUE = 0.6180339887, 0.6, 0.9
"""Of the colours of parcels: each hue is a golden section of the circle from the last one"""


def load_maps(source: MapSource, cortex: Cortex) -> Floats:
    """Return values at the vertices of a cortex, such as thickness.

    Parameters
    ----------
    source
        Files, arrays or images, as the ``roi`` of `load_cortex`.
    cortex
        The surfaces.

    Returns
    -------
    (M, V) float64
        Of each map; NaN where the source has none.

    Raises
    ------
    InvalidArgument, MissingExtra
        As in `load_cortex`.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> cortex = gc.brain.load_cortex({"left": gc.samples.sphere(80)})
    >>> file = f"{mkdtemp()}/areas.func.gii"
    >>> gc.brain.write_maps(file, cortex, cortex.areas, ["area"])
    >>> gc.brain.load_maps(file, cortex).shape
    (1, 42)
    """
    return np.concatenate([each.values for each in read_maps(source, cortex.structures)], axis=1)


def write_maps(path: str | Path, cortex: Cortex, values: ArrayLike, names: Sequence[str]) -> None:
    """Write values at the vertices of a cortex.

    Parameters
    ----------
    path
        ``.dscalar.nii``, which has the vertices of the region; or ``.func.gii`` or ``.shape.gii``
        of one hemisphere, with 0 outside of it.
    cortex
        From `load_cortex`.
    values
        (V,) or (M, V), one for each vertex of the mesh of the cortex; float32 in the file.
    names
        Of the maps.

    Raises
    ------
    InvalidArgument
        The name ends otherwise; GIFTI would have to hold two hemispheres; the names are too few.
    OtherSurface
        There are not as many values as vertices.
    MissingExtra
        It needs nibabel, the extra ``brain``.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> cortex = gc.brain.load_cortex({"left": gc.samples.sphere(80)})
    >>> gc.brain.write_maps(f"{mkdtemp()}/areas.dscalar.nii", cortex, cortex.areas, ["area"])
    """
    target = Path(path)
    kind = kind_of(target, (".dscalar.nii", *_METRICS))
    maps = np.atleast_2d(as_values(values, cortex)).astype(np.float32)
    if len(names) != len(maps):
        raise InvalidArgument(f"there are {len(names)} names for {len(maps)} maps")
    if kind in _METRICS:
        inside = np.zeros_like(maps)
        inside[:, cortex.region] = maps[:, cortex.region]
        _write_gifti(target, cortex, inside, names, "NIFTI_INTENT_SHAPE")
        return
    axes = (
        nibabel("cifti2", "write_maps").ScalarAxis(list(names)),
        brain_models(cortex.structures, cortex.region),
    )
    write_cifti(target, kind, axes, maps[:, cortex.region], cortex.facts)


def write_labels(path: str | Path, parcels: Parcellation) -> None:
    """Write the parcels of a cortex, each with its number and a colour.

    Parameters
    ----------
    path
        ``.dlabel.nii``, or ``.label.gii`` of one hemisphere.
    parcels
        From `load_parcels`. Those of both hemispheres that have one number are counted from 1.

    Raises
    ------
    InvalidArgument
        The name ends otherwise, or GIFTI would have to hold two hemispheres.
    MissingExtra
        It needs nibabel, the extra ``brain``.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> cortex = gc.brain.load_cortex({"left": gc.samples.sphere(80)})
    >>> parcels = gc.brain.load_parcels(np.arange(42) // 14, cortex)
    >>> file = f"{mkdtemp()}/thirds.dlabel.nii"
    >>> gc.brain.write_labels(file, parcels)
    >>> gc.brain.load_parcels(file, cortex).keys
    (1, 2)
    """
    target = Path(path)
    kind = kind_of(target, (".dlabel.nii", ".label.gii"))
    cortex, count = parcels.cortex, len(parcels.names)
    keys = parcels.keys if len(set(parcels.keys)) == count else tuple(range(1, count + 1))
    table = {0: ("???", (0.0, 0.0, 0.0, 0.0))}
    for k, (key, name) in enumerate(zip(keys, parcels.names, strict=True)):
        red, green, blue = colorsys.hsv_to_rgb(k * _HUE_STEP % 1.0, _SATURATION, _VALUE)
        table[key] = (name, (red, green, blue, 1.0))
    labels = np.array([*keys, 0], np.int32)[parcels.parcel_of]
    if kind == ".label.gii":
        _write_gifti(target, cortex, labels[None], ["parcels"], "NIFTI_INTENT_LABEL", table)
        return
    axes = (
        nibabel("cifti2", "write_labels").LabelAxis(["parcels"], [table]),
        brain_models(cortex.structures, cortex.region),
    )
    write_cifti(target, kind, axes, labels[None, cortex.region].astype(np.float32), cortex.facts)


def _write_gifti(
    path: Path,
    cortex: Cortex,
    maps: NDArray[Any],
    names: Sequence[str],
    intent: str,
    table: Mapping[int, tuple[str, tuple[float, ...]]] | None = None,
) -> None:
    if len(cortex.structures) > 1:
        raise InvalidArgument(f"{path} holds one hemisphere: write CIFTI for both")
    gifti = nibabel("gifti.gifti", "writing GIFTI")
    arrays = [
        gifti.GiftiDataArray(values, intent, meta={"Name": name})
        for values, name in zip(maps, names, strict=True)
    ]
    image = gifti.GiftiImage(darrays=arrays)
    image.meta["AnatomicalStructurePrimary"] = cortex.structures[0].name
    for key, (name, colour) in (table or {}).items():
        label = gifti.GiftiLabel(key, *colour)
        label.label = name
        image.labeltable.labels.append(label)
    image.to_filename(path)
