"""Arenas of glibc, which the threads of the service share."""

import platform
import subprocess
import sys

import pytest

ALLOCATING = """
import ctypes, sys, threading
from app.service.resources import share_arenas

if sys.argv[1] == "shared":
    share_arenas()
together, kept = threading.Barrier(12), []

def allocate():
    together.wait()
    kept.append(bytearray(10_000))
    together.wait()

threads = [threading.Thread(target=allocate) for _ in range(12)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc = ctypes.CDLL(None)
libc.fdopen.restype = ctypes.c_void_p
stream = ctypes.c_void_p(libc.fdopen(1, b"w"))
libc.malloc_info(0, stream)
libc.fflush(stream)
"""


def arenas(how: str) -> int:
    command = [sys.executable, "-c", ALLOCATING, how]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - ours
    return ran.stdout.count("<heap nr=")


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other libraries have no arenas")
def test_threads_of_the_service_share_arenas() -> None:
    assert arenas("shared") <= 2 < arenas("apart")
