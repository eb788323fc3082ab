"""Private parts of other packages that the service relies on: their versions are bounded."""

import re
import tomllib
from inspect import getsource
from typing import Any

import pytest
from packaging.requirements import Requirement
from starlette.applications import Starlette
from starlette.responses import FileResponse
from starlette.routing import compile_path
from starlette.testclient import TestClient
from uvicorn.protocols.http.httptools_impl import (
    STATUS_LINE,
    HttpToolsProtocol,
    RequestResponseCycle,
)

from tests.support.paths import ROOT

METHODS = [
    (HttpToolsProtocol, "connection_made connection_lost data_received"),
    (HttpToolsProtocol, "on_message_begin on_headers_complete on_body send_400_response"),
    (FileResponse, "_open_file"),
]
MEMBERS = [
    (HttpToolsProtocol, "client cycle headers loop pipeline root_path transport url"),
    (RequestResponseCycle, "disconnected keep_alive message_event more_body"),
    (RequestResponseCycle, "response_complete response_started transport"),
]


@pytest.mark.parametrize(("kind", "names"), METHODS)
def test_methods_that_are_overridden_are_there(kind: type, names: str) -> None:
    assert set(names.split()) <= set(vars(kind))


@pytest.mark.parametrize(("kind", "names"), MEMBERS)
def test_members_that_are_used_are_there(kind: type, names: str) -> None:
    assert set(names.split()) <= set(re.findall(r"self\.(\w+)\b[^=\n]*=[^=]", getsource(kind)))


def test_lines_of_statuses_are_whole() -> None:
    assert STATUS_LINE[431] == b"HTTP/1.1 431 Request Header Fields Too Large\r\n"


def test_a_template_of_a_path_becomes_an_expression() -> None:
    expression = compile_path("/v1/meshes/{mesh_id}/path")[0]
    assert expression.match("/v1/meshes/a/path")
    assert not expression.match("/v1/meshes/a/b/path")


def test_a_mounted_application_knows_the_prefix_of_the_whole_one() -> None:
    scopes: list[Any] = []

    async def inner(scope: Any, _receive: Any, _send: Any) -> None:
        scopes.append(scope)
        raise LookupError

    outer = Starlette()
    outer.mount("/assets", inner)
    with pytest.raises(LookupError):
        TestClient(outer, root_path="/prefix").get("/prefix/assets/x")
    assert scopes[0]["app_root_path"] == "/prefix"


@pytest.mark.parametrize("name", ["starlette", "uvicorn"])
def test_versions_are_bounded(name: str) -> None:
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    (required,) = [each for each in map(Requirement, listed) if each.name == name]
    assert any(each.operator == "<" for each in required.specifier)
