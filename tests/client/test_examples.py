"""The examples of the client's README."""

import re

import geodesic_client
import pytest
from starlette.testclient import TestClient

from tests.support.paths import ROOT

EXAMPLES = re.findall(
    r"```python\n(.*?)```", (ROOT / "client" / "README.md").read_text(), re.DOTALL
)


def test_there_are_examples() -> None:
    assert len(EXAMPLES) == 2


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES)
def test_the_examples_run(
    example: str, client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a service in this process, whatever address they name."""
    connect = geodesic_client.Client
    monkeypatch.setattr(geodesic_client, "Client", lambda *_: connect(http=client))
    exec(example, {})  # noqa: S102 - a text of this repository
