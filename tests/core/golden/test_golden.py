"""Golden cases: data files with the error they allow, also turned, shifted and scaled."""

import json
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from tests.support import zoo

FILES = sorted(Path(__file__).parent.glob("*.json"))


def test_there_are_golden_cases():
    assert len(FILES) >= 8


@pytest.mark.parametrize("scale", [1, 1e9, 1e-9])
@pytest.mark.parametrize("turned", [False, True], ids=["as given", "turned"])
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_golden_distances(file, turned, scale):
    case = json.loads(file.read_text(encoding="utf-8"))
    vertices = np.array(case["vertices"])
    error = case["relative_error"]
    if turned:
        vertices = vertices @ zoo.rotation(5).T + (0.5, -1, 2)
        error = max(error, 1e-10)  # the motion rounds the coordinates
    mesh = gc.TriangleMesh(vertices * scale, case["faces"])
    found = gc.exact_distance(mesh, case["source"]).distances
    for vertex, distance in case["distances"].items():
        assert found[int(vertex)] == pytest.approx(distance * scale, rel=error, abs=0), vertex
