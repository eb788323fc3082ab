"""Fields that have been solved, kept by what was asked for: the next question finds its answer."""

from collections import OrderedDict
from collections.abc import Callable, Hashable

import geodesic_core as gc


class Fields:
    """Fields of open meshes, at most ``capacity`` bytes; the least recently used go first.

    Solving again would give the same field to the bit, so that no answer tells whether its field
    was kept.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._fields: OrderedDict[tuple[Hashable, Hashable], gc.DistanceField] = OrderedDict()

    def find(
        self, mesh: Hashable, question: Hashable, solve: Callable[[], gc.DistanceField]
    ) -> gc.DistanceField:
        """Return the field that answers a question on a mesh, by its name: kept, or solved now."""
        name = mesh, question
        field = self._fields.get(name)
        if field is None:
            field = self._fields[name] = solve()
        self._fields.move_to_end(name)
        while self._fields and self.nbytes > self._capacity:
            self._fields.popitem(last=False)
        return field

    def forget(self, mesh: Hashable) -> None:
        """Drop the fields of a mesh, which hold on to it."""
        for name in [name for name in self._fields if name[0] == mesh]:
            del self._fields[name]

    @property
    def nbytes(self) -> int:
        """Memory of all of them, bytes."""
        return sum(field.nbytes for field in self._fields.values())
