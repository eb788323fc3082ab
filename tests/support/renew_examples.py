"""Write the answers of today into the examples: ``python -m tests.support.renew_examples``.

An answer that is the documented one, but for what changes each time, is left as it is. A new
example needs a summary, its request, and a ``response`` with no more than its ``status``; the
document is written (``python -m app.cli.openapi``) before, and again afterwards.
"""

import json
import re
import sys
import tempfile
from base64 import b64encode
from pathlib import Path
from typing import Any

from app.http.openapi import EXAMPLES
from tests.service.test_examples import JOB, OPERATIONS, replay, send, set_up
from tests.support.service import serving

NUMBERS = re.compile(r"\[\n\s*((?:-?[\d.e+-]+|null)(?:,\s*(?:-?[\d.e+-]+|null))*)\s*\]")
REQUEST = "5d0c1b7e9f2a4c68b3e7d90a1f26c845"


def renew() -> None:
    with tempfile.TemporaryDirectory() as store, serving(Path(store)) as client:
        client.headers["Accept-Encoding"] = "identity"
        for operation_id in OPERATIONS:
            path = EXAMPLES / f"{operation_id}.json"
            examples = json.loads(path.read_bytes())
            for name, example in examples.items():
                try:
                    replay(client, operation_id, name, set_up(client, operation_id))
                except (AssertionError, KeyError):
                    job_id = set_up(client, operation_id)
                    response = send(client, operation_id, name, job_id)
                    example["response"] = answer_of(response, job_id)
                    sys.stdout.write(f"{operation_id} {name}\n")
            path.write_text(written(examples))


def answer_of(response: Any, job_id: str) -> dict[str, Any]:
    answer: dict[str, Any] = {"status": response.status_code}
    media_type = response.headers.get("content-type", "").partition(";")[0]
    if response.content:
        answer["body"] = {"media_type": media_type, "value": value_of(response, media_type, job_id)}
    return answer


def value_of(response: Any, media_type: str, job_id: str) -> Any:
    if media_type in ("application/x-npy", "application/octet-stream"):
        return b64encode(response.content).decode()
    text = response.text.replace(job_id, JOB)
    if not media_type.endswith(("/json", "+json")):
        return text
    value = json.loads(text)
    if response.status_code == 202:
        value = json.loads(text.replace(value["id"], JOB))
    return value | ({"request_id": REQUEST} if "request_id" in value else {})


def written(examples: dict[str, Any]) -> str:
    """Return examples as JSON, the numbers of a list on one line."""
    text = json.dumps(examples, indent=2, ensure_ascii=False)
    in_line = lambda match: "[" + re.sub(r"\s*,\s*", ", ", match[1]) + "]"  # noqa: E731
    return NUMBERS.sub(in_line, text) + "\n"


if __name__ == "__main__":
    renew()
