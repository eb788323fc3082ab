"""Numba's compiler, emitting machine code only for kernels that Python calls.

Numba optimises every function together with all that it calls, and emits machine code for it. In a
chain of small kernels the innermost is optimised once for each kernel above it. Here the kernels
inside another one are `Part`s of it: translated one by one, then optimised and emitted together.
"""

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.environment import lookup_environment

_ENVIRONMENT = "_ZN08NumbaEnv"
"""Beginning of the names under which numba keeps a function's Python globals."""


class Part(JITCodeLibrary):
    """The code of a kernel that is linked into others, without machine code of its own."""

    def finalize(self) -> None:
        """Leave optimisation to the whole that links this part."""
        self._raise_if_finalized()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:  # noqa: ARG002 - numba's signature
        """Return the null pointer: there is nothing to call."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> "Part":
        """Return an object with the one method of it that numba calls: `set_env`."""
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Do nothing: a `Whole` sets the environments of all its parts."""


class Whole(JITCodeLibrary):
    """The code of a kernel with all its parts."""

    def finalize(self) -> None:
        """Link all parts, optimise, and emit machine code."""
        self._linking_libraries = _with_parts(self)
        super().finalize()
        for variable in self._final_module.global_variables:
            if variable.name.startswith(_ENVIRONMENT):
                environment = lookup_environment(variable.name)
                if environment is not None:
                    self.codegen.set_env(variable.name, environment)


def _with_parts(library: Any) -> list[Any]:
    """Return the libraries that one links, and those of its parts, each once."""
    found: dict[Any, None] = {}
    waiting = [library]
    while waiting:
        for each in waiting.pop()._linking_libraries:
            if each not in found:
                found[each] = None
                if isinstance(each, Part):
                    waiting.append(each)
    return list(found)


class WholeCompiler(Compiler):
    """Compiler of a kernel that Python calls."""

    library_class: type[JITCodeLibrary] = Whole

    def __init__(
        self,
        typing: Any,
        target: Any,
        _: None,
        arguments: Any,
        returned: Any,
        flags: Any,
        local: Any,
    ) -> None:
        library = self.library_class(target.codegen(), "kernel")
        library.enable_object_caching()
        super().__init__(typing, target, library, arguments, returned, flags, local)


class PartCompiler(WholeCompiler):
    """Compiler of a kernel that other kernels call."""

    library_class = Part
