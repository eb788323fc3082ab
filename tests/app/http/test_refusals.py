"""Refused bodies: however many elements are faulty, few are looked at."""

from typing import Any

import pytest
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, TypeAdapter, ValidationError, create_model

from app.http.routes.query_route import read
from app.queries import KINDS
from app.schemas.points import CurveSource, Polyline

MODELS = [query.model for query in KINDS.values()]
LISTS = [
    (model, name)
    for model in [*MODELS, CurveSource, Polyline]
    for name, schema in model.model_json_schema()["properties"].items()
    if any(each.get("type") == "array" for each in [schema, *schema.get("anyOf", ())])
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
    assert len(LISTS) == 19


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


def test_a_body_of_millions_is_refused_with_one_fault() -> None:
    model = create_model("Request", body=(KINDS["distances"].model, ...))
    with pytest.raises(RequestValidationError) as refused:
        read(model, {}, b'{"sources":[' + b"1," * 2_000_000 + b"1]}")
    assert [error["loc"] for error in refused.value.errors()] == [("body", "sources", 0)]
