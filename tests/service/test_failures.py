"""Each part of a deployment fails once, under load, on machines that only a network connects."""

from collections.abc import Iterator

import pytest

from benchmarks.failures.failures import FAILURES, WITH_TLS, Failure
from benchmarks.failures.plan import Load, make_load
from benchmarks.failures.trial import SETTINGS, try_out
from tests.support.deployment import Deployment, deployed
from tests.support.machines import obstacle

pytest.importorskip("ray")
pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(obstacle() is not None, reason=str(obstacle())),
]


@pytest.fixture(scope="module")
def load() -> Load:
    return make_load()


@pytest.fixture(scope="module")
def deployment(request: pytest.FixtureRequest) -> Iterator[Deployment]:
    with deployed(tls=request.param, **SETTINGS) as deployment:
        yield deployment


@pytest.mark.parametrize(
    ("deployment", "failure"),
    [(tls, each) for tls, some in ((False, FAILURES), (True, WITH_TLS)) for each in some],
    indirect=["deployment"],
    ids=lambda value: value.name if isinstance(value, Failure) else "",
)
def test_nobody_gets_a_wrong_answer_and_nothing_is_lost(
    deployment: Deployment, load: Load, failure: Failure
) -> None:
    """Answers are right or a documented refusal, and all is as before without a hand."""
    trial = try_out(deployment, load, failure)

    assert list(trial.faults) == []
    assert list(trial.lost) == []
    assert trial.promises["job"] > 0
    assert trial.promises["mesh"] > 0
