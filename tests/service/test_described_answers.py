"""Answers against the models of the interface document."""

from typing import Any

import pytest
from pydantic import BaseModel
from starlette.testclient import TestClient

from app.schemas import answers

ENDS = [{"vertex": 0}, {"vertex": 4}]
ASKED = [
    ("distances", {"sources": ENDS, "targets": ENDS, "include": ["nearest_source"]}),
    ("distances", {"sources": ENDS, "include": ["gradient"], "barriers": [1]}),
    ("distances", {"sources": [ENDS[1], {"polyline": [{"vertex": 0}, {"vertex": 1}]}]}),
    ("isolines", {"sources": ENDS, "levels": [0.5, 9.0]}),
    ("paths", {"source": {"polyline": [{"vertex": 0}, {"vertex": 1}]}, "targets": ENDS}),
    ("path", {"source": ENDS[0], "target": ENDS[1]}),
    ("path/steps", {"source": ENDS[0], "target": {"vertex": 1}}),
    ("path/steps", {"source": ENDS[0], "target": ENDS[1]}),
    ("paths", {"source": ENDS[0], "targets": [*ENDS, {"vertex": 1}]}),
    *(
        ("matrix", {"sources": ENDS, "targets": ENDS, "layout": layout})
        for layout in ("dense", "sparse", "pairs")
    ),
    ("nearest", {"source": ENDS[0], "candidates": ENDS, "k": 2}),
    ("locate", {"points": [[0, 0, 1]]}),
]


@pytest.mark.parametrize(("operation", "body"), ASKED)
def test_answers_are_what_is_described(
    client: TestClient, apart: str, operation: str, body: dict[str, Any]
) -> None:
    link = f"/v1/meshes/{apart}/{operation}"
    path = client.get("/openapi.json").json()["paths"][f"/v1/meshes/{{mesh_id}}/{operation}"]
    described = path["post"]["responses"]["200"]["content"]["application/json"]["schema"]
    model: type[BaseModel] = getattr(answers, described["$ref"].rpartition("/")[2])

    answer = client.post(link, json=body).json()

    assert set(answer) <= set(model.model_fields)
    assert model.model_validate(answer).model_dump(mode="json", exclude_unset=True) == answer
