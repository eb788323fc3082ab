"""Cost of HTTP over the solve: upload, and distances as JSON and as npy, also a million."""

import json
import time
from functools import partial
from statistics import median

import numpy as np
import orjson

import geodesic_core as gc
from benchmarks.inputs import Inputs
from benchmarks.serving import Client, phases_of, serving
from benchmarks.tables import Section, verdict
from benchmarks.timing import timed

NAME = "horse97k.ply"
UPLOAD_S = 2.0
OVERHEAD = {"application/json": 25.0, "application/x-npy": 10.0}
"""Percent over the solve, at most, by media type."""
WRITING_S = 0.1
"""Seconds until a worker has written its field, which slows a solve beside it down."""
LARGE_FACES = 2_000_000
LARGE = {"application/json": 2.0, "application/x-npy": 200.0}
"""Limits by media type: multiple of the seconds of orjson, or MB a second."""


def run(inputs: Inputs, runs: int) -> Section:
    """Upload a mesh, then ask for its distances and solve the same in this process, by turns."""
    path = inputs.folder / NAME
    rows: list[list[str]] = []
    if path.exists():
        gc.warm_up()
        mesh, body = gc.load_mesh(path), path.read_bytes()
        with serving() as port:
            client = Client(port)
            upload_s, created = timed(partial(client.get, "/v1/meshes?format=ply", body))
            target = verdict(upload_s, UPLOAD_S, at_least=False, unit=" s")
            rows.append([f"upload of {NAME}", f"{upload_s:.4f}", "", "", target])
            query = f"/v1/meshes/{json.loads(created)['id']}/distances"
            rows += [_overhead(client, query, kind, mesh, runs) for kind in OVERHEAD]
    else:
        print(f"{NAME}: not in the meshes folder, left out")
    return Section(
        "HTTP",
        f"One client on loopback, medians of {runs}; the solve is `exact_distance` of the same "
        f"source in the benchmark's own process, by turns with the request, and the overhead the "
        f"median of all turns.",
        ["request", "seconds", "solve, s", "overhead, %", "target"],
        rows,
    )


def run_large(_inputs: Inputs, runs: int) -> Section:
    """Ask for a million distances, and have orjson write the same in this process, by turns."""
    with serving() as port:
        client = Client(port)
        query = f"{client.upload_sample('plane', LARGE_FACES)}/distances"
        rows = [_large(client, query, media_type, runs) for media_type in LARGE]
    return Section(
        "Large answers over HTTP",
        f"A million distances to one client on loopback, medians of {runs}; beyond the solve "
        "are encoding into a file of the store, sending and reading. orjson writes the same "
        "numbers at once, by turns with the requests.",
        [
            "answer",
            "MB",
            "encode, s",
            "beyond the solve, s",
            "MB/s",
            "orjson, s",
            "target",
        ],
        rows,
    )


def _large(client: Client, query: str, media_type: str, runs: int) -> list[str]:
    encodes, requests, bare = [], [], []
    size = 0
    for source in range(-1, runs):  # the first brings the mesh into the worker's memory
        asked = {"sources": [{"vertex": source + 1}], "method": "approximate"}
        body, headers = {**asked, "relative_error": 0.1}, {"Accept": media_type}
        seconds, (response, answer) = timed(partial(client.ask, query, body, headers))
        phases = phases_of(response)
        size = len(answer)
        encodes.append(phases["encode"])
        requests.append(seconds - sum(phases.values()) + phases["encode"])
        if media_type == "application/json":
            distances = np.array(orjson.loads(answer)["distances"])
        else:
            distances = np.frombuffer(answer, "<f8", offset=len(answer) % 8 + 128)
        bare.append(timed(partial(orjson.dumps, distances, option=orjson.OPT_SERIALIZE_NUMPY))[0])
    encode_s, request_s, bare_s = (median(each[1:]) for each in (encodes, requests, bare))
    rate = size / request_s / 1e6
    if media_type == "application/json":
        target = verdict(encode_s / bare_s, LARGE[media_type], at_least=False, unit=" × orjson")
    else:
        target = verdict(rate, LARGE[media_type], at_least=True, unit=" MB/s")
    ours = [f"{each:.4f}" for each in (encode_s, request_s)]
    return [media_type, f"{size / 1e6:.1f}", *ours, f"{rate:.0f}", f"{bare_s:.4f}", target]


def _overhead(
    client: Client,
    query: str,
    media_type: str,
    mesh: gc.TriangleMesh,
    runs: int,
) -> list[str]:
    requests, solves = [], []
    first = 1000 * list(OVERHEAD).index(media_type)  # fields asked for before are known
    for source in range(first, first + runs + 1):
        body, headers = {"sources": [{"vertex": source}]}, {"Accept": media_type}
        requests.append(timed(partial(client.get, query, body, headers))[0])
        time.sleep(WRITING_S)
        solves.append(timed(partial(gc.exact_distance, mesh, source))[0])
    # The first brings the mesh into the worker's memory.
    request_s, solve_s = median(requests[1:]), median(solves[1:])
    turns = zip(requests[1:], solves[1:], strict=True)
    percent = 100 * (median(request / solve for request, solve in turns) - 1)
    target = verdict(percent, OVERHEAD[media_type], at_least=False, unit=" %")
    name = f"distances, {media_type}"
    return [name, f"{request_s:.4f}", f"{solve_s:.4f}", f"{percent:.1f}", target]
