"""The interface document of the last release, and what clients would miss in a newer one.

``python -m tests.support.released > openapi/released.json`` renews it: with each release, and where
clients are broken on purpose. It is the document without texts, examples and problems.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from typing import Any

from tests.support.paths import ROOT

DOCUMENT = ROOT / "openapi" / "openapi.json"
RELEASED = ROOT / "openapi" / "released.json"


def breaks(old: Any, new: Any) -> list[str]:
    """Return what clients of the ``old`` document can no longer send, or rely on in answers."""
    before, after = _lines(old), _lines(new)
    known = {line.partition(": ")[0] for line in before["gives"]}
    changed = {line for line in after["gives"] if line.partition(": ")[0] in known}
    return sorted(
        [
            *(f"no longer takes {line}" for line in before["takes"] - after["takes"]),
            *(f"now needs {line}" for line in after["needs"] - before["needs"]),
            *(f"no longer gives {line}" for line in before["gives"] - after["gives"]),
            *(f"gives something else: {line}" for line in changed - before["gives"]),
        ]
    )


def _lines(document: Any) -> Mapping[str, set[str]]:
    """Return what operations take, what of that they need, and what every answer of them gives."""
    found: dict[str, set[str]] = {"takes": set(), "needs": set(), "gives": set()}
    for path, item in document["paths"].items():
        for method, operation in item.items():
            name = f"{operation['operationId']} {method.upper()} {path}"
            found["takes"].add(name)
            for each in operation.get("parameters", ()):
                place = f"{name} {each['in']} {each['name']}"
                found["takes"] |= set(_members(each["schema"], place, document))
                found["needs"] |= {place} if each["required"] else set()
            for media_type, content in operation.get("requestBody", {}).get("content", {}).items():
                place, schema = f"{name} {media_type} ", content["schema"]
                found["takes"] |= set(_members(schema, place, document))
                needed = _members(schema, place, document, only_required=True)
                found["needs"] |= {line.partition(": ")[0] for line in needed}
            for status, answer in operation["responses"].items():
                for media_type, content in (
                    answer.get("content", {}).items() if status < "3" else ()
                ):
                    place = f"{name} {status} {media_type} "
                    schema = content.get("schema", {})
                    found["gives"] |= set(_members(schema, place, document, only_required=True))
    return found


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


def reduced(part: Any, *, are_names: bool = False) -> Any:
    """Return a part of the document without texts, examples, and answers that are problems."""
    if isinstance(part, list):
        return [reduced(each) for each in part]
    if not isinstance(part, dict):
        return part
    left_out = () if are_names else ("description", "summary", "title", "examples", "headers")
    return {
        name: reduced(each, are_names=name in ("properties", "schemas"))
        for name, each in part.items()
        if name not in left_out and not name.startswith(("4", "5"))
    }


if __name__ == "__main__":
    document = json.loads(DOCUMENT.read_bytes())
    document = {name: document[name] for name in ("openapi", "info", "paths", "components")}
    sys.stdout.write(json.dumps(reduced(document), separators=(",", ":")) + "\n")
