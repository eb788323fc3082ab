"""Promises of the interface document: ``python -m tests.support.promises`` prints them.

The promises of the last release are in ``openapi/promises.json``. A change that keeps them breaks
no client. They are renewed with each release, and where a promise is broken on purpose.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from tests.support.paths import ROOT

DOCUMENT = ROOT / "openapi" / "openapi.json"
PROMISES = ROOT / "openapi" / "promises.json"


class Promise(NamedTuple):
    """What an operation takes, needs and gives, as lines."""

    takes: list[str]
    """Parameters and members that are understood, with their types: none of them may go"""
    needs: list[str]
    """Those among them that must be given: none may be added"""
    gives: list[str]
    """Members that every answer has, with their types: none may go, nor become another"""


def promises_of(document: Mapping[str, Any]) -> dict[str, Promise]:
    """Return the promises of each operation, by its id, method and path."""
    return {
        f"{operation['operationId']} {method.upper()} {path}": _promise(operation, document)
        for path, item in document["paths"].items()
        for method, operation in item.items()
    }


def broken(old: Promise, new: Promise) -> list[str]:
    """Return the lines in which ``new`` does not keep ``old``."""
    known = {_place(line) for line in old.gives}
    other = [line for line in new.gives if _place(line) in known and line not in old.gives]
    return [
        *(f"no longer takes {line}" for line in old.takes if line not in new.takes),
        *(f"now needs {line}" for line in new.needs if line not in old.needs),
        *(f"no longer gives {line}" for line in old.gives if line not in new.gives),
        *(f"gives something else: {line}" for line in other),
    ]


def _place(line: str) -> str:
    return line.partition(": ")[0]


def _promise(operation: Mapping[str, Any], document: Mapping[str, Any]) -> Promise:
    takes, needs, gives = set[str](), set[str](), set[str]()
    for parameter in operation.get("parameters", ()):
        place = f"{parameter['in']} {parameter['name']}"
        takes |= set(_members(parameter["schema"], place, document))
        if parameter["required"]:
            needs.add(place)
    for media_type, content in operation.get("requestBody", {}).get("content", {}).items():
        place = f"body {media_type} "
        takes |= set(_members(content["schema"], place, document))
        needs |= set(_members(content["schema"], place, document, only_required=True))
    for status in sorted({"200", "201", "202", "204"} & operation["responses"].keys()):
        response = operation["responses"][status]
        for media_type, content in response.get("content", {}).items():
            schema = content.get("schema", {})
            place = f"{status} {media_type} "
            gives |= set(_members(schema, place, document, only_required=True))
    without_types = {_place(line) for line in needs}
    return Promise(sorted(takes), sorted(without_types), sorted(gives))


def _members(
    schema: Mapping[str, Any],
    place: str,
    document: Mapping[str, Any],
    *,
    only_required: bool = False,
) -> Iterator[str]:
    """Yield the place and the type of a schema and of its members."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        schema = document["components"]["schemas"][name]
    alternatives = [*schema.get("anyOf", ()), *schema.get("oneOf", ())]
    for alternative in alternatives:
        name = alternative.get("$ref", "").rpartition("/")[2]
        where = f"{place}<{name}>" if name else place
        yield from _members(alternative, where, document, only_required=only_required)
    if alternatives:
        return
    for value in schema.get("enum", [schema["const"]] if "const" in schema else ()):
        yield f"{place}: {value!r}"
    if "enum" not in schema and "const" not in schema:
        yield f"{place}: {schema.get('type', 'anything')}"
    for items in (schema.get("items"), *schema.get("prefixItems", ())):
        if items:
            yield from _members(items, f"{place}[]", document, only_required=only_required)
    for name, member in schema.get("properties", {}).items():
        if not only_required or name in schema.get("required", ()):
            yield from _members(member, f"{place}/{name}", document, only_required=only_required)


if __name__ == "__main__":
    promises = promises_of(json.loads(DOCUMENT.read_bytes()))
    readable = {name: promise._asdict() for name, promise in promises.items()}
    sys.stdout.write(json.dumps(readable, indent=1, ensure_ascii=False) + "\n")
