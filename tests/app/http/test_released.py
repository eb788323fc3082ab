"""Changes of the interface document that would break clients."""

import copy
import json
from collections.abc import Callable
from typing import Any

import pytest

from tests.support.released import DOCUMENT, RELEASED, breaks, reduced

NOW = json.loads(DOCUMENT.read_bytes())


def test_clients_of_the_last_release_are_served() -> None:
    assert breaks(json.loads(RELEASED.read_bytes()), NOW) == []


def test_what_is_kept_of_a_release_is_all_that_counts() -> None:
    assert breaks(reduced(NOW), NOW) == breaks(NOW, reduced(NOW)) == []


def schema(document: Any, name: str) -> Any:
    return document["components"]["schemas"][name]


def operation(document: Any) -> Any:
    return document["paths"]["/v1/meshes/{mesh_id}/distances"]["post"]


def add_parameter(document: Any, *, required: bool) -> None:
    parameter = {"name": "x", "in": "query", "required": required, "schema": {"type": "string"}}
    operation(document)["parameters"].append(parameter)


BREAKING: list[Callable[[Any], Any]] = [
    lambda document: operation(document)["parameters"].pop(1),
    lambda document: add_parameter(document, required=True),
    lambda document: schema(document, "DistancesRequest")["properties"].pop("max_distance"),
    lambda document: schema(document, "DistancesRequest")["properties"]["method"]["enum"].pop(),
    lambda document: schema(document, "DistancesRequest")["required"].append("targets"),
    lambda document: schema(document, "DistancesAnswer")["required"].remove("distances"),
    lambda document: schema(document, "ErrorBound")["properties"]["value"].update(type="string"),
    lambda document: schema(document, "ErrorBound")["properties"]["kind"]["enum"].append("new"),
    lambda document: operation(document)["responses"]["200"]["content"].pop("text/csv"),
    lambda document: operation(document)["responses"].pop("202"),
    lambda document: document["paths"].pop("/v1/meshes"),
]
HARMLESS: list[Callable[[Any], Any]] = [
    lambda document: add_parameter(document, required=False),
    lambda document: schema(document, "DistancesRequest")["properties"]["method"]["enum"].append(
        "best"
    ),
    lambda document: schema(document, "DistancesAnswer")["properties"].update(more={}),
    lambda document: schema(document, "DistancesRequest").pop("description"),
]


@pytest.mark.parametrize("change", BREAKING)
def test_what_breaks_clients_is_found(change: Callable[[Any], Any]) -> None:
    assert faults_of(change)


@pytest.mark.parametrize("change", HARMLESS)
def test_what_harms_nobody_passes(change: Callable[[Any], Any]) -> None:
    assert not faults_of(change)


def faults_of(change: Callable[[Any], Any]) -> list[str]:
    document = copy.deepcopy(NOW)
    change(document)
    return breaks(NOW, document)
