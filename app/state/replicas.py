"""Replicas: the services that share a database, and which of them still live.

No clocks are compared. Each replica counts a number of its own up; one whose number stands still
while another counts on for a while is taken for dead, and its row removed. Where the database is
away, nobody counts on, and nobody is taken for dead.
"""

from uuid import uuid4

from app.state.database import Statements

BEAT_S = 1.0
"""Seconds between two beats of a replica"""

SILENT_BEATS = 6
"""Beats of a replica without one of another, after which that one is dead"""


class Replicas:
    """The replicas that share a database; this service is one, named ``id``."""

    def __init__(self, database: Statements) -> None:
        self.id = uuid4().hex
        self._database = database
        self._heard: dict[str, tuple[int, int]] = {}
        """The number of each other replica, and for how many beats of ours it stood still"""

    async def beat(self) -> frozenset[str]:
        """Say that this replica lives; return the ids of all that do."""
        if not await self._database.run(
            "UPDATE replicas SET beats = beats + 1 WHERE id = ?", self.id
        ):
            await self._database.run(
                "INSERT INTO replicas VALUES (?, 0) ON CONFLICT DO NOTHING", self.id
            )
        found = dict(await self._database.rows("SELECT id, beats FROM replicas"))
        heard = {}
        for other, beats in found.items():
            before, still = self._heard.get(other, (None, 0))
            heard[other] = (beats, still + 1 if beats == before else 0)
        dead = [other for other, (_, still) in heard.items() if still >= SILENT_BEATS]
        for other in dead:
            await self._database.run(
                "DELETE FROM replicas WHERE id = ? AND beats = ?", other, found[other]
            )
            del heard[other]
        if dead:
            await self._forget_work()
        self._heard = heard
        return frozenset(heard)

    async def leave(self) -> None:
        """Say that this replica is no more: others may take over what it left."""
        await self._database.run("DELETE FROM replicas WHERE id = ?", self.id)
        await self._forget_work()

    async def _forget_work(self) -> None:
        await self._database.run(
            "DELETE FROM running WHERE replica NOT IN (SELECT id FROM replicas)"
        )
