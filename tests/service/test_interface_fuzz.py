"""Requests made up from the interface document: what it promises holds for all of them."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.paths import ROOT
from tests.support.processes import COMMAND_LINE, Server
from tests.support.waiting import LONG_S, wait_until

CONFIGURATION = ROOT / "openapi" / "schemathesis.toml"
SEED = 2005


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    server = Server(tmp_path / "store", GEODESIC_CANCEL_GRACE_S=str(LONG_S))
    yield server
    server.close()


def make_up_requests(names: dict[str, str], url: str, folder: Path, *options: str) -> Path:
    """Run Schemathesis on a service, and return the file of all that it did."""
    report = folder / "report.ndjson"
    done = subprocess.run(  # noqa: S603 - this Python, and the text here
        [
            *(sys.executable, "-m", "schemathesis.cli", "--config-file", str(CONFIGURATION)),
            *("run", f"{url}/openapi.json", "--seed", str(SEED), *options),
            *("--request-timeout", str(LONG_S)),  # ten seconds would ask for a pace
            *("--report", "ndjson", "--report-ndjson-path", str(report)),
        ],
        env=os.environ | names | {"HOOKS": str(CONFIGURATION.with_name("schemathesis_hooks.py"))},
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return report


def interactions(report: Path) -> Iterator[tuple[str, int]]:
    """Yield the operation and the status of each answer."""
    for line in report.read_text().splitlines():
        recorder = json.loads(line).get("ScenarioFinished", {}).get("recorder", {})
        for each in recorder.get("interactions", {}).values():
            yield recorder["label"], each["response"]["status_code"]


def test_the_service_does_what_its_interface_document_says(
    server: Server, tmp_path: Path, pytestconfig: pytest.Config
) -> None:
    meshes = [
        server.client.post("/v1/meshes", params={"sample": "plane", "faces": faces}).json()["id"]
        for faces in (200, 30)
    ]
    jobs = [submit(server, meshes[0], vertex) for vertex in (0, 1)]
    names = {"MESH_ID": meshes[0], "DOOMED_MESH_ID": meshes[1]}
    names |= {"JOB_ID": jobs[0], "DOOMED_JOB_ID": jobs[1]}
    slice_only = ("--phases", "examples,fuzzing", "--max-examples", "2", "--no-shrink")
    options = ("--max-examples", "100") if pytestconfig.option.full else slice_only

    report = make_up_requests(names, server.url, tmp_path, *options)

    succeeded = {label for label, status in interactions(report) if status < 300}
    paths = server.client.get("/openapi.json").json()["paths"]
    operations = {f"{method.upper()} {path}" for path, each in paths.items() for method in each}
    assert succeeded == operations
    assert server.metric("geodesic_workers_lost_total") == 0
    subprocess.run([*COMMAND_LINE, "store", "check", str(server.store)], check=True)  # noqa: S603


def submit(server: Server, mesh_id: str, vertex: int) -> str:
    """Return the id of a job that has finished."""
    link = f"/v1/meshes/{mesh_id}/distances"
    body: Any = {"sources": [{"vertex": vertex}]}
    job = server.client.post(link, json=body, headers={"Prefer": "respond-async"}).json()["id"]
    wait_until(lambda: server.client.get(f"/v1/jobs/{job}").json()["status"] == "successful")
    return str(job)
