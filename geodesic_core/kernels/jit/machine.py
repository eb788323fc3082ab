"""The machine that kernels are compiled for: a level of x86-64, or this very processor."""

import hashlib
import os
import sys
from typing import Any

import numba
from llvmlite import binding

LEVELS = {
    "x86-64-v3": (
        *("cx16", "popcnt", "sse3", "ssse3", "sse4.1", "sse4.2"),
        *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"),
    ),
    "x86-64-v2": ("cx16", "popcnt", "sse3", "ssse3", "sse4.1", "sse4.2"),
}
"""Levels of the x86-64 psABI, best first, and the features that LLVM must find for each.

Kernels for v3 are as fast as those for the processor itself; for v2 they take a tenth longer.
"""


def levels() -> list[str]:
    """Return the levels that this processor has, best first.

    ``GEODESIC_CPU_LEVEL`` names a lower one, to act as a machine of that level, or ``none``.
    """
    found: dict[str, bool] = binding.get_host_cpu_features()
    names = [name for name, needed in LEVELS.items() if all(found.get(each) for each in needed)]
    highest = os.environ.get("GEODESIC_CPU_LEVEL")
    if highest:
        names = names[names.index(highest) :] if highest in names else []
    return names


def target() -> str:
    """Return the machine for which this process compiles: a level, or this very processor."""
    config: Any = numba.config
    if config.CPU_NAME in LEVELS and config.CPU_FEATURES == "":
        return str(config.CPU_NAME)
    name = config.CPU_NAME or binding.get_host_cpu_name()
    features = config.CPU_FEATURES
    if features is None:
        features = binding.get_host_cpu_features().flatten()
    return f"{name}-{hashlib.sha256(features.encode()).hexdigest()[:8]}"


def shared_target() -> str:
    """Return the machine to compile for ahead: the best level, which its likes share."""
    config: Any = numba.config
    chosen = config.CPU_NAME is not None
    return target() if chosen or not levels() else levels()[0]


def tag(machine: str) -> str:
    """Return the folder of kernels for a machine and this version of Python."""
    return f"cp{sys.version_info.major}{sys.version_info.minor}-{machine}"
