"""Fields are kept between questions, and no answer tells whether its own was."""

from typing import Any

import numpy as np
import orjson
import pytest

import geodesic_core as gc
from app.encoding import Representation, encode
from app.queries import DistancesQuery, FieldCache, IsolinesQuery, PathsQuery
from app.store.meshes import OpenMesh
from tests.support.service import context, field_cache

APPROXIMATE = {"method": "approximate", "relative_error": 0.01}
FAST = {"method": "fast", "effort": 1}


@pytest.fixture
def opened() -> OpenMesh:
    return OpenMesh(("id", b""), gc.Solver(gc.samples.knot(2000)), [])


def ask(opened: OpenMesh, fields: FieldCache, kind: Any, **body: Any) -> bytes:
    query = kind("id", kind.normalized(kind.model(**body)))
    answer = query.answer(opened, context(fields=fields))
    return b"".join(encode(answer, Representation("application/json"))[0])


SOURCES = [{"vertex": 3}, {"face": 70, "barycentric": [0.2, 0.3, 0.5], "start_distance": 0.1}]
TARGETS = [{"vertex": vertex} for vertex in (5, 400, 901)]
OF_FIELDS: list[tuple[Any, dict[str, Any]]] = [
    (DistancesQuery, {"sources": SOURCES}),
    (DistancesQuery, {"sources": SOURCES, "include": ["gradient", "nearest_source"]}),
    (DistancesQuery, {"sources": SOURCES, "targets": [*TARGETS, SOURCES[1] | {"face": 9}]}),
    (PathsQuery, {"source": {"vertex": 3}, "targets": TARGETS}),
]
LINES = {"sources": SOURCES, "count": 3}


@pytest.mark.parametrize("accuracy", [{}, APPROXIMATE, FAST])
def test_paths_after_distances_need_no_sweep(
    opened: OpenMesh, sweeps: list[int], accuracy: dict[str, Any]
) -> None:
    fields = field_cache()
    source = {"vertex": 3}
    ask(opened, fields, DistancesQuery, sources=[source], **accuracy)
    assert len(sweeps) == 1

    found = ask(opened, fields, PathsQuery, source=source, targets=TARGETS, **accuracy)

    assert len(sweeps) == 1
    assert found == ask(
        opened, field_cache(1), PathsQuery, source=source, targets=TARGETS, **accuracy
    ), "the same as without"
    assert len(sweeps) == 2


@pytest.mark.parametrize(
    ("kind", "body", "accuracy"),
    [
        *(
            (kind, body, accuracy)
            for accuracy in ({}, APPROXIMATE, FAST)
            for kind, body in OF_FIELDS
        ),
        *((IsolinesQuery, LINES, accuracy) for accuracy in ({}, APPROXIMATE)),
    ],
)
def test_an_answer_is_the_same_of_a_field_that_was_kept(
    opened: OpenMesh, kind: Any, body: dict[str, Any], accuracy: dict[str, Any]
) -> None:
    body = orjson.loads(orjson.dumps(body))
    for target in body.get("targets", []):
        target.pop("start_distance", None)
    fields = field_cache()
    ask(opened, fields, DistancesQuery, sources=SOURCES, **accuracy)

    first, again = (ask(opened, fields, kind, **body, **accuracy) for _ in range(2))

    assert first == again == ask(opened, field_cache(1), kind, **body, **accuracy)


