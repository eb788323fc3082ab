"""What can go wrong, as types.

Every refusal and every early stop of the library is one of these::

    GeodesicError
    ├── InvalidMesh             the vertices, the faces or the file cannot be used
    │   └── TooManyFaces        more than the caller allows
    ├── InvalidPoint            a source or target that is not on the mesh
    ├── InvalidArgument         any other argument out of its domain
    ├── NoPath                  not connected, or farther than a limit (``reason``)
    ├── Cancelled               the caller asked the sweep to stop
    ├── DeadlineExceeded        the time the caller granted is over
    ├── MemoryLimitExceeded     the memory the caller granted does not suffice
    ├── NotConverged            an approximate sweep went in circles
    └── InternalError           a broken invariant: a defect of this library, please report it
"""

from collections.abc import Sequence


class GeodesicError(Exception):
    """Base of all exceptions of this library."""


class InvalidMesh(GeodesicError):  # noqa: N818 - the contract's names read as the refusal itself
    """The mesh cannot be used.

    Parameters
    ----------
    message
        Which element is wrong, and what to do about it.
    elements
        Ids of (at most ten of) the elements at fault.
    kind
        What the ids count: ``"vertex"``, ``"face"``, ``"edge"`` (pairs of vertices) or ``"file"``.
    """

    def __init__(
        self, message: str, *, kind: str = "file", elements: Sequence[int | tuple[int, int]] = ()
    ) -> None:
        super().__init__(message)
        self.kind = kind
        self.elements = tuple(elements)


class TooManyFaces(InvalidMesh):
    """A file holds, or claims to hold, more than ``max_faces`` faces."""

    def __init__(self, faces: int, max_faces: int) -> None:
        super().__init__(f"{faces} faces, where at most {max_faces} are allowed", kind="face")
        self.faces = faces
        self.max_faces = max_faces


class InvalidPoint(GeodesicError):  # noqa: N818
    """A source or a target that is not a point of the mesh."""


class InvalidArgument(GeodesicError):  # noqa: N818
    """An argument outside its domain."""


class NoPath(GeodesicError):  # noqa: N818
    """No path joins the points: ``reason`` is ``"disconnected"`` or ``"beyond_max_distance"``."""

    def __init__(self, message: str, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


class Cancelled(GeodesicError):  # noqa: N818
    """The ``cancel`` callback of the caller said stop."""


class DeadlineExceeded(GeodesicError):  # noqa: N818
    """The sweep did not finish within ``deadline_s``."""


class MemoryLimitExceeded(GeodesicError):  # noqa: N818
    """The call needs more than ``memory_limit`` bytes: ``needed``, or more."""

    def __init__(self, needed: int, memory_limit: int) -> None:
        super().__init__(f"the call needs {needed} bytes or more; memory_limit is {memory_limit}")
        self.needed = needed
        self.memory_limit = memory_limit


class NotConverged(GeodesicError):  # noqa: N818
    """An approximate sweep propagated the windows of one edge too often, and was given up."""


class InternalError(GeodesicError):
    """An invariant of the algorithm does not hold: a defect of this library."""
