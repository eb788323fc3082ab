"""Values and labels at the vertices of hemispheres, from files and from objects."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats
from geodesic_core.brain.cifti import nibabel, open_cifti
from geodesic_core.brain.structures import Structure, side_of_image
from geodesic_core.control import Control
from geodesic_core.errors import GeodesicError, InvalidArgument, InvalidMesh, OtherSurface
from geodesic_core.io.annotation import read_annotation
from geodesic_core.io.label import read_label
from geodesic_core.io.unpacking import NamedBytes, read_unpacked

Table = Mapping[int, str]
"""The name of each label by its number"""
MapSource = Any
"""A path; an array; an image of nibabel or nilearn; or one of them for each hemisphere, in their
order or by side"""


class Maps(NamedTuple):
    """Values at the vertices of one hemisphere."""

    values: Floats
    """(M, n): of each map; NaN where it has none"""
    names: tuple[str, ...]
    """(M,)"""
    table: Table | None
    """Where the values are labels"""


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


def _checked(maps: Maps, structure: Structure) -> Maps:
    count, found = structure.count, maps.values.shape[1]
    if found == count:
        return maps
    are = "of another subject or resolution"
    if found == structure.faces:
        are = "one for each face, and must be by vertex"
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
        return [_gifti(source, _only(structures))]
    if hasattr(source, "nifti_header"):
        return list(_cifti(source, structures))
    if hasattr(source, "mesh") and hasattr(source, "data"):  # nilearn's SurfaceImage
        parts = source.data.parts
        return [Maps(np.atleast_2d(_floats(parts[s.side]).T), (), None) for s in structures]
    return _split(_floats(source), structures)


def _floats(values: Any) -> Floats:
    try:
        return np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"a {type(values).__name__} holds no values by vertex") from error


def _only(structures: Sequence[Structure]) -> Structure:
    if len(structures) > 1:
        raise InvalidArgument("it holds one hemisphere: give a file for each surface")
    return structures[0]


def _split(values: Floats, structures: Sequence[Structure]) -> list[Maps]:
    """Return the values of structures that follow each other."""
    rows = np.atleast_2d(values)
    ends = np.cumsum([each.count for each in structures])
    if len(structures) > 1 and rows.shape[1] != ends[-1]:
        found, count = rows.shape[1], int(ends[-1])
        what = f"there are {found} values, but the surfaces have {count} vertices"
        raise OtherSurface(what, found, count)
    parts = np.split(rows, ends[:-1], axis=1)
    return [Maps(part, (), None) for part in parts]


def _read(path: Path, structures: Sequence[Structure]) -> list[Maps]:
    """Read a file by its suffix; one of no known suffix has values of FreeSurfer."""
    try:
        file = read_unpacked(path, _READERS, None, Control())
    except InvalidMesh as error:
        raise InvalidArgument(str(error)) from error
    try:
        if file.suffix == "nii":
            return list(_cifti(open_cifti(path), structures))
        if file.suffix in _TABLES:
            return _split(_TABLES[file.suffix](file), structures)
        read = _READERS.get(file.suffix, _morphometry)
        return [read(file, path, _only(structures))]
    except GeodesicError as error:
        error.args = (f"{path}: {error}",)
        raise
    except Exception as error:  # any failure of a parser
        what = " ".join(str(error).split())[:200] or type(error).__name__
        raise InvalidArgument(f"{path} is no file of values at vertices: {what}") from error


def _gifti_file(file: NamedBytes, _path: Path, structure: Structure) -> Maps:
    image = nibabel("gifti.gifti", "reading GIFTI").GiftiImage.from_bytes(file.data)
    return _gifti(image, structure)


def _gifti(image: Any, structure: Structure) -> Maps:
    side = side_of_image(image)
    if side not in (None, structure.side):
        raise InvalidArgument(f"it is of the {side} hemisphere, and the surface of the other one")
    arrays = [np.asarray(array.data) for array in image.darrays]
    if not arrays or any(len(array) != len(arrays[0]) for array in arrays):
        raise InvalidArgument("it holds no values at vertices")
    columns = np.concatenate([array.reshape(len(array), -1) for array in arrays], axis=1)
    names = tuple(str(array.meta.get("Name", "")) for array in image.darrays)
    table = image.labeltable.get_labels_as_dict() if image.labeltable.labels else None
    is_label = image.darrays[0].intent == _LABEL_INTENT
    return Maps(columns.T.astype(np.float64), names, table if is_label else None)


def _cifti(image: Any, structures: Sequence[Structure]) -> Iterator[Maps]:
    """Yield the maps of each structure: of its brain model, or of the parcels in it."""
    rows, columns = (image.header.get_axis(i) for i in range(2))
    values = np.asarray(image.dataobj, np.float64)
    names = tuple(map(str, getattr(rows, "name", ())))
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
        yield Maps(maps, names, table)


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


def _annot(file: NamedBytes, _path: Path, structure: Structure) -> Maps:
    codes, table = read_annotation(file.data, structure.count)
    values = np.full(structure.count, np.nan)
    for number, (_, code) in table.items():
        values[codes == code] = number
    names = {number: name for number, (name, _) in table.items()}
    return Maps(values[None], ("",), names)


def _label(file: NamedBytes, _path: Path, structure: Structure) -> Maps:
    inside = read_label(file.data, structure.count)
    return Maps(inside[None].astype(np.float64), ("",), None)


def _morphometry(_file: NamedBytes, path: Path, _structure: Structure) -> Maps:
    values = nibabel("freesurfer", "reading values of FreeSurfer").read_morph_data(path)
    return Maps(np.asarray(values, np.float64)[None], (path.suffix[1:],), None)


def _npy(file: NamedBytes) -> Floats:
    from io import BytesIO

    return _floats(np.load(BytesIO(file.data), allow_pickle=False))


def _text(file: NamedBytes) -> Floats:
    return _floats(np.loadtxt(StringIO(file.data.decode()), delimiter=",", ndmin=2).T)


_LABEL_INTENT = 1002
_TABLES = {"npy": _npy, "csv": _text, "txt": _text}
"""Files of values alone, which may be those of all surfaces"""
_READERS: Mapping[str, Callable[[NamedBytes, Path, Structure], Maps]] = {
    "gii": _gifti_file,
    "annot": _annot,
    "label": _label,
}