@pytest.mark.parametrize(("kind", "body"), [*OF_FIELDS[:2], OF_FIELDS[3]])
def test_what_is_answered_by_an_exact_sweep_has_one_field(
    opened: OpenMesh,
    sweeps: list[int],
    kind: Any,
    body: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(vars(opened.mesh), "is_rough", True)
    fields = field_cache()

    answers = [
        orjson.loads(ask(opened, fields, kind, **body, **accuracy))
        for accuracy in ({}, APPROXIMATE, {"method": "fast", "effort": 4})
    ]

    assert len(sweeps) == 1
    assert [answer.pop("method") for answer in answers] == ["exact", "approximate", "fast"]
    assert answers[0] == answers[1] == answers[2]


def test_what_is_asked_otherwise_is_another_field(opened: OpenMesh, sweeps: list[int]) -> None:
    fields = field_cache()
    different: list[dict[str, Any]] = [
        {"sources": [{"vertex": 3}]},
        {"sources": [{"vertex": 4}]},
        {"sources": [{"vertex": 3, "start_distance": 0.5}]},
        {"sources": [{"vertex": 3}, {"vertex": 4}]},
        {"sources": [{"vertex": 4}, {"vertex": 3}]},
        {"sources": [{"vertex": 3}], "max_distance": 1.0},
        {"sources": [{"vertex": 3}], **APPROXIMATE},
        {"sources": [{"vertex": 3}], **APPROXIMATE, "relative_error": 0.0015},
        {"sources": [{"vertex": 3}], **APPROXIMATE, "absolute_error": 0.02},
        *({"sources": [{"vertex": 3}], **FAST, "effort": effort} for effort in (1, 2)),
        {"sources": [{"polyline": [{"vertex": 3}]}]},
        {"sources": [{"vertex": 3}], "targets": [{"face": 5, "barycentric": [0.2, 0.3, 0.5]}]},
    ]
    answers = {ask(opened, fields, DistancesQuery, **body) for body in different}

    assert len(sweeps) == len(different)
    assert len(answers) == len(different)
    for body in different:
        ask(opened, fields, DistancesQuery, **body)
    assert len(sweeps) == len(different)


def test_spellings_of_one_point_are_one_field(opened: OpenMesh, sweeps: list[int]) -> None:
    fields = field_cache()
    mesh = opened.mesh
    face = int(np.flatnonzero((mesh.faces == 3).any(axis=1))[0])
    weights = (mesh.faces[face] == 3).astype(float).tolist()
    for point in (
        {"vertex": 3},
        {"face": face, "barycentric": weights},
        {"position": mesh.vertices[3].tolist()},
    ):
        ask(opened, fields, DistancesQuery, sources=[point])

    assert len(sweeps) == 1


def test_fields_go_when_there_is_no_more_room(opened: OpenMesh, sweeps: list[int]) -> None:
    one = gc.exact_distance(opened.mesh, 0).nbytes
    sweeps.clear()
    fields = field_cache(2 * one)
    for vertex in (0, 1, 0, 2, 0, 1):
        ask(opened, fields, DistancesQuery, sources=[{"vertex": vertex}])
        assert fields.nbytes <= 2 * one

    assert len(sweeps) == 4, "0, 1, 2 and again 1, which was used longest ago"


def test_the_size_of_a_field_is_that_of_its_arrays() -> None:
    mesh = gc.samples.knot(2000)
    plain = gc.exact_distance(mesh, 0)
    kept = gc.exact_distance(mesh, 0, retain="windows")

    assert plain.nbytes >= plain.distances.nbytes + plain.nearest_source.nbytes
    assert kept.nbytes >= plain.nbytes + 64 * kept.stats.windows_kept
    approximate = gc.approximate_distance(mesh, 0)
    before = approximate.nbytes
    approximate.path_to(500)
    assert approximate.nbytes > before


def test_questions_about_one_field_go_to_one_worker() -> None:
    def affinity_keys(kind: Any, **body: Any) -> Any:
        return kind("id", kind.normalized(kind.model(**body))).affinity_keys

    about = affinity_keys(DistancesQuery, sources=[{"vertex": 3}])
    assert about[1:] == ("id",)
    assert affinity_keys(PathsQuery, source={"vertex": 3}, targets=TARGETS) == about
    assert affinity_keys(IsolinesQuery, sources=[{"vertex": 3}], count=2) == about
    assert affinity_keys(DistancesQuery, sources=[{"vertex": 3}], targets=TARGETS) == about
    for other in ({"vertex": 4}, {"vertex": 3, "start_distance": 1.0}):
        assert affinity_keys(DistancesQuery, sources=[other])[0] != about[0]
    rough, fast, slower = (
        affinity_keys(DistancesQuery, sources=[{"vertex": 3}], **accuracy)[0]
        for accuracy in (APPROXIMATE, FAST, FAST | {"effort": 2})
    )
    assert len({about[0], rough, fast, slower}) == 4
    usual = affinity_keys(DistancesQuery, sources=[{"vertex": 3}], method="fast")[0]
    assert usual == slower
