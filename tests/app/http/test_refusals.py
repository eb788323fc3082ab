"""Refused bodies: however many elements are faulty, few are looked at."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import anyio
import pytest
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, TypeAdapter, ValidationError, create_model

from app.errors import ProblemError
from app.http import large_bodies
from app.http.routes import query_route
from app.http.routes.query_route import read
from app.queries import KINDS
from app.schemas.points import Curve, CurveSource
from app.settings import Settings

MODELS = [query.model for query in KINDS.values()]
LISTS = [
    (model, name)
    for model in [*MODELS, CurveSource, Curve]
    for name, schema in model.model_json_schema()["properties"].items()
    if any(
        each.get("type") == "array"
        for each in [schema, *schema.get("anyOf", ()), *schema.get("oneOf", ())]
    )
]
FAULTY = [1, None, "", [], {"vertex": "0"}, {"vertex": 0, "t": 1}, {"face": 0}]
MANY = 50_000


def errors_of(model: type[BaseModel], body: dict[str, Any]) -> list[Any]:
    try:
        TypeAdapter(model).validate_python(body)
    except ValidationError as error:
        return error.errors()
    return []


def test_all_lists_of_all_queries_are_tested() -> None:
    assert len(LISTS) == 47


@pytest.mark.parametrize(("model", "name"), LISTS)
def test_of_many_faulty_items_the_first_is_reported(model: type[BaseModel], name: str) -> None:
    faulty = [
        item
        for item in FAULTY
        if any(name in each["loc"] for each in errors_of(model, {name: [item]}))
    ]
    assert faulty
    for item in faulty:
        one, many = (
            [each for each in errors_of(model, {name: [item] * count}) if each["loc"][0] == name]
            for count in (1, MANY)
        )
        assert [each["msg"] for each in many] == [each["msg"] for each in one]


@pytest.mark.parametrize("model", MODELS)
def test_many_unknown_members_are_one_error(model: type[BaseModel]) -> None:
    unknown = {f"m{i}": 0 for i in range(MANY)}
    (error,) = errors_of(model, unknown)
    assert error["msg"] == f"A query has at most 20 members, but this one has {MANY}"


@pytest.mark.parametrize("model", MODELS)
def test_many_unknown_members_of_a_point_are_one_error(model: type[BaseModel]) -> None:
    point = {"vertex": 0} | {f"m{i}": 0 for i in range(MANY)}
    for name in ("source", "sources", "targets", "candidates", "waypoints"):
        if name in model.model_fields:
            value = point if name == "source" else [point]
            (error,) = [each for each in errors_of(model, {name: value}) if each["loc"][0] == name]
            assert error["msg"].startswith("A point has vertex, edge and t, ")


SETTINGS = Settings()
MOST_VALUES = SETTINGS.max_query_bytes // 7
DISTANCES: Any = create_model("Request", body=(KINDS["distances"].model, ...))


def with_sources(count: int) -> bytes:
    return b'{"sources":[' + b"1," * (count - 1) + b"1]}"


@pytest.mark.slow
def test_a_body_of_half_a_million_values_is_refused_with_one_fault() -> None:
    with pytest.raises(RequestValidationError) as refused:
        read(DISTANCES, {}, with_sources(MOST_VALUES).replace(b"sources", b"targets"), SETTINGS)
    assert [error["loc"] for error in refused.value.errors()] == [("body", "sources")]


@pytest.mark.parametrize(
    ("kind", "name", "setting"),
    [
        ("distances", "sources", "max_sources"),
        ("isolines", "sources", "max_sources"),
        ("isolines", "levels", "max_levels"),
        ("path", "waypoints", "max_waypoints"),
    ],
)
def test_the_length_of_a_list_is_checked_before_its_elements(
    kind: str, name: str, setting: str
) -> None:
    limit = getattr(SETTINGS, setting)
    body = f'{{"{name}":[{",".join(["null"] * (limit + 1))}]}}'.encode()
    model: Any = create_model("Request", body=(KINDS[kind].model, ...))
    with pytest.raises(ProblemError) as refused:
        read(model, {}, body, SETTINGS)
    problem = refused.value.problem
    assert (problem.code, problem.actual, problem.limit) == ("limit_exceeded", limit + 1, limit)


@pytest.mark.parametrize("count", [MOST_VALUES + 1, 2_000_000])
def test_a_body_of_more_values_is_not_parsed(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(query_route, "from_json", None)
    with pytest.raises(ProblemError) as refused:
        read(DISTANCES, {}, with_sources(count), SETTINGS)
    problem = refused.value.problem
    assert (problem.code, problem.actual, problem.limit) == ("limit_exceeded", count, MOST_VALUES)
    assert problem.setting == "max_query_bytes"


@pytest.mark.parametrize("most_bytes", [1_000, 2**16, 2**18])
def test_a_body_of_64_kib_may_hold_any_number_of_values(most_bytes: int) -> None:
    settings = Settings(max_query_bytes=most_bytes)
    body = b"[" + b"1," * (2**15 - 2) + b"1]"
    assert len(query_route.parse_json(body, settings)) == 2**15 - 1


@pytest.mark.parametrize("fails", [False, True])
def test_reading_a_large_body_rests_as_long_as_it_held_the_interpreter(
    monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    """So its caller's next one waits, and others get half of the interpreter."""
    clock, rests = iter([1.0, 3.5]), []
    loop = SimpleNamespace(call_later=lambda seconds, end, line: rests.append((seconds, end, line)))
    monkeypatch.setattr(large_bodies, "thread_time", lambda: next(clock))
    monkeypatch.setattr(large_bodies, "get_running_loop", lambda: loop)
    queue = large_bodies._Queue()

    async def check() -> int:
        return await large_bodies.LargeBodies()._in_thread(queue, lambda: 1 // (not fails))

    with pytest.raises(ZeroDivisionError) if fails else nullcontext():
        assert anyio.run(check) == 1
    ((seconds, end, resting),) = rests
    assert (seconds, resting, queue.turn.locked()) == (2.5, queue, True)
    end(resting)
    assert not queue.turn.locked()
