"""The application, built when asked for."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI

from app import __version__, handlers, page
from app.errors import PROBLEM_JSON
from app.middleware import RequestMiddleware
from app.routes import about, jobs, meshes, queries
from app.service import Service
from app.settings import Settings


def create_app(settings: Settings) -> FastAPI:
    """Build the service; nothing runs, and nothing is on disk, before its lifespan begins."""
    service = Service(settings)

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        async with service.running():
            yield

    app = _Application(
        title="Geodesic",
        version=__version__,
        summary="Geodesic distances and paths on triangle meshes, exact or within a chosen error",
        lifespan=lifespan,
        docs_url=None,  # its page loads scripts from elsewhere
        redoc_url=None,
    )
    app.state.service = service
    app.add_middleware(RequestMiddleware, settings=settings)
    handlers.install(app, settings)
    app.include_router(about.router, max_body_size=settings.max_query_bytes)
    app.include_router(meshes.router, prefix="/v1", max_body_size=settings.max_upload_bytes)
    app.include_router(jobs.router, prefix="/v1", max_body_size=settings.max_query_bytes)
    app.include_router(queries.router, prefix="/v1", max_body_size=settings.max_query_bytes)
    if page.is_built():
        app.mount(page.ASSETS, page.Assets())
    return app


class _Application(FastAPI):
    def openapi(self) -> dict[str, Any]:
        """Return FastAPI's document, with errors as they are here."""
        schema = super().openapi()
        for path in schema["paths"].values():
            for operation in path.values():
                operation["responses"] = {
                    status: _as_problem(response) if status >= "400" else response
                    for status, response in operation["responses"].items()
                    if response["description"] != _FASTAPI_S_OWN
                }
        for name in ("HTTPValidationError", "ValidationError"):
            schema["components"]["schemas"].pop(name, None)
        return schema


_FASTAPI_S_OWN = "Validation Error"  # what it supposes of each operation with parameters


def _as_problem(response: dict[str, Any]) -> dict[str, Any]:
    # FastAPI writes the media type of the answer to the errors as well.
    (model,) = response["content"].values()
    return {**response, "content": {PROBLEM_JSON: model}}
