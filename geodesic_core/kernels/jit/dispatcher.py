"""The decorators of kernels, and what happens when one is called for the first time.

With ``NUMBA_DISABLE_JIT=1`` the same sources run as plain Python, so that coverage and numpy's
bounds checks see them.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numba
from numba.core.compiler import Compiler
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import _FunctionCompiler  # type: ignore[attr-defined]
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature

from geodesic_core.kernels.jit import cache, progress
from geodesic_core.kernels.jit.linking import Part, PartCompiler, WholeCompiler

types: Any = numba.types
Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {
    "nopython": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": False,
}

compiled_here: list[str] = []
"""Files of the kernels that this process compiled, in order."""


class _KernelCompiler(_FunctionCompiler):  # type: ignore[misc]
    """Compiler of one kernel: loads what is on disk, and compiles other kernels inside as parts."""

    under_way = False
    """Whether a kernel is being compiled: those it calls are its parts. Guarded by numba's lock."""

    def compile(self, args: Any, return_type: Any) -> Any:
        """Return the compiled kernel for some types of arguments."""
        self.pipeline_class: type[Compiler] = WholeCompiler
        if _KernelCompiler.under_way:
            self.pipeline_class = PartCompiler
            return super().compile(args, return_type)
        stored = cache.StoredKernel.of(self.py_func, args)
        compiled = self._load(stored)
        if compiled is None:
            with progress.shown(cache.folder()), stored.lock():
                compiled = self._load(stored)  # by the process that held the lock
                if compiled is None:
                    with self._compiling_parts():
                        compiled = super().compile(args, return_type)
                    compiled_here.append(stored.file_name)
                    stored.save(compiled)
        return compiled

    def _customize_flags(self, flags: Any) -> Any:
        if self.pipeline_class is PartCompiler:
            flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True  # no entries from Python and C
        return flags

    def _load(self, stored: cache.StoredKernel) -> Any:
        context = self.targetdescr.target_context
        found = stored.load(context)
        if found is not None:
            context.insert_user_function(found.entry_point, found.fndesc, [found.library])
        return found

    @contextmanager
    def _compiling_parts(self) -> Iterator[None]:
        """Compile called kernels as parts, without garbage collection, which takes a fifth."""
        collects = gc.isenabled()
        gc.disable()
        _KernelCompiler.under_way = True
        try:
            yield
        finally:
            _KernelCompiler.under_way = False
            if collects:
                gc.enable()


class _Kernel(CPUDispatcher):
    """A kernel: a numba dispatcher, with one compiled version for each list of argument types."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, targetoptions=options)
        self._compiler = _KernelCompiler(function, self.targetdescr, options, {}, WholeCompiler)

    def compile(self, sig: Any) -> Any:
        """Compile for some types of arguments, even if it is compiled as a part already."""
        with global_compiler_lock:
            arguments, _ = normalize_signature(sig)
            known = self.overloads.get(tuple(arguments))
            if known and isinstance(known.library, Part) and not _KernelCompiler.under_way:
                del self.overloads[tuple(arguments)]
            return super().compile(sig)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compile for a call by another kernel: one version for integers of any width."""
        return super().get_call_template([_widened(kind) for kind in args], kws)

    def add_overload(self, cres: Any) -> None:
        """Add a compiled version; parts are hidden from calls by Python."""
        if isinstance(cres.library, Part):
            self.overloads[tuple(cres.signature.args)] = cres
        else:
            super().add_overload(cres)


def _widened(kind: Any) -> Any:
    kind, widest = types.unliteral(kind), types.int64
    is_narrow = isinstance(kind, types.Integer) and kind.bitwidth < widest.bitwidth
    return widest if is_narrow else kind


def _compiled(function: Function, **options: Any) -> Function:
    config: Any = numba.config
    if config.DISABLE_JIT:
        return function
    kernel: Any = _Kernel(function, _OPTIONS | options)
    return kernel


def kernel(function: Function) -> Function:
    """Compile a kernel: cached on disk, without the GIL, IEEE arithmetic."""
    return _compiled(function)


def inlined(function: Function) -> Function:
    """Compile a kernel that is pasted into its callers: for code per window, or of one caller.

    LLVM leaves functions of ten arguments as calls by itself, which costs a quarter of the sweep.
    """
    return _compiled(function, forceinline=True)
