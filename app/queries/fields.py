"""Fields that have been solved, kept by what was asked for: the next question finds its answer."""

from collections import OrderedDict
from collections.abc import Callable, Hashable

import geodesic_core as gc

_Name = tuple[Hashable, Hashable]
"""Of a mesh, and of a question"""


class Fields:
    """Fields of open meshes, at most ``capacity`` bytes; the least recently used go first.

    Solving again would give the same field to the bit, so that no answer tells whether its field
    was kept.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._fields: OrderedDict[_Name, gc.DistanceField] = OrderedDict()
        self._sizes: dict[_Name, int] = {}
        self._total = 0

    def find(
        self, mesh: Hashable, question: Hashable, solve: Callable[[], gc.DistanceField]
    ) -> gc.DistanceField:
        """Return the field that answers a question on a mesh, by its name: kept, or solved now."""
        name = mesh, question
        field = self._fields.get(name)
        if field is None:
            field = self._fields[name] = solve()
        self._fields.move_to_end(name)
        self._measure(name)
        while self._total > self._capacity:
            self._drop(next(iter(self._fields)))
        return field

    def forget(self, mesh: Hashable) -> None:
        """Drop the fields of a mesh, which hold on to it."""
        for name in [name for name in self._fields if name[0] == mesh]:
            self._drop(name)

    @property
    def nbytes(self) -> int:
        """Memory of all of them, bytes, each as it was when it was asked for last."""
        return self._total

    def _measure(self, name: _Name) -> None:
        # Of the one field alone: there may be thousands of small ones.
        size = self._fields[name].nbytes
        self._total += size - self._sizes.get(name, 0)
        self._sizes[name] = size

    def _drop(self, name: _Name) -> None:
        del self._fields[name]
        self._total -= self._sizes.pop(name)
