"""Moto's S3 server, spoken to as Google Cloud Storage: ``python -m tests.support.gcs_server``.

Google's XML interface is S3's, but for what is translated here. Requests as S3 has them go on as
they are.
"""

from collections.abc import Callable, Iterable
from threading import Lock
from typing import Any

from moto import server
from moto.moto_server.werkzeug_app import DomainDispatcherApplication

from tests.support.s3 import SECRET

_SIGNATURE = "AWS4-HMAC-SHA256 Credential=tests/20250101/us-east-1/s3/aws4_request"
"""What moto takes for a signature: it verifies none"""
_CONDITIONS = {"0": "*"}
"""``If-None-Match`` by generation: 0 is an object that is not there; S3 has no others"""
_CREATING = Lock()
"""Moto looks for an object first and writes it afterwards; Google does both at once"""

Start = Callable[..., Any]


class Translation(DomainDispatcherApplication):
    """All services of moto, of which S3 answers to Google's requests too."""

    def __call__(self, environ: dict[str, Any], start: Start) -> Iterable[bytes]:
        kind, _, token = environ.get("HTTP_AUTHORIZATION", "").partition(" ")
        if kind != "Bearer":
            return self._answer(environ, start)
        if token != SECRET:
            start("401 Unauthorized", [("Content-Type", "application/xml")])
            return [b"<Error><Code>AuthenticationRequired</Code></Error>"]
        environ["HTTP_AUTHORIZATION"] = _SIGNATURE
        generation = environ.pop("HTTP_X_GOOG_IF_GENERATION_MATCH", None)
        if generation is None:
            return self._answer(environ, start)
        environ["HTTP_IF_NONE_MATCH"] = _CONDITIONS[generation]
        with _CREATING:
            return self._answer(environ, start)

    def _answer(self, environ: dict[str, Any], start: Start) -> Iterable[bytes]:
        answer: Iterable[bytes] = super().__call__(environ, start)
        return answer


if __name__ == "__main__":
    server.DomainDispatcherApplication = Translation  # type: ignore[attr-defined]
    server.main()
