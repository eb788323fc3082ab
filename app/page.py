"""The page at ``/``: what Vite has made of ``app/web``, and how browsers are to keep it."""

from pathlib import Path

from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

DIST = Path(__file__).parent / "web" / "dist"
ASSETS = "/assets"

# Nothing is loaded from elsewhere, and nothing that is written in the page itself is run.
_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "worker-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
    "Vary": "Accept",
}


def is_built() -> bool:
    """Whether the page is part of this installation."""
    return (DIST / "index.html").is_file()


def wants_page(headers: Headers) -> bool:
    """Whether a browser asks, to show what it gets: others do not name HTML."""
    return "text/html" in headers.get("accept", "")


def page_response() -> Response:
    """Return the page."""
    return FileResponse(DIST / "index.html", headers=_HEADERS, media_type="text/html")


class Assets(StaticFiles):
    """Scripts, styles and images of the page, whose names are hashes of their content."""

    def __init__(self) -> None:
        super().__init__(directory=DIST / "assets", check_dir=False)

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file that may be kept for good."""
        response = await super().get_response(path, scope)
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable"
        response.headers["X-Content-Type-Options"] = "nosniff"
        return response
