"""Bare arrays: little-endian, in C order, unreachable as infinity; other members as headers."""

from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.encoding.answer import Answer, Buffer, Encoded
from app.encoding.headers import headers_of
from app.errors import ProblemError, problem


def to_npy(answer: Answer, dtype: str) -> Encoded:
    """Encode the array in numpy's own format."""
    array = _body(answer, dtype)
    return npy_parts(array), array_headers(answer, array.dtype, array.shape)


def npy_parts(array: NDArray[Any]) -> Sequence[Buffer]:
    """Return an array in numpy's own format: a header and the bytes, in C order."""
    header = BytesIO()
    np.lib.format.write_array_header_1_0(header, np.lib.format.header_data_from_array_1_0(array))
    return header.getvalue(), _raw(array)


def to_octets(answer: Answer, dtype: str) -> Encoded:
    """Encode the bytes of the array, without a header."""
    array = _body(answer, dtype)
    return [_raw(array)], array_headers(answer, array.dtype, array.shape)


def to_npz(answer: Answer, dtype: str) -> Encoded:
    """Encode a sparse matrix as `scipy.sparse.load_npz` reads it, or arrays by name."""
    if answer.named is not None:
        file = BytesIO()
        np.savez_compressed(file, allow_pickle=False, **answer.named)
        return [file.getbuffer()], headers_of(answer, answer.shown)
    from scipy.sparse import coo_array

    _, rows, columns = (answer.members[name] for name in answer.arrays)
    distances = _body(answer, dtype)
    table = coo_array((distances, (rows, columns)), shape=answer.members["shape"]).tocsr()
    file = BytesIO()
    np.savez(
        file,
        format=np.array(b"csr"),
        shape=np.array(table.shape),
        indices=table.indices.astype(np.int64),
        indptr=table.indptr.astype(np.int64),
        data=table.data,
        _is_array=np.array(True),
    )
    return [file.getbuffer()], array_headers(answer, distances.dtype, table.shape)


def _body(answer: Answer, dtype: str) -> NDArray[Any]:
    array: NDArray[Any] | None
    array = answer.members[answer.arrays[0]] if answer.array is None else answer.array()
    if array is None:  # no path: the headers state the reason
        array = np.empty((0, 3))
    try:
        with np.errstate(over="raise"):
            return np.ascontiguousarray(array, dtype=np.dtype(dtype).newbyteorder("<"))
    except FloatingPointError:
        raise too_large_for(dtype) from None


def too_large_for(dtype: str) -> ProblemError:
    """Return the exception for numbers that do not fit into a type."""
    return problem("invalid_request", f"{dtype} cannot hold numbers so large")


def _raw(array: NDArray[Any]) -> memoryview | bytes:
    return array.reshape(-1).view(np.uint8).data if array.size else b""


def array_headers(answer: Answer, dtype: np.dtype[Any], shape: tuple[int, ...]) -> dict[str, str]:
    """Return the headers of an array: its form, and the small members of its answer."""
    own = {"Geodesic-Dtype": dtype.str, "Geodesic-Shape": ",".join(map(str, shape))}
    return own | headers_of(answer, (*answer.arrays, "shape"))
