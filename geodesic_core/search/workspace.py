"""The memory of searches and sweeps over one mesh, which calls reuse one after the other."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from geodesic_core.control import SLICE_SECONDS, Control
from geodesic_core.errors import InvalidArgument
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.search.path_search import PathSearch
from geodesic_core.search.target_sweep import TargetSweep


class Workspace:
    """Scratch memory and landmarks of one mesh, made when they are first needed."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self._search: PathSearch | None = None
        self._sweep: TargetSweep | None = None
        self._lock = threading.Lock()
        self._holder: int | None = None
        """The thread whose call uses the memory"""

    @property
    def nbytes(self) -> int:
        """Memory held between calls, bytes, without the mesh."""
        return sum(part.nbytes for part in (self._search, self._sweep) if part is not None)

    def path_search(self) -> PathSearch:
        """Return the search between two points."""
        if self._search is None:
            self._search = PathSearch(self.mesh)
        return self._search

    def target_sweep(self) -> TargetSweep:
        """Return the sweep to some targets."""
        if self._sweep is None:
            self._sweep = TargetSweep(self.mesh)
        return self._sweep

    @contextmanager
    def held(self, control: Control) -> Iterator[None]:
        """Wait until no other call uses the memory, and keep others waiting until the block ends.

        Raises
        ------
        Cancelled, DeadlineExceeded
            As the control says, while the call waits.
        InvalidArgument
            A callback of the call that uses the memory asks for it again.
        """
        if self._holder == threading.get_ident():
            raise InvalidArgument(
                "a callback cannot use the Solver that is calling it; use another Solver of the "
                "mesh"
            )
        while not self._lock.acquire(timeout=SLICE_SECONDS):
            control.checkpoint(0.0)
        self._holder = threading.get_ident()
        try:
            yield
        finally:
            self._holder = None
            self._lock.release()
