"""Work in the background that is done again and again, whatever happens."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import NoReturn

import structlog

logger = structlog.get_logger(module=__name__)


async def repeat(do: Callable[[], Awaitable[object]], pause_s: float, failure: str) -> NoReturn:
    """Do something again and again, with a pause after each time; ``failure`` is logged."""
    while True:
        try:
            await do()
        except OSError as error:  # such as a full disk, or a database that is away
            logger.warning(failure, error=repr(error))
        except Exception:
            logger.exception(failure)
        await asyncio.sleep(pause_s)
