"""The scrub: every file of a store is verified again and again, slowly, in the background.

Disks lose bits in silence. The scrub finds that before a client does, while the mesh may still be
at hand elsewhere. It also removes what killed workers have left.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from time import perf_counter

import structlog
from anyio import to_thread

from app.repeating import repeat
from app.service.maintenance import Damage, inspect
from app.store.atomic import remove_abandoned
from app.store.layout import FIELDS, RESULTS

logger = structlog.get_logger(module=__name__)

_DELAY_S = 60.0
"""Seconds before the first round, since a start has other work to do"""
_PERIOD_S = 86_400.0
"""Seconds between the end of a round and the next one"""
_REST = 20.0
"""Pause after a file, as a multiple of the time that it took"""
_SHORTEST_REST_S = 0.1

OnDamage = Callable[[Damage], Awaitable[None]]


@asynccontextmanager
async def scrubbing(root: Path, on_damage: OnDamage) -> AsyncIterator[None]:
    """Scrub the store ``root`` while the block runs; report each damage to ``on_damage``."""
    scrub = asyncio.create_task(_scrub(root, on_damage))
    try:
        yield
    finally:
        scrub.cancel()
        await asyncio.wait({scrub})


async def _scrub(root: Path, on_damage: OnDamage) -> None:
    await asyncio.sleep(_DELAY_S)
    round_ = partial(_scrub_once, root, on_damage)
    await repeat(round_, _PERIOD_S, "store not verified to its end")


async def _scrub_once(root: Path, on_damage: OnDamage) -> None:
    for folder in (root / RESULTS, root / FIELDS):
        await to_thread.run_sync(remove_abandoned, folder)
    files = inspect(root)
    while True:
        start = perf_counter()
        is_last, damage = await to_thread.run_sync(_next, files)
        if is_last:
            return
        rest = _REST * (perf_counter() - start)
        if damage is not None:
            logger.error("store damaged", detail=damage.detail)
            await on_damage(damage)
        await asyncio.sleep(max(_SHORTEST_REST_S, rest))


def _next(files: Iterator[Damage | None]) -> tuple[bool, Damage | None]:
    """Verify the next file; tell whether there was none any more, and its damage."""
    for damage in files:
        return False, damage
    return True, None
