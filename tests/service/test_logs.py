"""The log of a service as a process of its own, workers included."""

import re
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import orjson
import pytest

from tests.support.paths import ROOT
from tests.support.processes import Server
from tests.support.service import NPY, SLOW_FACES, distances, upload_sample
from tests.support.waiting import wait_until

RIGHT = "alice/0123456789+abcdef"
WRONG = "mallory/0123456789+abcdef"
KEY = {"Authorization": f"Bearer {RIGHT}"}


class LoggedServer(Server):
    """A service with one key, whose log can be read."""

    def __init__(self, folder: Path) -> None:
        self.log = folder / "log"
        settings = {"GEODESIC_API_KEYS": f"alice:{RIGHT}", "GEODESIC_LOG_FORMAT": "json"}
        # A worker holds no field in memory, so that it reads those in the store.
        settings |= {"GEODESIC_WORKER_FIELD_BYTES": "1"}
        super().__init__(folder / "store", log=self.log, **settings)
        self.client.headers.update(KEY)

    def lines(self, **fields: Any) -> list[dict[str, Any]]:
        """Return the lines with these fields."""
        lines = [orjson.loads(line) for line in self.log.read_bytes().splitlines()]
        return [line for line in lines if fields.items() <= line.items()]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LoggedServer]:
    with closing(LoggedServer(tmp_path_factory.mktemp("logged"))) as server:
        yield server


def test_a_query_is_logged_as_it_was_answered(server: LoggedServer) -> None:
    mesh_id = upload_sample(server.client, "plane", 200)
    answer = distances(server.client, mesh_id, {"X-Request-ID": "a-query"})
    wait_until(lambda: server.lines(request_id="a-query"))

    (line,) = server.lines(request_id="a-query")
    expected = {"event": "request", "level": "info", "method": "POST", "status": 200}
    expected |= {"path": f"/v1/meshes/{mesh_id}/distances", "operation": "computeDistances"}
    expected |= {"caller": "alice", "mesh_id": mesh_id}
    assert expected.items() <= line.items()
    assert line["bytes"] == int(answer.headers["content-length"])
    timing = dict(part.split(";dur=") for part in answer.headers["server-timing"].split(", "))
    for phase in ("queue", "compute"):  # both are rounded
        assert float(timing[phase]) == pytest.approx(1e3 * line[f"{phase}_seconds"], abs=0.06)
    assert line["queue_seconds"] + line["compute_seconds"] < line["seconds"]
    (upload,) = server.lines(operation="createMesh", mesh_id=mesh_id)
    assert upload["path"] == "/v1/meshes"


def test_the_fields_are_those_of_the_documentation(server: LoggedServer) -> None:
    assert server.client.get("/v1").status_code == 200
    wait_until(lambda: server.lines(operation="getAbout"))

    text = (ROOT / "docs/operations.md").read_text().partition("## Log\n")[2].partition("\n## ")[0]
    rows = [row.split("|")[1] for row in text.splitlines() if row.startswith("| `")]
    documented = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    sometimes = {"trace_id", "exception"}
    assert set(server.lines(operation="getAbout")[0]) | sometimes == documented


def test_every_line_is_an_object_and_the_server_has_no_lines_of_its_own(
    server: LoggedServer,
) -> None:
    with socket.create_connection(server.address) as connection:
        connection.sendall(b"nonsense\r\n\r\n")
        connection.recv(1000)
    wait_until(lambda: server.lines(level="warning", module="uvicorn.error"))

    assert all({"event", "level", "module", "timestamp"} <= line.keys() for line in server.lines())
    assert server.lines(event="Application startup complete.")
    assert not server.lines(module="uvicorn.access")


def test_a_worker_logs_with_the_id_of_the_request(server: LoggedServer) -> None:
    mesh_id = upload_sample(server.client, "sphere", SLOW_FACES)
    distances(server.client, mesh_id)
    fields = server.store / "fields" / mesh_id
    wait_until(lambda: list(fields.glob("*.npz")))
    (field,) = fields.glob("*.npz")
    field.write_bytes(field.read_bytes()[:-9])

    # Another form of the answer: another result, and the same field.
    headers = NPY | {"X-Request-ID": "of-a-damaged-field"}
    assert distances(server.client, mesh_id, headers).status_code == 200
    (line,) = server.lines(module="app.store")
    assert line["request_id"] == "of-a-damaged-field"
    assert (line["level"], line["path"]) == ("warning", str(field))


def test_no_secret_is_in_the_log(server: LoggedServer) -> None:
    ask = server.client.get
    answers = [ask("/v1")]
    wrong = (f"Bearer {WRONG}", WRONG, f"Basic {WRONG}", f"Bearer {RIGHT} {WRONG}")
    answers += [ask("/v1", headers={"Authorization": value}) for value in wrong]
    answers.append(ask("/v1", params={"key": RIGHT, "api_key": WRONG}))
    answers.append(ask("/nowhere", params={"key": RIGHT}))
    odd = {"X-Request-ID": RIGHT, "Cookie": f"key={WRONG}", "User-Agent": WRONG}
    answers.append(ask("/v1/meshes/0", headers=odd))
    assert [answer.status_code for answer in answers] == [200, 401, 401, 401, 401, 200, 404, 404]
    asked = {answer.headers["x-request-id"] for answer in answers}
    wait_until(lambda: asked <= {line["request_id"] for line in server.lines(event="request")})

    assert {line["caller"] for line in server.lines(status=401)} == {"127.0.0.1"}
    text = server.log.read_text()
    for secret in (RIGHT, WRONG):
        assert secret not in text
        assert secret.replace("/", "%2F").replace("+", "%2B") not in text
        assert secret.partition("+")[2] not in text
