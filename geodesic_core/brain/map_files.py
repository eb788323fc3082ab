"""Files of values and labels at vertices: CIFTI-2, and GIFTI and FreeSurfer's of one hemisphere."""

import colorsys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_core.arrays import Floats
from geodesic_core.brain.cifti import INTENTS, brain_models, write_cifti
from geodesic_core.brain.cortex import Cortex
from geodesic_core.brain.files import kind_of, nibabel
from geodesic_core.brain.gifti import LabelTable, write_gifti
from geodesic_core.brain.maps import MapSource, read_values
from geodesic_core.brain.parcellation import Parcellation
from geodesic_core.brain.structures import only
from geodesic_core.errors import InvalidArgument
from geodesic_core.io.label import write_label

_METRICS = (".func.gii", ".shape.gii")
_MORPHOMETRY = (".curv", ".sulc", ".thickness", ".area", ".volume")
_REMEDY = "write CIFTI for both"
_HUE_STEP, _SATURATION_STEP, _VALUE = 0.7548776662, 0.5698402910, 0.9
"""Of the colours of parcels: hue and saturation move on by these shares of their range, so that
colours stay apart"""


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
    return read_values(source, cortex.structures)


def write_maps(path: str | Path, cortex: Cortex, values: ArrayLike, names: Sequence[str]) -> None:
    """Write values at the vertices of a cortex.

    Parameters
    ----------
    path
        ``.dscalar.nii``, which has the vertices of the region; or of one hemisphere, with 0 outside
        of it, ``.func.gii``, ``.shape.gii`` or, with one map, FreeSurfer's ``.curv``, ``.sulc``,
        ``.thickness``, ``.area`` or ``.volume``.
    cortex
        From `load_cortex`.
    values
        (V,) or (M, V), one for each vertex of the mesh of the cortex; float32 in the file.
    names
        Of the maps.

    Raises
    ------
    InvalidArgument
        The name ends otherwise; the file would have to hold two hemispheres, or FreeSurfer's two
        maps; the names are too few.
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
    kind = kind_of(target, (".dscalar.nii", *_METRICS, *_MORPHOMETRY))
    maps = read_values(np.asarray(values), cortex.structures).astype(np.float32)
    if len(names) != len(maps):
        raise InvalidArgument(f"there are {len(names)} names for {len(maps)} maps")
    inside = np.zeros_like(maps)
    inside[:, cortex.region] = maps[:, cortex.region]
    if kind not in _MORPHOMETRY:
        _write(target, kind, cortex, inside, names)
    elif len(maps) > 1:
        raise InvalidArgument(f"{path} holds one map: write GIFTI or CIFTI for {len(maps)} maps")
    else:
        only(cortex.structures, path, _REMEDY)
        nibabel("freesurfer", "write_maps").write_morph_data(target, inside[0])


def write_labels(path: str | Path, parcels: Parcellation) -> None:
    """Write the parcels of a cortex, each with its number and a colour.

    Parameters
    ----------
    path
        ``.dlabel.nii``; or of one hemisphere ``.label.gii``, or FreeSurfer's ``.annot``, which
        counts the parcels from 1, or ``.label``, which lists the vertices of a single one.
    parcels
        From `load_parcels`. Those of both hemispheres that have one number are counted from 1. The
        region is the parcel of ``load_parcels(np.ones(V), cortex)``.

    Raises
    ------
    InvalidArgument
        The name ends otherwise; the file would have to hold two hemispheres, or ``.label`` two
        parcels.
    NotEmbedded
        ``.label`` holds positions, and the mesh is given by lengths alone.
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
    kind = kind_of(target, (".dlabel.nii", ".label.gii", *_WRITERS))
    cortex, count = parcels.cortex, len(parcels.names)
    if kind in _WRITERS:
        only(cortex.structures, path, _REMEDY)
        _WRITERS[kind](target, parcels)
        return
    keys = parcels.keys if len(set(parcels.keys)) == count else tuple(range(1, count + 1))
    rows = zip(keys, parcels.names, _colours(count), strict=True)
    table = {0: ("???", (0.0,) * 4)} | {key: (name, (*colour, 1.0)) for key, name, colour in rows}
    labels = np.array([*keys, 0], np.int32)[parcels.parcel_of]
    _write(target, kind, cortex, labels[None], ["parcels"], table)


def _write(
    path: Path,
    kind: str,
    cortex: Cortex,
    maps: NDArray[Any],
    names: Sequence[str],
    table: LabelTable | None = None,
) -> None:
    """Write maps, which are labels where there is a table, as CIFTI or as GIFTI."""
    if kind in INTENTS:
        cifti2 = nibabel("cifti2", "writing CIFTI")
        axis = cifti2.LabelAxis(names, [table]) if table else cifti2.ScalarAxis(list(names))
        axes = (axis, brain_models(cortex.structures, cortex.region))
        write_cifti(path, kind, axes, maps[:, cortex.region].astype(np.float32), cortex.facts)
        return
    intent = "NIFTI_INTENT_LABEL" if table else "NIFTI_INTENT_SHAPE"
    arrays = [(values, intent, {"Name": name}) for values, name in zip(maps, names, strict=True)]
    write_gifti(path, only(cortex.structures, path, _REMEDY), arrays, table)


def _colours(count: int) -> list[tuple[float, float, float]]:
    """Return a colour for each of some parcels, no two of them close."""
    return [
        colorsys.hsv_to_rgb(k * _HUE_STEP % 1.0, 0.45 + 0.5 * (k * _SATURATION_STEP % 1.0), _VALUE)
        for k in range(count)
    ]


def _write_annotation(path: Path, parcels: Parcellation) -> None:
    """Write parcels as FreeSurfer has them: the colour of a vertex tells its parcel."""
    colours = np.round(255 * np.array(_colours(len(parcels.names)))).astype(np.int64)
    table = np.pad(colours, ((1, 0), (0, 1)))  # black stands for none, and nothing is transparent
    write = nibabel("freesurfer", "write_labels").write_annot
    write(path, parcels.parcel_of + 1, table, ["unknown", *parcels.names], fill_ctab=True)


def _write_label(path: Path, parcels: Parcellation) -> None:
    """Write the vertices of one parcel, with their positions."""
    count = len(parcels.names)
    if count != 1:
        raise InvalidArgument(f"{path} holds one parcel: write .annot or GIFTI for {count} parcels")
    mesh = parcels.cortex.mesh
    mesh.require_positions("a .label file")
    write_label(path, np.flatnonzero(parcels.parcel_of == 0), mesh.vertices)


_WRITERS = {".annot": _write_annotation, ".label": _write_label}
"""What writes the parcels of one hemisphere for FreeSurfer"""
