"""Queries as forms: a part with the request as JSON, and parts with arrays in numpy's format."""

from collections.abc import Collection
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.errors import Fault, ProblemError, pointer, problem
from app.http.form import Form

REQUEST = "request"
"""The part that is JSON"""


def parts_of(content_type: str, body: bytes, arrays: Collection[str]) -> dict[str, bytes]:
    """Return the parts of a form by name: the request, and any of the ``arrays``."""
    parts: dict[str, bytearray] = {}
    names = (REQUEST, *arrays)

    def begin(options: dict[bytes, bytes], _content_type: bytes) -> None:
        name = options.get(b"name", b"").decode("latin-1")
        if name not in names or name in parts:
            wrong = "two parts" if name in parts else "a part"
            detail = f"the form has {wrong} named {name!r}; it may have one each of "
            raise problem("malformed_body", detail + ", ".join(names))
        parts[name] = bytearray()

    def add(data: bytes) -> None:
        parts[next(reversed(parts))].extend(data)

    form = Form(content_type, begin, add)
    form.write(body)
    form.end()
    if REQUEST not in parts:
        raise problem("malformed_body", f"the form has no part named {REQUEST!r}, which is JSON")
    return {name: bytes(part) for name, part in parts.items()}


def numbers_in(name: str, content: bytes) -> NDArray[np.float64]:
    """Return a list of real numbers in numpy's format."""
    array = _array_in(name, content)
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        shape = f"the shape {array.shape} and the type {array.dtype}"
        raise _fault(name, f"the array has {shape}; it must be a list of real numbers")
    return array.astype(np.float64)


def as_json(numbers: NDArray[np.float64]) -> list[float | None]:
    """Return numbers as JSON has them: None where they are not finite."""
    present = np.isfinite(numbers).tolist()
    return [x if there else None for x, there in zip(numbers.tolist(), present, strict=True)]


def _array_in(name: str, content: bytes) -> NDArray[Any]:
    """Return an array over its bytes: no memory is taken for what its header claims."""
    file = BytesIO(content)
    formats: Any = np.lib.format
    try:
        version = formats.read_magic(file)
        read = {(1, 0): formats.read_array_header_1_0, (2, 0): formats.read_array_header_2_0}
        shape, is_fortran, dtype = read[version](file)
        array = np.frombuffer(content, dtype, offset=file.tell())
        return array.reshape(shape, order="F" if is_fortran else "C")
    except (ValueError, KeyError) as error:
        raise _fault(name, f"the part is no array in numpy's format: {error}") from None


def _fault(name: str, message: str) -> ProblemError:
    fault = Fault(pointer(name), message)
    return problem("invalid_request", f"{fault.pointer}: {message}", errors=(fault,))
