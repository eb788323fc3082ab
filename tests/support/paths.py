"""Where the checkout is, and where real meshes are looked for."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

MESHES = Path(os.environ.get("MESHES", ROOT / "../shared/meshes"))
"""A folder of other people's meshes, not part of the project: ``MESHES`` names another."""


def real_mesh(name: str) -> Path:
    """The path of a real mesh; skips the test where it is absent."""
    path = MESHES / name
    if not path.exists():
        pytest.skip(f"{name} is not in {MESHES}: set MESHES to a folder that has it")
    return path
