"""Fields that have been solved, kept by what was asked for: the next question finds its answer."""

from collections.abc import Callable, Hashable

import geodesic_core as gc
from app.kept import Kept


class Fields:
    """Fields of open meshes, at most ``capacity`` bytes; the least recently used go first.

    Solving again would give the same field to the bit, so that no answer tells whether its field
    was kept.
    """

    def __init__(self, capacity: int) -> None:
        self._fields: Kept[tuple[Hashable, Hashable], gc.DistanceField]
        self._fields = Kept(capacity, lambda field: field.nbytes)

    def find(
        self, mesh: Hashable, question: Hashable, solve: Callable[[], gc.DistanceField]
    ) -> gc.DistanceField:
        """Return the field that answers a question on a mesh, by its name: kept, or solved now."""
        field = self._fields.find((mesh, question), solve)
        list(self._fields.surplus())
        return field

    def forget(self, mesh: Hashable) -> None:
        """Drop the fields of a mesh, which hold on to it."""
        for name in [name for name in self._fields if name[0] == mesh]:
            self._fields.drop(name)

    @property
    def nbytes(self) -> int:
        """Memory of all of them, bytes, each as it was when it was measured last."""
        return self._fields.nbytes
