"""The interface to where the meshes of a service are."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from app.store.meshes import WrittenMesh


class MeshRecord(NamedTuple):
    """A mesh in the catalog."""

    size: int
    """Bytes of its files"""
    owner: str | None
    is_pinned: bool = False
    """Whether a service that shares the table needs it at the moment"""


class MeshHome(Protocol):
    """Where the meshes of a service are: a folder, or objects that several machines reach.

    A change of what is here is made by one catalog at a time.
    """

    trusted_s: float
    """Seconds for which another machine may take a mesh for present after its removal"""

    def found(self) -> Mapping[str, MeshRecord]:
        """Return what is here, the least recently used first."""

    async def record(self, mesh_id: str) -> MeshRecord | None:
        """Return the record of a mesh; None where it is not here."""

    async def manifest(self, mesh_id: str) -> Mapping[str, Any]:
        """Return the manifest of a mesh; raises ``ProblemError`` where there is none."""

    async def ids(self) -> Collection[str]:
        """Return the ids of all meshes."""

    async def manifests(self, ids: Iterable[str]) -> Sequence[Mapping[str, Any]]:
        """Return the manifests of meshes, in their order, without those that cannot be read."""

    async def array_file(self, mesh_id: str, name: str) -> Path:
        """Return the file of an array that clients may read, after verifying it."""

    async def is_intact(self, mesh_id: str) -> bool:
        """Read the files of a mesh; tell whether it is here and all are as written."""

    async def settle(self, written: WrittenMesh) -> None:
        """Make sure that the files of a new mesh survive a power cut, before it is put here."""

    async def put(self, written: WrittenMesh, *, is_new: bool) -> None:
        """Put a mesh here, or replace the files of one that is damaged."""

    async def discard(self, written: WrittenMesh) -> None:
        """Remove the files of a mesh that is not to be put here."""

    async def remove(self, mesh_id: str) -> None:
        """Remove a mesh, if it is here; who has it open can go on reading it."""

    async def distrust(self, mesh_id: str) -> None:
        """Have the files of a mesh verified, or pulled, again before they are used."""

    def note_use(self, mesh_id: str) -> None:
        """Record a use of a mesh, as far as the next start is to know it."""
