"""Bodies of queries: large ones are read and checked in a thread, while the event loop goes on.

On the event loop 40 000 points would take a tenth of a second.
"""

import json
from collections.abc import Callable
from typing import Any, TypeVar

from anyio import to_thread
from fastapi import Request

from app.errors import problem

LARGE = 2**16
"""Bytes of a body from which on it is worth a thread: they take some milliseconds."""

T = TypeVar("T")


async def offload_if_large(request: Request, do: Callable[[], T]) -> T:
    """Do what takes the longer, the larger the body is: in a thread, where it is large.

    One at a time: several would take the interpreter from each other, and from the event loop.
    """
    if len(await request.body()) < LARGE:
        return do()
    return await to_thread.run_sync(do, limiter=request.app.state.large_bodies)


def parsed(body: bytes) -> Any:
    """Return what a body says in JSON, or refuse it."""
    try:
        return json.loads(body)
    except json.JSONDecodeError as error:
        detail = f"{error.msg} at character {error.pos}"
    except ValueError:
        detail = "it is no text in UTF-8, or has a number of thousands of digits"
    except RecursionError:
        detail = "it is nested too deeply"
    raise problem("malformed_body", f"the body is not JSON: {detail}")
