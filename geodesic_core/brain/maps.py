"""Values and labels at the vertices of hemispheres, from files and from objects."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats
from geodesic_core.brain.files import nibabel, reading
from geodesic_core.brain.structures import Side, Structure, only, side_named, side_of_image
from geodesic_core.control import Control
from geodesic_core.errors import InvalidArgument, OtherSurface
from geodesic_core.io.annotation import read_annotation
from geodesic_core.io.label import read_label
from geodesic_core.io.unpacking import read_unpacked

MapSource = Any
"""A path; an array; an image of nibabel or nilearn; or one of them for each hemisphere, in their
order or by side"""


class Maps(NamedTuple):
    """Values at the vertices of one hemisphere."""

    values: Floats
    """(M, n): of each map; NaN where it has none"""
    table: Mapping[int, str] | None = None
    """The name of each label by its number, where the values are labels"""


def read_maps(source: MapSource, structures: Sequence[Structure]) -> list[Maps]:
    """Return the maps of each structure, as many of each.

    Raises
    ------
    InvalidArgument
        A file cannot be read, or tells of another hemisphere.
    OtherSurface
        It has another number of values than a surface has vertices.
    MissingExtra
        GIFTI, CIFTI and FreeSurfer's values need nibabel, the extra ``brain``.
    """
    found = _by_structure(source, structures)
    maps = [_checked(*each) for each in zip(found, structures, strict=True)]
    counts = [str(len(each.values)) for each in maps]
    if len(set(counts)) > 1:
        raise InvalidArgument(f"the hemispheres have {' and '.join(counts)} maps")
    return maps


def read_values(source: MapSource, structures: Sequence[Structure]) -> Floats:
    """Return the values of each map at the vertices of all structures, (M, V)."""
    return np.concatenate([each.values for each in read_maps(source, structures)], axis=1)


def _checked(maps: Maps, structure: Structure) -> Maps:
    count, found = structure.count, maps.values.shape[1]
    if found == count:
        return maps
    are = "of another subject or resolution"
    if found == structure.faces:
        are = "one for each face, and must be by vertex"
    elif found == 2 * count:
        are = "perhaps of both hemispheres, which then need both surfaces"
    of = f"the {count} vertices of the {structure.side} surface"
    raise OtherSurface(f"there are {found} values for {of}: they are {are}", found, count)


def _by_structure(source: MapSource, structures: Sequence[Structure]) -> list[Maps]:
    if isinstance(source, Mapping):
        missing = [each.side for each in structures if each.side not in source]
        if missing:
            raise InvalidArgument(f"there is none for the {missing[0]} hemisphere")
        source = [source[each.side] for each in structures]
    if isinstance(source, list | tuple):
        if len(source) == 1:
            (source,) = source
        elif len(source) == len(structures):
            pairs = zip(source, structures, strict=True)
            return [_by_structure(one, [structure])[0] for one, structure in pairs]
        else:
            there = f"there are {len(source)} files for {len(structures)} surfaces"
            raise InvalidArgument(f"{there}: give one for each, or one that holds all")
    if isinstance(source, str | Path):
        return _read(Path(source), structures)
    if hasattr(source, "darrays"):
        return [_gifti(source, only(structures, "it", _REMEDY))]
    if hasattr(source, "nifti_header"):
        return list(_cifti(source, structures))
    if hasattr(source, "mesh") and hasattr(source, "data"):  # nilearn's SurfaceImage
        parts = source.data.parts
        return [Maps(_rows(np.transpose(parts[each.side]))) for each in structures]
    return _split(_rows(source), structures)


def _rows(values: Any) -> Floats:
    """Return values as a row for each map."""
    try:
        rows = np.atleast_2d(np.asarray(values, np.float64))
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"a {type(values).__name__} holds no values by vertex") from error
    if rows.ndim > 2:
        raise InvalidArgument(f"values have shape {rows.shape}; it must be (n,) or (M, n)")
    return rows


def _split(rows: Floats, structures: Sequence[Structure]) -> list[Maps]:
    """Return the values of structures that follow each other."""
    ends = np.cumsum([each.count for each in structures])
    if len(structures) > 1 and rows.shape[1] != ends[-1]:
        found, count = rows.shape[1], int(ends[-1])
        what = f"there are {found} values, but the surfaces have {count} vertices"
        raise OtherSurface(what, found, count)
    return [Maps(part) for part in np.split(rows, ends[:-1], axis=1)]


def _read(path: Path, structures: Sequence[Structure]) -> list[Maps]:
    """Read a file by its suffix; one of no known suffix has values of FreeSurfer."""
    with reading(path, "file of values at vertices"):
        file = read_unpacked(path, {*_OPENERS, *_OF_ONE}, None, Control())
        if file.suffix in _OPENERS:
            return _by_structure(_OPENERS[file.suffix](file.data), structures)
        structure = only(structures, "it", _REMEDY)
        _check_side(side_named(path.name), structure)
        if file.suffix in _OF_ONE:
            return [_OF_ONE[file.suffix](file.data, structure)]
        values = nibabel("freesurfer", "reading values of FreeSurfer").read_morph_data(path)
        return [Maps(_rows(values))]


def _check_side(told: Side | None, structure: Structure) -> None:
    if told not in (None, structure.side):
        raise InvalidArgument(f"it is of the {told} hemisphere, and the surface of the other one")


def _gifti(image: Any, structure: Structure) -> Maps:
    _check_side(side_of_image(image), structure)
    arrays = [np.asarray(array.data) for array in image.darrays]
    if not arrays or any(len(array) != len(arrays[0]) for array in arrays):
        raise InvalidArgument("it holds no values at vertices")
    columns = np.concatenate([array.reshape(len(array), -1) for array in arrays], axis=1)
    table = image.labeltable.get_labels_as_dict() if image.labeltable.labels else None
    is_label = image.darrays[0].intent == _LABEL_INTENT
    return Maps(columns.T.astype(np.float64), table if is_label else None)


def _cifti(image: Any, structures: Sequence[Structure]) -> Iterator[Maps]:
    """Yield the maps of each structure: of its brain model, or of the parcels in it."""
    rows, columns = (image.header.get_axis(i) for i in range(2))
    values = np.asarray(image.dataobj, np.float64)
    table = None
    if hasattr(rows, "label"):  # one table for each map
        table = {key: name for labels in rows.label for key, (name, _) in labels.items()}
    for structure in structures:
        declared = columns.nvertices.get(structure.cifti_name)
        if declared is None:
            raise InvalidArgument(f"it has nothing of the {structure.side} cortex")
        maps = np.full((len(values), int(declared)), np.nan)
        for vertices, part in _places(columns, structure.cifti_name):
            maps[:, vertices] = values[:, part]
        yield Maps(maps, table)


def _places(axis: Any, name: str) -> Iterator[tuple[NDArray[np.integer[Any]], Any]]:
    """Yield vertices of a structure with the columns that have their values."""
    if hasattr(axis, "iter_structures"):
        for each, part, model in axis.iter_structures():
            if each == name:
                yield model.vertex, part
    else:
        for column, vertices in enumerate(axis.vertices):
            if name in vertices:
                yield vertices[name], slice(column, column + 1)


def _annot(data: bytes, structure: Structure) -> Maps:
    codes, table = read_annotation(data, structure.count)
    values = np.full(structure.count, np.nan)
    for number, (_, code) in table.items():
        values[codes == code] = number
    return Maps(values[None], {number: name for number, (name, _) in table.items()})


def _label(data: bytes, structure: Structure) -> Maps:
    return Maps(read_label(data, structure.count)[None].astype(np.float64))


def _open_image(module: str, image: str) -> Callable[[bytes], Any]:
    return lambda data: getattr(nibabel(module, "reading values"), image).from_bytes(data)


def _open_numpy(data: bytes) -> Any:
    return np.load(BytesIO(data), allow_pickle=False)


def _open_text(data: bytes) -> Any:
    return np.loadtxt(StringIO(data.decode()), delimiter=",", ndmin=2).T


_REMEDY = "give a file for each surface"
_LABEL_INTENT = 1002
_OPENERS: Mapping[str, Callable[[bytes], Any]] = {
    "gii": _open_image("gifti.gifti", "GiftiImage"),
    "nii": _open_image("cifti2", "Cifti2Image"),
    "npy": _open_numpy,
    "csv": _open_text,
    "txt": _open_text,
}
"""What makes a file an object that is read as one that is given"""
_OF_ONE: Mapping[str, Callable[[bytes, Structure], Maps]] = {"annot": _annot, "label": _label}
"""What reads files of one hemisphere that need its number of vertices"""
