"""Compile kernels into the wheel, for the levels of processors in ``GEODESIC_WHEEL_LEVELS``.

Without it the wheel is pure, and kernels are compiled when they are first needed. Levels are those
of ``geodesic_core.kernels.jit.machine``, separated by spaces.
"""

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLATFORM = "manylinux_2_17_x86_64"
"""Compiled kernels call only arithmetic of the C library, which is in each glibc of that age."""
LEVELS = os.environ.get("GEODESIC_WHEEL_LEVELS", "").split()
COMPILE = """
import sys
from geodesic_core.compilation import WORKLOADS, compile_kernels
from geodesic_core.kernels.jit import cache, machine
if machine.best_target() != sys.argv[1]:
    sys.exit(f"this machine cannot run kernels for {sys.argv[1]}, so it cannot compile them")
compile_kernels()
folder = cache.folder_for(sys.argv[1])
print(folder if all(cache.is_complete(name, [folder]) for name in WORKLOADS) else "")
"""


class KernelsHook(BuildHookInterface[Any]):
    """Puts compiled kernels into a wheel."""

    def dependencies(self) -> list[str]:
        """Return the requirements for compiling: what the library itself requires."""
        required: list[str] = self.metadata.core.dependencies
        return required if LEVELS else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile for each level, and tag the wheel for this Python and platform."""
        if version == "editable" or self.target_name != "wheel" or not LEVELS:
            return
        for level in LEVELS:
            folder = compiled(Path(self.root).parent, level)
            place = f"kernels/precompiled/{folder.parent.name}/{folder.name}"
            for path in sorted([*folder.glob("*.kernel"), *folder.glob("*.all")]):
                build_data["force_include"][str(path)] = f"{place}/{path.name}"
        python = f"cp{sys.version_info.major}{sys.version_info.minor}"
        build_data["pure_python"] = False
        build_data["tag"] = f"{python}-{python}-{PLATFORM}"


def compiled(root: Path, level: str) -> Path:
    """Compile all kernels for a level, unless the user's cache has them; return their folder.

    Where that cache has them for this very processor, or for a lower level, nothing is missing from
    it. They are then compiled in a folder of their own.
    """
    own = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, own, ignore_errors=True)  # once the wheel is written
    environment = os.environ | {"PYTHONPATH": str(root), "GEODESIC_CPU_LEVEL": level}
    command = [sys.executable, "-c", COMPILE, level]
    for place in ({}, {"NUMBA_CACHE_DIR": own}):
        done = subprocess.run(  # noqa: S603
            command, env=environment | place, stdout=subprocess.PIPE, text=True, check=True
        )
        if folder := done.stdout.strip():
            return Path(folder)
    raise RuntimeError(f"kernels for {level} are missing from {own}")
