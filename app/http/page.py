"""The pages, as Vite built them from ``app/web``, and their caching and security headers.

There are two: the page at ``/``, and the reference of the interface at ``/docs``.
"""

from pathlib import Path
from typing import Literal

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

DIST = Path(__file__).parents[1] / "web" / "dist"
ASSETS = "/assets"
Page = Literal["index.html", "docs.html"]

# The pages load nothing from elsewhere, and run no inline scripts.
_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "worker-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob: data:",  # icons of the reference are in its style sheet
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
_SAFE = {
    "Content-Security-Policy": _POLICY,
    "Referrer-Policy": "no-referrer",
}
_INDEX = {**_SAFE, "Cache-Control": "no-cache", "Vary": "Accept"}
_ASSET = {**_SAFE, "Cache-Control": "public, max-age=31536000, immutable"}


def is_built() -> bool:
    """Tell whether the page is part of this installation."""
    return (DIST / "index.html").is_file()


def wants_page(headers: Headers) -> bool:
    """Tell whether the request comes from a browser's window: only those accept HTML by name."""
    return "text/html" in headers.get("accept", "")


def page_response(scope: Scope, name: Page = "index.html") -> Response:
    """Return a page, or a 304."""
    path = DIST / name
    response = StaticFiles(directory=DIST).file_response(path, path.stat(), scope)
    response.headers.update(_INDEX)
    return response


class Assets(StaticFiles):
    """Scripts, styles and images of the page, whose names are hashes of their content."""

    def __init__(self) -> None:
        super().__init__(directory=DIST / "assets")

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file that browsers may cache for ever."""
        response = await super().get_response(path, scope)
        response.headers.update(_ASSET)
        return response
