import errno
import pickle
import re

import pytest
from starlette.testclient import TestClient

from app.errors import (
    CODES,
    Problem,
    ProblemError,
    StateUnavailableError,
    StoreUnavailableError,
    pointer,
    problem_of,
)
from geodesic_core import errors as core
from tests.support.paths import ROOT
from tests.support.service import check_problem

CONTRACT = {
    400: {"malformed_body", "malformed_request", "idempotency_key_unused"},
    401: {"unauthorized"},
    403: {"origin_not_allowed"},
    404: {"mesh_not_found", "job_not_found", "not_found"},
    405: {"method_not_allowed"},
    406: {"not_acceptable"},
    409: {"job_not_finished"},
    410: {"job_dismissed"},
    413: {"upload_too_large", "result_too_large"},
    415: {"unsupported_media_type"},
    416: {"range_not_satisfiable"},
    421: {"host_not_allowed"},
    422: {
        *("invalid_request", "invalid_mesh", "invalid_point", "limit_exceeded", "memory_limit"),
        "not_embedded",
    },
    429: {"rate_limited", "quota_exceeded"},
    431: {"header_too_large"},
    500: {"worker_died", "mesh_damaged", "internal_error"},
    503: {
        "queue_full",
        "engine_unavailable",
        "draining",
        "too_many_connections",
        "state_unavailable",
        "store_unavailable",
    },
    504: {"deadline_exceeded"},
    507: {"storage_full", "quota_exceeded"},
}


def test_codes_are_those_of_the_contract() -> None:
    by_status: dict[int, set[str]] = {}
    for name, code in CODES.items():
        for status in code.statuses:
            by_status.setdefault(status, set()).add(name)

    assert by_status == CONTRACT


@pytest.mark.parametrize("code", CODES)
def test_the_type_of_every_problem_can_be_read(client: TestClient, code: str) -> None:
    response = client.get(f"/problems/{code}")

    assert response.status_code == 200
    told = response.json()
    page, _, heading = told.pop("chapter").partition("#")
    text = (ROOT / "docs" / f"{page}.md").read_text()
    titles = re.findall(r"(?m)^#+ (.+)$", text)
    assert not heading or heading in {
        re.sub("[^a-z -]", "", title.lower()).replace(" ", "-") for title in titles
    }
    statuses = [told.pop("status"), *told.pop("other_statuses")]
    assert statuses == [status for status, codes in CONTRACT.items() if code in codes]
    assert told == {"code": code, "title": CODES[code].title, "meaning": CODES[code].meaning}


def test_unknown_code(client: TestClient) -> None:
    problem = check_problem(client.get("/problems/nonsense"), 404, "not_found")

    assert "malformed_body" in problem["detail"]


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (core.InvalidMesh("bad"), "invalid_mesh"),
        (core.TooManyFaces(9, 7), "limit_exceeded"),
        (core.TooManyVertices(9, 7), "limit_exceeded"),
        (core.InvalidPoint("bad"), "invalid_point"),
        (core.InvalidArgument("bad"), "invalid_request"),
        (core.DeadlineExceeded("late"), "deadline_exceeded"),
        (core.MemoryLimitExceeded(9, 7), "memory_limit"),
        (MemoryError(), "memory_limit"),
        (StateUnavailableError("no server"), "state_unavailable"),
        (StoreUnavailableError("no server"), "store_unavailable"),
        (OSError(errno.ENOSPC, "full"), "storage_full"),
        (OSError(errno.EDQUOT, "no more for you"), "storage_full"),
        (OSError(errno.EIO, "broken"), "internal_error"),
        (core.InternalError("defect"), "internal_error"),
        (KeyError("defect"), "internal_error"),
        (ProblemError(Problem("draining", "bye")), "draining"),
    ],
)
def test_exceptions_become_problems(error: Exception, code: str) -> None:
    assert problem_of(error).code == code


def test_internal_errors_keep_their_secrets() -> None:
    assert "secret" not in problem_of(KeyError("secret")).detail


def test_invalid_mesh_names_its_elements() -> None:
    faces = problem_of(core.InvalidMesh("bad", kind="face", elements=[3, 5]))
    edge = problem_of(core.InvalidMesh("bad", kind="edge", elements=[(3, 5)]))

    assert [fault.pointer for fault in faces.errors] == ["/faces/3", "/faces/5"]
    assert [fault.message for fault in edge.errors] == ["edge 3-5 is faulty"]


@pytest.mark.parametrize(
    ("error", "setting"),
    [
        (core.TooManyFaces(9, 7), "max_faces"),
        (core.TooManyVertices(9, 7), "max_vertices"),
        (core.MemoryLimitExceeded(9, 7), "query_memory_bytes"),
    ],
)
def test_limits_are_named(error: Exception, setting: str) -> None:
    problem = problem_of(error)

    assert (problem.limit, problem.actual, problem.setting) == (7, 9, setting)


def test_problems_survive_the_pipe_of_a_worker() -> None:
    problem = problem_of(core.InvalidMesh("bad", kind="face", elements=[3]))

    assert pickle.loads(pickle.dumps(problem)) == problem  # noqa: S301


def test_pointers_are_escaped() -> None:
    assert pointer("a/b", 0, "c~d") == "/a~1b/0/c~0d"


def test_unknown_address(client: TestClient) -> None:
    check_problem(client.get("/nowhere"), 404, "not_found")


def test_wrong_method_names_the_right_ones(client: TestClient) -> None:
    response = client.put("/v1/meshes")

    check_problem(response, 405, "method_not_allowed")
    assert response.headers["allow"] == "GET, HEAD, POST"


def test_a_defect_is_a_problem_too(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.http.routes.about.Index", None)

    problem = check_problem(client.get("/"), 500, "internal_error")

    assert "NoneType" not in problem["detail"]
