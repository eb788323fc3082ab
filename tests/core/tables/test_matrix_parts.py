"""Parts of a matrix: together they are the file that `write_matrix` writes."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core.tables import matrix_parts, plan
from tests.core.fields.test_points import random_points
from tests.support import zoo
from tests.support.meshes import mesh_of

ROWS = 2


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have parts of few sweeps."""
    for module in (plan, matrix_parts):
        monkeypatch.setattr(module, "block_rows", lambda _width: ROWS)


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("is_symmetric", [True, False])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_parts_are_the_file_to_the_bit(is_symmetric: bool, dtype: str, tmp_path: Path) -> None:
    mesh = mesh_of(zoo.SMALL["two_components"])
    points = random_points(mesh, 8, seed=61)
    sources, targets = (points, points) if is_symmetric else (points[:5], points[5:])
    parts = gc.MatrixParts(mesh, sources, targets, dtype=dtype)
    found = [parts.compute(part) for part in range(parts.count)]
    file = BytesIO()
    parts.write(file, found.__getitem__)

    assert [part.size for part in found] == gc.MatrixParts.areas(
        len(sources), None if is_symmetric else len(targets)
    )
    assert len(found) > 1
    others = None if is_symmetric else targets
    gc.write_matrix(mesh, tmp_path / "whole.npy", sources, others, dtype=dtype)
    whole = np.load(tmp_path / "whole.npy")
    assert parts.shape == whole.shape
    np.testing.assert_array_equal(np.load(BytesIO(file.getvalue())), whole)
    reached = sum(parts.reached(part) for part in found)
    assert reached == np.isfinite(whole).sum() > 0
