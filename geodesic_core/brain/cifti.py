"""Files of CIFTI-2, by nibabel: their axes, intents and metadata."""

import json
from collections.abc import Sequence
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Longs
from geodesic_core.brain.files import kind_of, nibabel, reading
from geodesic_core.brain.structures import Structure
from geodesic_core.errors import InvalidArgument
from geodesic_core.matrices.formats import Facts

INTENTS = {
    ".dconn.nii": "ConnDense",
    ".pconn.nii": "ConnParcels",
    ".pdconn.nii": "ConnParcelDense",
    ".dpconn.nii": "ConnDenseParcel",
    ".dscalar.nii": "ConnDenseScalar",
    ".dlabel.nii": "ConnDenseLabel",
    ".pscalar.nii": "ConnParcelScalr",
}
"""By suffix, the name of what a file holds, as NIfTI spells it"""


def brain_models(structures: Sequence[Structure], vertices: Longs) -> Any:
    """Return the axis of some vertices, ascending, each by its structure."""
    axis = nibabel("cifti2", "writing CIFTI").BrainModelAxis
    models = [
        axis.from_surface(ids, each.count, each.cifti_name)
        for each in structures
        if len(ids := each.of(vertices))
    ]
    return reduce(add, models)


def write_cifti(
    path: Path, kind: str, axes: Sequence[Any], values: NDArray[Any], facts: Facts
) -> None:
    """Write a file of a kind; ``axes[0]`` is that of what CIFTI calls a row."""
    cifti2 = nibabel("cifti2", "writing CIFTI")
    header = cifti2.Cifti2Header.from_axes(axes)
    header.matrix.metadata = cifti2.Cifti2MetaData(geodesic=json.dumps(dict(facts)))
    image = cifti2.Cifti2Image(values, header)
    image.nifti_header.set_intent(INTENTS[kind])
    image.nifti_header.set_data_dtype(np.float32)
    image.to_filename(path)


class BrainMatrix(NamedTuple):
    """A matrix from a CIFTI file: what its rows and columns are, and what made it.

    Examples
    --------
    >>> gc.brain.BrainMatrix._fields
    ('values', 'rows', 'columns', 'facts')
    """

    values: NDArray[np.float32]
    """(N, M), mm; infinite where no path leads"""
    rows: list[tuple[str, Longs]] | list[str]
    """The structure of each run of rows with its vertices, (n,) int64; or the names of parcels"""
    columns: list[tuple[str, Longs]] | list[str]
    """Likewise"""
    facts: dict[str, Any]
    """What was asked, as `write_distances` and `parcel_distances` write it; empty where another
    program wrote the file"""


def load_matrix(source: str | Path) -> BrainMatrix:
    """Read a matrix of CIFTI: ``.dconn.nii``, ``.pconn.nii``, ``.pdconn.nii`` or ``.dpconn.nii``.

    Parameters
    ----------
    source
        The path of the file.

    Returns
    -------
    BrainMatrix
        Its (N, M) values, float32, as they are in the file, and the ids of rows and columns.

    Raises
    ------
    InvalidArgument
        It is no such file, or cannot be read.
    MissingExtra
        CIFTI needs nibabel, the extra ``brain``.

    Notes
    -----
    O(N M) memory.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> cortex = gc.brain.load_cortex({"left": gc.samples.sphere(80)}, [1, 2], "passes")
    >>> written = gc.brain.write_distances(cortex, f"{mkdtemp()}/near.dconn.nii")
    >>> gc.brain.load_matrix(written.path).rows
    [('CortexLeft', array([1, 2]))]
    """
    path = Path(source)
    kind_of(path, [kind for kind in INTENTS if "conn" in kind])
    with reading(path, "CIFTI-2 file"):
        image = nibabel("cifti2", "load_matrix").Cifti2Image.from_filename(path)
    axes = [image.header.get_axis(i) for i in range(2)]
    if not all(hasattr(axis, "nvertices") for axis in axes):
        raise InvalidArgument(f"{path} is no matrix of vertices or parcels")
    values = np.asarray(image.dataobj, np.float32)
    facts = (image.header.matrix.metadata or {}).get("geodesic", "{}")
    return BrainMatrix(values, _ids(axes[0]), _ids(axes[1]), json.loads(facts))


def _ids(axis: Any) -> list[tuple[str, Longs]] | list[str]:
    if hasattr(axis, "iter_structures"):
        return [
            (
                name.removeprefix("CIFTI_STRUCTURE_").title().replace("_", ""),
                np.asarray(model.vertex, np.int64),
            )
            for name, _, model in axis.iter_structures()
        ]
    return [str(name) for name in axis.name]
