"""Answers from stored results, each of which uses its result until it has been sent."""

import gc
from pathlib import Path

from starlette.requests import Request

from app.http.responses import result_response
from app.store.folder import Folder
from app.store.results import ResultFiles, ResultStore, write_result

REQUEST = Request({"type": "http", "headers": []})


def test_an_answer_that_is_never_sent_releases_its_result(tmp_path: Path) -> None:
    """As where the request is cancelled between the answer and its first byte."""
    store = ResultStore(ResultFiles(Folder(tmp_path)), capacity=1 << 20, memory=0)
    body = tmp_path / "results" / "mesh" / "key.body"
    parts = [bytes(200_000)]
    written = write_result(tmp_path / "results", "mesh/key", parts, {}, "code", is_cheap=False)
    response = result_response(REQUEST, store.add(written), {}, "text/plain", store, {})
    store.discard("mesh/key")
    assert body.exists()  # in use

    del response
    gc.collect()
    store.discard("mesh/key")
    assert not body.exists()
