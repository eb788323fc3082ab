"""Meshes shared out among processes, in parcels."""

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

_LARGEST, _PARCELS = 16, 8
"""Meshes that a process is handed together, at most, and parcels for each process, at least. Handed
meshes of 2 ms one by one, processes wait for half of the time"""
_CHECK_PERIOD_S = 0.1
"""Seconds between two checks whether to stop"""


def answers_of(
    ask: Callable[[Path], T], meshes: Sequence[Path], processes: int, check: Callable[[], None]
) -> Iterator[tuple[Path, T | None]]:
    """Yield the answer for each mesh, as they come; None for a mesh at which its process died.

    The meshes of a parcel whose process dies are asked again, each by itself. ``check`` is called
    often, and raises what ends the work at once.
    """
    from pebble import ProcessExpired, ProcessPool

    # Started anew, as a fork of this process would copy locks of the kernels' threads.
    with ProcessPool(processes, initializer=_begin, context=get_context("spawn")) as pool:
        hand_over = partial(pool.schedule, _ask_each)
        try:
            waiting: dict[Future[list[T]], Sequence[Path]] = {
                hand_over(args=(ask, parcel)): parcel for parcel in _parcels_of(meshes, processes)
            }
            while waiting:
                check()
                for future in wait(waiting, _CHECK_PERIOD_S, FIRST_COMPLETED).done:
                    parcel = waiting.pop(future)
                    if not isinstance(future.exception(), ProcessExpired):
                        yield from zip(parcel, future.result(), strict=True)
                    elif len(parcel) == 1:
                        yield parcel[0], None
                    else:
                        waiting |= {hand_over(args=(ask, [mesh])): [mesh] for mesh in parcel}
        except BaseException:
            pool.stop()  # type: ignore[no-untyped-call]  # nobody waits for the other answers
            raise


def _parcels_of(meshes: Sequence[Path], processes: int) -> Iterator[Sequence[Path]]:
    size = min(_LARGEST, max(1, len(meshes) // (_PARCELS * processes)))
    return (meshes[start : start + size] for start in range(0, len(meshes), size))


def _ask_each(ask: Callable[[Path], T], meshes: Sequence[Path]) -> list[T]:
    """Return the answer for each mesh of a parcel."""
    return [ask(mesh) for mesh in meshes]


def _begin() -> None:
    """Load the kernels in a new process; Ctrl-C is for the command, which ends its processes."""
    from geodesic_core import warm_up

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warm_up(["exact", "paths"])
