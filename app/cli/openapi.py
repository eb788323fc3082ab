"""Generate the OpenAPI document: ``python -m app.cli.openapi > openapi/openapi.json``.

It needs a checkout: the examples are not in the package.
"""

import json
import sys
from pathlib import Path

from fastapi import FastAPI

from app.http.openapi import complete
from app.main import create_app
from app.settings import Settings


def openapi_text() -> str:
    """Return the document as it is committed; it depends on no setting."""
    app = create_app(Settings(store=Path("unused"), workers=1))
    document = complete(FastAPI.openapi(app))
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    sys.stdout.write(openapi_text())
