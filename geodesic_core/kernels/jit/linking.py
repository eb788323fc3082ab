"""Numba's compiler, with machine code for those kernels only that Python calls.

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
    """The code of a kernel that others call: they take it in, and it has no machine code."""

    def finalize(self) -> None:
        """Leave optimisation to the code that takes this part in."""
        self._raise_if_finalized()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:  # noqa: ARG002 - numba's signature
        """Return the null pointer: there is nothing to call."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> "Part":
        """What numba gives the environment to: this part, since it is not in memory yet."""
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Do nothing: a `Whole` sets the environments of all its parts."""


class Whole(JITCodeLibrary):
    """The code of a kernel with all its parts."""

    def finalize(self) -> None:
        """Take in all parts, optimise, and emit machine code."""
        self._linking_libraries = _with_parts(self)
        super().finalize()
        for variable in self._final_module.global_variables:
            if variable.name.startswith(_ENVIRONMENT):
                environment = lookup_environment(variable.name)
                if environment is not None:
                    self.codegen.set_env(variable.name, environment)


def _with_parts(library: Any) -> list[Any]:
    """Return the libraries that one needs, those of its parts among them, each once."""
    found: dict[Any, None] = {}
    waiting = [library]
    while waiting:
        for each in waiting.pop()._linking_libraries:
            if each not in found:
                found[each] = None
                if isinstance(each, Part):
                    waiting.append(each)
    return list(found)


class CompilerOfWholes(Compiler):
    """Compile a kernel for Python to call."""

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
        library = Whole(target.codegen(), "kernel")
        library.enable_object_caching()
        super().__init__(typing, target, library, arguments, returned, flags, local)


class CompilerOfParts(Compiler):
    """Compile a kernel for other kernels to call: without the entries from Python and C."""

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
        library = Part(target.codegen(), "part")
        flags = flags.copy()
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        super().__init__(typing, target, library, arguments, returned, flags, local)
