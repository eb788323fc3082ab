"""Names of answers and jobs: what makes two queries the same."""

import pytest

from app.encoding import NPY, Representation
from app.queries import KINDS, MeshSize, Query, fingerprint, result_key
from app.schemas.requests import PathRequest


def path_query(**changes: object) -> Query:
    body = {"source": {"vertex": 0}, "target": {"vertex": 1}} | changes
    return KINDS["path"].ask("m" * 32, MeshSize(10, 20, 1.0), PathRequest.model_validate(body))


def test_a_new_release_answers_anew_but_knows_the_jobs_of_the_old_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """While machines are upgraded one by one, a request may be sent again to another release."""
    before = fingerprint(path_query()), result_key(path_query())
    monkeypatch.setattr("app.queries.base.code_version", lambda: "another")
    after = fingerprint(path_query()), result_key(path_query())

    assert after[0] == before[0]
    assert after[1] != before[1]


def test_each_difference_makes_another_query() -> None:
    queries = [path_query(), path_query(target={"vertex": 2}), path_query(method="fast")]
    names = [fingerprint(query) for query in queries]
    names.append(fingerprint(queries[0].answered_as(Representation(NPY))))

    assert len(set(names)) == 4
