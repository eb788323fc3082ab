"""A thread for long work, at a low priority."""

import os
from concurrent.futures import ThreadPoolExecutor

_LONG_WORK_NICENESS = 10
"""Niceness of long work: small work and the API process go first"""


def low_priority_thread() -> ThreadPoolExecutor:
    """Start a thread that yields to others when all cores are busy.

    On Linux each thread has a niceness of its own, which cannot be lowered again. So a worker that
    raised its own would keep it for small work as well.
    """
    thread = ThreadPoolExecutor(1)
    thread.submit(os.nice, _LONG_WORK_NICENESS).result()
    return thread
