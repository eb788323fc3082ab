"""The machine that kernels are compiled for: a level of x86-64, or this very processor."""

import hashlib
import os
import sys
from typing import Any

import numba
from llvmlite import binding

from geodesic_core.errors import InvalidArgument

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

    ``GEODESIC_CPU_LEVEL`` limits them to one and those below it, or to ``none``.
    """
    found: dict[str, bool] = binding.get_host_cpu_features()
    highest = os.environ.get("GEODESIC_CPU_LEVEL") or next(iter(LEVELS))
    names = [*LEVELS, "none"]
    if highest not in names:
        raise InvalidArgument(f"GEODESIC_CPU_LEVEL is {highest}, not one of {', '.join(names)}")
    allowed = names[names.index(highest) : -1]
    return [name for name in allowed if all(found.get(each) for each in LEVELS[name])]


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


def best_target() -> str:
    """Return the machine to compile for ahead of use: the best level, which similar ones share."""
    config: Any = numba.config
    chosen = config.CPU_NAME is not None
    return target() if chosen or not levels() else levels()[0]


def tag(machine: str) -> str:
    """Return the folder of kernels for a machine and this version of Python."""
    return f"cp{sys.version_info.major}{sys.version_info.minor}-{machine}"
