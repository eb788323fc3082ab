"""The time limit of a block, which ends it with the problem of a deadline."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from app.errors import problem
from app.settings import Settings


@asynccontextmanager
async def time_limit(
    settings: Settings, seconds: float, setting: str = "deadline_s"
) -> AsyncIterator[None]:
    """Stop the block after ``seconds``, whose upper bound is a setting.

    Raises ``ProblemError``, with the code ``deadline_exceeded``.
    """
    try:
        async with asyncio.timeout(seconds):
            yield
    except TimeoutError:
        is_ours = seconds >= getattr(settings, setting)
        detail = f"not finished within {seconds:g} s"
        raise problem(
            "deadline_exceeded",
            detail,
            limit=seconds,
            setting=setting if is_ours else None,
        ) from None
