"""Files of tables: npy and Zarr of dense ones, npz and Parquet of sparse ones."""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import IO, Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from geodesic_core.extras import extra
from geodesic_core.matrices import dense, sparse
from geodesic_core.matrices.blocks import Blocks
from geodesic_core.matrices.plan import Plan

DENSE, SPARSE = (".npy", ".zarr"), (".npz", ".parquet")
SUFFIXES = (*DENSE, *SPARSE)

Facts = Mapping[str, Any]
"""What was asked, as the metadata of a file tell it"""
DenseWriter = Callable[[NDArray[Any], Facts, Path], None]
"""Function that writes a file of a dense table, which is mapped"""

_ZARR_CHUNK = 1 << 22  # bytes


def require(suffix: str) -> None:
    """Raise ``MissingExtra`` where the package that writes a format is not installed."""
    with extra("tables", "zarr" if suffix == ".zarr" else "PyArrow", f"write_matrix to {suffix}"):
        if suffix == ".zarr":
            import zarr  # noqa: F401
        elif suffix == ".parquet":
            import pyarrow.parquet  # noqa: F401


def may_replace(out: Path) -> bool:
    """Tell whether a table may replace what is at a path: no folder but a Zarr array."""
    if not out.is_dir():
        return True
    try:
        kind = json.loads((out / "zarr.json").read_bytes())["node_type"]
    except (OSError, LookupError, TypeError, ValueError):
        return False
    return out.suffix.lower() == ".zarr" and kind == "array"


def write_table(
    plan: Plan,
    blocks: Blocks,
    dtype: np.dtype[Any],
    facts: Facts,
    out: Path,
    inside: Facts | None,
    dense_writers: Mapping[str, DenseWriter],
) -> None:
    """Write the file of a table whose blocks are all there, as a whole or not at all.

    An npz file has the facts ``inside``, if any.
    """
    suffix = out.suffix.lower()
    scratch = blocks.folder / f"whole{suffix}"
    if scratch.is_dir():
        shutil.rmtree(scratch)
    if suffix == ".npz":
        with scratch.open("wb") as file:
            write_npz(plan, blocks.get, dtype, file, inside)
    elif suffix == ".parquet":
        _write_parquet(plan, blocks, dtype, facts, scratch)
    else:
        whole = scratch.with_suffix(".npy")
        with whole.open("wb") as file:
            write_npy(plan, blocks.get, dtype, file)
        writers = {".zarr": _write_zarr, **dense_writers}
        if suffix in writers:
            writers[suffix](np.load(whole, mmap_mode="r"), facts, scratch)
    if out.is_dir():
        shutil.rmtree(out)
    scratch.replace(out)


def write_npy(
    plan: Plan, block_of: Callable[[int], NDArray[Any]], dtype: np.dtype[Any], file: IO[bytes]
) -> None:
    """Write a dense table in numpy's format, from its blocks."""
    # Written, not mapped: pages of a map would count as memory of the process.
    header = {"descr": dtype.str, "fortran_order": False, "shape": plan.shape}
    np.lib.format.write_array_header_1_0(file, header)
    begin, row_bytes = file.tell(), plan.shape[1] * dtype.itemsize
    for numbers, rows in dense.file_rows(plan, block_of):
        for number, row in zip(numbers.tolist(), np.ascontiguousarray(rows), strict=True):
            file.seek(begin + number * row_bytes)
            file.write(row.data.cast("B"))


def write_npz(
    plan: Plan,
    block_of: Callable[[int], NDArray[Any]],
    dtype: np.dtype[Any],
    file: IO[bytes],
    facts: Facts | None = None,
) -> None:
    """Write a sparse table as `scipy.sparse.load_npz` reads it, from its blocks.

    It reads no ``facts``; these are bytes, JSON.
    The bytes are those of `numpy.savez`, which would need all entries at once.
    """
    counts = np.zeros(plan.shape[0] + 1, np.int64)
    for entries in sparse.file_rows(plan, block_of):
        counts += np.bincount(entries.row + 1, minlength=len(counts))
    ends = np.cumsum(counts)
    shape = (int(ends[-1]),)
    with ZipFile(file, "w") as archive:
        _put(archive, "format", np.array(b"csr"))
        _put(archive, "shape", np.array(plan.shape))
        columns = (entries.column for entries in sparse.file_rows(plan, block_of))
        _put_parts(archive, "indices", ends.dtype, shape, columns)
        _put(archive, "indptr", ends)
        distances = (entries.distance for entries in sparse.file_rows(plan, block_of))
        _put_parts(archive, "data", dtype, shape, distances)
        _put(archive, "_is_array", np.array(True))
        if facts is not None:
            _put(archive, "facts", np.array(json.dumps(dict(facts)).encode()))


def _put(archive: ZipFile, name: str, array: NDArray[Any]) -> None:
    _put_parts(archive, name, array.dtype, array.shape, [array])


def _put_parts(
    archive: ZipFile,
    name: str,
    dtype: np.dtype[Any],
    shape: tuple[int, ...],
    parts: Iterable[NDArray[Any]],
) -> None:
    """Write an array of an npz file, from its parts in order."""
    header = {"descr": dtype.str, "fortran_order": False, "shape": shape}
    with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
        np.lib.format.write_array_header_1_0(file, header)
        for part in parts:
            file.write(part.tobytes())


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal; of a folder, of its files by their names."""
    digest = hashlib.sha256()
    files = sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else [path]
    for each in files:
        with each.open("rb") as file:
            while part := file.read(1 << 20):
                digest.update(part)
    return digest.hexdigest()


def _write_zarr(table: NDArray[Any], facts: Facts, folder: Path) -> None:
    import zarr

    rows = max(1, min(len(table), _ZARR_CHUNK // (table.shape[1] * table.itemsize)))
    array = zarr.create_array(
        folder, shape=table.shape, chunks=(rows, table.shape[1]), dtype=table.dtype
    )
    array.attrs.update(dict(facts))
    for first in range(0, len(table), rows):
        array[first : first + rows] = table[first : first + rows]


def _write_parquet(
    plan: Plan, blocks: Blocks, dtype: np.dtype[Any], facts: Facts, path: Path
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema(
        [
            ("source", pa.int64()),
            ("target", pa.int64()),
            ("distance", pa.from_numpy_dtype(dtype)),
        ],
        metadata={"geodesic": json.dumps(dict(facts))},
    )
    with pq.ParquetWriter(path, schema) as writer:
        for entries in sparse.file_rows(plan, blocks.get):
            writer.write_table(pa.table(list(entries), schema=schema))
