"""Raw pointers to arrays within kernels, and borrowed arrays: what passing them costs nothing.

With ``NUMBA_DISABLE_JIT=1`` they are flat views, and the kernels plain Python.
"""

import hashlib
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, overload
from numpy.typing import NDArray


def _interpreted_pointer(array: NDArray[Any]) -> NDArray[Any]:
    return array.reshape(-1)


def _interpreted_pointers(group: Any) -> Any:
    if isinstance(group, np.ndarray):
        return group.reshape(-1)
    if hasattr(group, "_fields"):
        return type(group)(*map(_interpreted_pointers, group))
    return group


def _interpreted_ints(rows: NDArray[Any]) -> NDArray[Any]:
    return rows.view(np.int32)


@intrinsic
def _compiled_pointer(typingcontext: Any, array: Any) -> Any:  # noqa: ARG001 - numba's signature
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        (array_type,) = signature.args
        return context.make_array(array_type)(context, builder, arguments[0]).data

    return types.CPointer(array.dtype)(array), codegen


def _type_of_pointers(group: Any) -> Any:
    if isinstance(group, types.Array):
        return types.CPointer(group.dtype)
    if isinstance(group, types.BaseNamedTuple):
        parts: Any = group
        pointers = [_type_of_pointers(part) for part in parts]
        if pointers == list(parts):  # nothing of it is an array: it stays the type of the group
            return group
        from_types: Any = types.BaseTuple.from_types
        kind = from_types(pointers, parts.instance_class)
        # Symbols spell out the types of arguments: of a large group, half of a compiled kernel.
        digest = hashlib.sha256(", ".join(map(str, pointers)).encode()).hexdigest()[:16]
        kind.name = f"{parts.instance_class.__name__}_{digest}"
        return kind
    return group


def _in_each_array(
    of_array: Callable[..., Any], type_of: Callable[[Any], Any], group: Any
) -> tuple[Any, Any]:
    """Return what an intrinsic does that applies ``of_array`` in a group at any depth."""

    def convert(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        if isinstance(kind, types.Array):
            return of_array(context.make_array(kind)(context, builder, value))
        if isinstance(kind, types.BaseNamedTuple):
            kinds: Any = kind
            parts = [
                convert(context, builder, part, builder.extract_value(value, i))
                for i, part in enumerate(kinds)
            ]
            return context.make_tuple(builder, type_of(kind), parts)
        return value

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return convert(context, builder, signature.args[0], arguments[0])

    return type_of(group)(group), codegen


@intrinsic
def _compiled_pointers(typingcontext: Any, group: Any) -> Any:  # noqa: ARG001
    return _in_each_array(lambda array: array.data, _type_of_pointers, group)


def _interpreted_borrowed(group: Any) -> Any:
    return group


@intrinsic
def _compiled_borrowed(typingcontext: Any, group: Any) -> Any:  # noqa: ARG001
    def without_owner(array: Any) -> Any:
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()

    return _in_each_array(without_owner, lambda kind: kind, group)


@intrinsic
def _compiled_ints(typingcontext: Any, rows: Any) -> Any:  # noqa: ARG001
    if isinstance(rows, types.Array):  # in tests, which call kernels on arrays

        def view(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            as_view: Any = lambda rows: rows.view(np.int32)  # noqa: E731
            return context.compile_internal(builder, as_view, signature, arguments)

        return rows.copy(dtype=types.int32)(rows), view

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.int32)(rows), codegen


def rows_of(array: Any) -> Any:
    """Return the number of rows of an array; of one that is `ABSENT` nothing of any size."""
    return array.shape[0] if isinstance(array, np.ndarray) else ()


@overload(rows_of)
def _compiled_rows_of(array: Any) -> Callable[[Any], Any]:
    def of_array(array: Any) -> Any:
        return array.shape[0]

    def of_absent(array: Any) -> Any:  # noqa: ARG001 - numba's signature
        return ()

    return of_array if isinstance(array, types.Array) else of_absent


def _interpreted_prefetch(array: Any, index: int) -> None:
    pass


@intrinsic
def _compiled_prefetch(typingcontext: Any, array: Any, index: Any) -> Any:  # noqa: ARG001
    def codegen(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        byte, word = ir.IntType(8).as_pointer(), ir.IntType(32)
        takes = ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        insert: Any = cgutils.get_or_insert_function
        function = insert(builder.module, takes, "llvm.prefetch.p0")
        address = builder.bitcast(builder.gep(arguments[0], [arguments[1]]), byte)
        builder.call(function, [address, word(0), word(3), word(1)])  # to read, keep, data
        return context.get_dummy_value()

    return types.void(array, types.int64), codegen


_interpreted: bool = getattr(numba.config, "DISABLE_JIT", False)
pointer: Any = _interpreted_pointer if _interpreted else _compiled_pointer
"""A C-contiguous array as a flat typed pointer, valid while the caller holds the array.

Passing an array from kernel to kernel costs two atomic reference counts that numba does not prune:
25–40 % of the sweep. A pointer costs nothing.
"""

pointers: Any = _interpreted_pointers if _interpreted else _compiled_pointers
"""A named tuple with each array in it, at any depth, as a `pointer`; all else as it was."""

borrowed: Any = _interpreted_borrowed if _interpreted else _compiled_borrowed
"""An array, or a named tuple with arrays at any depth, whose references are not counted.

For an argument, which the caller holds as long as the call lasts; never to be returned. Each view
of an array costs two atomic counts, which were most of the time of isolines; one of these costs
nothing.
"""

as_ints: Any = _interpreted_ints if _interpreted else _compiled_ints
"""The memory of a pointer to float64 as int32, two for each; free of cost."""

prefetch: Any = _interpreted_prefetch if _interpreted else _compiled_prefetch
"""Prefetch the cache line at an index of a `pointer`, to be read soon; without effect otherwise."""
