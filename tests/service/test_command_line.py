"""The command line writes the documents that the service sends, to the byte."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import geodesic_core as gc
from app.encoding.ply_mesh import ply_of
from app.encoding.views import Surface
from tests.cli.conftest import run, sigint_as_in_a_terminal  # noqa: F401 - fixtures
from tests.support.commands import Run

FACE = {"face": 40, "barycentric": [0.2, 0.3, 0.5]}
CURVE = {"polyline": [{"vertex": 3}, {"vertex": 3}]}
APPROXIMATE = {"method": "approximate", "relative_error": 0.01}
FAST = {"method": "fast", "effort": 2}
AS_FAST = "--method fast --effort 2"
AS_APPROXIMATE = "--method approximate --relative-error 0.01"


@pytest.fixture
def knot_file(tmp_path: Path) -> Path:
    """A curved mesh, on which windows merge, with an isolated vertex, of which warnings tell."""
    sample = gc.samples.SAMPLES["knot"](3000)
    vertices, faces = sample.vertices, sample.faces
    lonely = np.vstack([vertices, [9.0, 9.0, 9.0]])
    path = tmp_path / "knot.ply"
    path.write_bytes(b"".join(ply_of(Surface(lonely, faces))))
    return path


@pytest.mark.parametrize(
    ("command", "operation", "body"),
    [
        (
            "distance --source 3 --source f40:0.2,0.3,0.5 --max-distance 4",
            "distances",
            {"sources": [{"vertex": 3}, FACE], "max_distance": 4, "include": ["nearest_source"]},
        ),
        (
            f"distance --source 3/3 --gradient --barriers 7,100-103 {AS_APPROXIMATE}",
            "distances",
            {
                "sources": [CURVE],
                "include": ["nearest_source", "gradient"],
                "barriers": [7, 100, 101, 102, 103],
                **APPROXIMATE,
            },
        ),
        (
            "path --source 3 --target f40:0.2,0.3,0.5 --via 700",
            "path",
            {"source": {"vertex": 3}, "target": FACE, "waypoints": [{"vertex": 700}]},
        ),
        (
            f"path --source 3 --target p1,2,0.5 {AS_APPROXIMATE}",
            "path",
            {"source": {"vertex": 3}, "target": {"position": [1, 2, 0.5]}, **APPROXIMATE},
        ),
        (
            "distance --source 3 --source f40:0.2,0.3,0.5 --max-distance 4 --method fast",
            "distances",
            {
                "sources": [{"vertex": 3}, FACE],
                "max_distance": 4,
                "include": ["nearest_source"],
                "method": "fast",
            },
        ),
        (
            f"path --source 3 --target p1,2,0.5 {AS_FAST}",
            "path",
            {"source": {"vertex": 3}, "target": {"position": [1, 2, 0.5]}, **FAST},
        ),
        (
            f"paths --source 3/3 --target 700 --target 20 --barriers 7,100-103 {AS_FAST}",
            "paths",
            {
                "source": CURVE,
                "targets": [{"vertex": 700}, {"vertex": 20}],
                "barriers": [7, 100, 101, 102, 103],
                **FAST,
            },
        ),
        (
            "paths --source 3 --target 700 --target 20 --max-distance 4",
            "paths",
            {
                "source": {"vertex": 3},
                "targets": [{"vertex": 700}, {"vertex": 20}],
                "max_distance": 4,
            },
        ),
        (
            "isolines --source 3 --level 0.5 --level 2.5 --chord-error 0.01",
            "isolines",
            {"sources": [{"vertex": 3}], "levels": [0.5, 2.5], "chord_error": 0.01},
        ),
        (
            f"isolines --source 3/3 --count 3 {AS_APPROXIMATE} --absolute-error 0.02",
            "isolines",
            {"sources": [CURVE], "count": 3, **APPROXIMATE, "absolute_error": 0.02},
        ),
        *(
            (
                f"matrix --source 3 --source 9 --target 700 --target 20 --layout {layout}",
                "matrix",
                {
                    "sources": [{"vertex": 3}, {"vertex": 9}],
                    "targets": [{"vertex": 700}, {"vertex": 20}],
                    "layout": layout,
                },
            )
            for layout in ("dense", "sparse", "pairs")
        ),
        (
            "nearest --source 3 --candidate 700 --candidate f40:0.2,0.3,0.5 -k 2 --max-distance 2",
            "nearest",
            {"source": {"vertex": 3}, "candidates": [{"vertex": 700}, FACE], "k": 2}
            | {"max_distance": 2},
        ),
        ("locate --at 1,2,0.5", "locate", {"points": [[1, 2, 0.5]]}),
    ],
)
def test_json_is_the_service_s(
    client: TestClient,
    run: Run,  # noqa: F811
    knot_file: Path,
    command: str,
    operation: str,
    body: dict[str, Any],
) -> None:
    report = client.post("/v1/meshes?format=ply", content=knot_file.read_bytes()).json()
    assert report["warnings"]

    name, *options = command.split()
    ran = run(name, knot_file, *options, "--out", "x.json")

    said = [line for line in ran.err.splitlines() if not line.startswith("Compiling kernels")]
    answer = client.post(f"/v1/meshes/{report['id']}/{operation}", json=body)
    assert answer.status_code == 200, answer.text
    assert (ran.code, said) == (0, [f"warning: {each}" for each in answer.json()["warnings"]])
    assert Path("x.json").read_bytes() == answer.content
