"""Compile kernels into the wheel, for the levels of processors in ``GEODESIC_WHEEL_LEVELS``.

Without it the wheel is pure, and kernels are compiled when they are first needed. Levels are those
of ``geodesic_core.kernels.jit.machine``, separated by spaces.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLATFORM = "manylinux_2_17_x86_64"
"""Compiled kernels call only arithmetic of the C library, which is in each glibc of that age."""
LEVELS = os.environ.get("GEODESIC_WHEEL_LEVELS", "").split()
COMPILE = """
from geodesic_core import compile_kernels
from geodesic_core.kernels.jit import cache, machine
compile_kernels()
print(cache.folder_for(machine.best_target()))
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
    """Compile all kernels for a level, unless the user's cache has them; return their folder."""
    environment = os.environ | {"PYTHONPATH": str(root), "GEODESIC_CPU_LEVEL": level}
    command = [sys.executable, "-c", COMPILE]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)  # noqa: S603
    folder = Path(done.stdout.strip())
    if not folder.name.endswith(level):
        raise RuntimeError(
            f"this machine cannot run kernels for {level}, so it cannot compile them"
        )
    return folder
