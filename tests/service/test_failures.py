"""Each part of a deployment fails once, under load, on machines that only a network connects."""

from collections.abc import Iterator

import pytest

from benchmarks.failures.failures import FAILURES, Failure
from benchmarks.failures.trial import SCALE, SETTINGS, try_out
from benchmarks.soak.plan import Plan
from benchmarks.soak.reference import make_plan
from tests.support.deployment import Deployment, deployed
from tests.support.machines import obstacle

pytest.importorskip("ray")
pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(obstacle() is not None, reason=str(obstacle())),
]


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(SCALE)


@pytest.fixture(scope="module")
def deployment() -> Iterator[Deployment]:
    with deployed(**SETTINGS) as deployment:
        yield deployment


@pytest.mark.parametrize("failure", FAILURES, ids=lambda each: each.name)
def test_nobody_gets_a_wrong_answer_and_nothing_is_lost(
    deployment: Deployment, plan: Plan, failure: Failure
) -> None:
    """Answers are right or a documented refusal, and all is as before without a hand."""
    trial = try_out(deployment, plan, failure)

    assert list(trial.faults) == []
    assert list(trial.lost) == []
    assert trial.promises["job"] > 0
    assert trial.promises["mesh"] > 0
