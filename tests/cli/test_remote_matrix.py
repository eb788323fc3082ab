"""Matrices that a service computes for the command line."""

import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import geodesic_client
import pytest
import stamina
from starlette.testclient import TestClient

from tests.support.commands import Run, error_line

pytestmark = pytest.mark.service

SERVICE = ["--service", "http://service.test"]


@pytest.fixture(autouse=True)
def retries_logged_as_before() -> Iterator[None]:
    """The command has the client's retries logged nowhere in its process."""
    yield
    stamina.instrumentation.set_on_retry_hooks(None)


@pytest.fixture
def plane(run: Run) -> Path:
    """The path of a plane's file."""
    run("sample", "plane", "--faces", 200, "plane.ply")
    return Path("plane.ply").resolve()


@pytest.fixture
def asked(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str | None]]:
    """The addresses and keys of the services that a command asks: each is that of the tests."""
    found: list[tuple[str, str | None]] = []

    def connect(address: str, api_key: str | None) -> Any:
        found.append((address, api_key))
        return made(http=client)

    made = geodesic_client.Client
    monkeypatch.setattr(geodesic_client, "Client", connect)
    return found


def jobs_of(client: TestClient) -> set[str]:
    return {job["id"] for job in client.get("/v1/jobs").json()["jobs"]}


@pytest.mark.parametrize(
    ("service_key", "suffix", "method"),
    [
        (None, ".npy", []),
        ("secret", ".npz", []),
        (None, ".npy", ["--method", "fast", "--effort", 1]),
        (None, ".npz", ["--method", "approximate", "--relative-error", 0.001]),
        (None, ".npy", ["--method", "approximate", "--absolute-error", 0.01]),
    ],
)
def test_the_file_is_the_one_of_this_machine(
    run: Run,
    plane: Path,
    tmp_path: Path,
    asked: list[tuple[str, str | None]],
    client: TestClient,
    monkeypatch: pytest.MonkeyPatch,
    service_key: str | None,
    suffix: str,
    method: list[Any],
) -> None:
    if service_key is not None:
        monkeypatch.setenv("GEODESIC_SERVICE_KEY", service_key)
    others = jobs_of(client)
    points = tmp_path / "points.txt"
    points.write_text("3\nf7:0.2,0.3,0.5\n100\n")
    options = ["--max-distance", 0.8, "--barriers", "0-5", "--dtype", "float32", *method]
    for ends in (["--points", points], ["--sources", points, "--targets", "all"]):
        here, there = (plane.parent / f"{name}{suffix}" for name in ("here", "there"))
        assert run("matrix", plane, *ends, *options, "--out", here).code == 0
        ran = run("matrix", plane, *ends, *options, "--out", there, *SERVICE)
        assert ran.code == 0, ran.err
        assert there.read_bytes() == here.read_bytes()
        facts = [json.loads(Path(f"{out}.json").read_text()) for out in (here, there)]
        names = "sources", "targets", "barriers", "shape", "method", "max_distance", "dtype"
        for name in (*names, "sha256", "error_bound"):
            assert facts[0][name] == facts[1][name]
        assert ran.figure("sha256") == facts[0]["sha256"]
    assert set(asked) == {("http://service.test", service_key)}
    assert jobs_of(client) <= others, "the service need not hold them"


@pytest.mark.usefixtures("asked")
def test_json_says_what_was_written(run: Run, plane: Path) -> None:
    ran = run("matrix", plane, "--points", "all", "--out", "there.npy", "--json", *SERVICE)
    facts = json.loads(Path("there.npy.json").read_text())
    told = {name: facts[name] for name in ("shape", "error_bound", "sha256")}
    printed = ran.out[ran.out.index("{\n") :]  # after log lines of the service
    assert json.loads(printed) == {**told, "written": "there.npy"}
    assert "matrix      121 by 121" in ran.err


@pytest.mark.usefixtures("asked")
def test_a_file_that_cannot_be_written_is_told(run: Run, plane: Path) -> None:
    Path("there.npy").mkdir()
    ran = run("matrix", plane, "--points", "all", "--out", "there.npy", *SERVICE)
    assert ran.code == 1
    assert "error: cannot write there.npy: Is a directory" in ran.err


def test_a_refusal_is_told(
    run: Run, plane: Path, asked: list[tuple[str, str | None]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_arguments: Any, **_options: Any) -> None:
        raise geodesic_client.ProblemError(507, {"code": "storage_full", "detail": "no room"}, None)

    monkeypatch.setattr(geodesic_client.client.Client, "store_matrix", refuse)
    ran = run("matrix", plane, "--points", "all", "--out", "there.npy", *SERVICE)
    assert (ran.code, ran.err) == (1, "error: storage_full: no room\n")
    assert len(asked) == 1


@pytest.mark.parametrize(
    "address", ["foo", "", "ftp://host", "http://", "http://[::1", "http://host:99999"]
)
def test_an_address_of_no_service_is_refused(run: Run, plane: Path, address: str) -> None:
    ran = run("matrix", plane, "--points", "all", "--out", "m.npy", "--service", address)
    assert ran.code == 2
    assert f"'--service': {address!r} is not the address of a service" in error_line(ran)


@pytest.mark.parametrize("key", ["ключ", "two lines\x07"])
def test_a_key_that_cannot_be_sent_is_refused_and_not_shown(
    run: Run, plane: Path, monkeypatch: pytest.MonkeyPatch, key: str
) -> None:
    monkeypatch.setenv("GEODESIC_SERVICE_KEY", key)
    ran = run("matrix", plane, "--points", "all", "--out", "m.npy", *SERVICE)
    assert ran.code == 1
    assert "GEODESIC_SERVICE_KEY is not a valid key" in error_line(ran)
    assert key not in ran.err


def test_a_service_that_does_not_answer_is_told_in_one_line(
    run: Run, plane: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("geodesic_client.connection.ATTEMPTS", 2)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    ran = run("matrix", plane, "--points", "all", "--out", "m.npy", "--service", address)
    assert ran.code == 1
    assert f"no answer from {address}" in error_line(ran)


@pytest.mark.parametrize(
    "options",
    [
        ["--points", "all", "--out", "m.npy", "--threads", 2],
        ["--points", "all", "--out", "m.zarr"],
        ["--points", "all", "--out", "m.parquet"],
        ["--source", 0, "--target", 1, "--out", "m.npy"],
    ],
)
def test_what_a_service_does_not_do(run: Run, plane: Path, options: list[Any]) -> None:
    ran = run("matrix", plane, *options, *SERVICE)
    assert ran.code == 2
    assert "--service" in ran.err
