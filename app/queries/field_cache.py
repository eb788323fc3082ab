"""Solved fields, cached by question, so that the next query finds them."""

import hashlib
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import partial
from time import perf_counter

import geodesic_core as gc
from app.store.fields import FieldStore
from app.store.lru_cache import LRUCache
from app.store.meshes import OpenMesh

_WORTH_WRITING_S = 0.05
"""Seconds of a solve from which on its field is stored: writing takes about as long."""

Question = tuple[Hashable, ...]


@dataclass(frozen=True)
class Unwritten:
    """A field that is not in the store yet, and its name there."""

    mesh_id: str
    key: str
    field: gc.DistanceField


class FieldCache:
    """Fields of open meshes, at most ``capacity`` bytes; the least recently used go first.

    Other fields may be in the ``store``, written by any worker of the same ``code``. Solving again
    would give the same field to the bit, so that no answer depends on what was cached.
    """

    def __init__(self, capacity: int, store: FieldStore, code: str) -> None:
        self._fields: LRUCache[tuple[Hashable, Question], gc.DistanceField]
        self._fields = LRUCache(capacity, lambda field: field.nbytes)
        self._store = store
        self._code = code
        self._unwritten: list[Unwritten] = []

    def find(
        self, opened: OpenMesh, question: Question, solve: Callable[[], gc.DistanceField]
    ) -> gc.DistanceField:
        """Return the field that answers a question on a mesh: cached, stored, or solved now."""
        read_or_solve = partial(self._read_or_solve, opened, question, solve)
        field = self._fields.find((opened.name, question), read_or_solve)
        self._fields.evict()
        return field

    @property
    def evictions(self) -> int:
        """Fields dropped so far to make room for others."""
        return self._fields.evictions

    def take_unwritten(self) -> Sequence[Unwritten]:
        """Return the fields that took long to solve since the last call, to `write` or to drop."""
        taken, self._unwritten = self._unwritten, []
        return taken

    def write(self, fields: Sequence[Unwritten]) -> None:
        """Write fields into the store."""
        for new in fields:
            self._store.write(new.mesh_id, new.key, new.field.arrays(), self._code)

    def forget(self, mesh: Hashable) -> None:
        """Drop the fields of a mesh, which refer to it; they stay in the store."""
        for name in [name for name in self._fields if name[0] == mesh]:
            self._fields.drop(name)

    @property
    def nbytes(self) -> int:
        """Memory of all cached fields, bytes, each as it was when it was measured last."""
        return self._fields.nbytes

    def _read_or_solve(
        self, opened: OpenMesh, question: Question, solve: Callable[[], gc.DistanceField]
    ) -> gc.DistanceField:
        mesh_id, barriers = opened.name
        written = repr((self._code, barriers, question)).encode()
        key = hashlib.blake2b(written, digest_size=16).hexdigest()
        arrays = self._store.read(mesh_id, key)
        if arrays is not None:
            return gc.DistanceField.from_arrays(opened.mesh, arrays)
        start = perf_counter()
        field = solve()
        if perf_counter() - start > _WORTH_WRITING_S:
            self._unwritten.append(Unwritten(mesh_id, key, field))
        return field
