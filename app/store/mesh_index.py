"""The meshes of a store in the order of time, for lists of them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from app.store.mesh_home import MeshHome


class _Entry(NamedTuple):
    created: str
    """RFC 3339, in UTC: texts are in the order of time"""
    name: str | None


class MeshIndex:
    """When each mesh was stored, and its name: each manifest is read once for that."""

    def __init__(self, home: MeshHome) -> None:
        self._home = home
        self._entries: dict[str, _Entry] = {}

    async def page(
        self, limit: int, cursor: str, name: str | None
    ) -> tuple[Sequence[Mapping[str, Any]], str | None]:
        """Return the manifests of ``limit`` meshes, the newest first, and the next cursor, if any.

        Left out are meshes that are damaged, and with a ``name`` all others.
        """
        ids = set(await self._home.ids())
        self._note(await self._home.manifests(ids - self._entries.keys()))
        for gone in self._entries.keys() - ids:
            del self._entries[gone]
        places = sorted(
            (f"{entry.created} {mesh_id}", mesh_id)
            for mesh_id, entry in self._entries.items()
            if name is None or entry.name == name
        )
        left = [place for place in reversed(places) if not cursor or place[0] < cursor]
        found = await self._home.manifests([mesh_id for _, mesh_id in left[:limit]])
        self._note(found)  # one may have been removed and stored again
        return found, left[limit - 1][0] if len(left) > limit else None

    def _note(self, manifests: Sequence[Mapping[str, Any]]) -> None:
        for each in manifests:
            self._entries[each["id"]] = _Entry(each["created"], each.get("name"))
