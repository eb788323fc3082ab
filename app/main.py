"""The application, built when asked for."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from anyio import CapacityLimiter
from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware

from app import __version__, handlers
from app.admission import AdmissionMiddleware, is_open
from app.body_deadline import BodyDeadlineMiddleware
from app.errors import PROBLEM_JSON
from app.middleware import RequestMiddleware
from app.responses import problems
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
    app.state.large_bodies = CapacityLimiter(1)
    # The last is the outermost.
    app.add_middleware(BodyDeadlineMiddleware, settings=settings)
    app.add_middleware(AdmissionMiddleware, settings=settings)
    app.add_middleware(RequestMiddleware, settings=settings)
    if settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=settings.cors_origins,
            allow_methods=["GET", "HEAD", "POST", "DELETE"],
            allow_headers=["*"],
            expose_headers=["*"],
        )
    handlers.install(app, settings)
    app.include_router(about.router, max_body_size=settings.max_query_bytes)
    app.include_router(meshes.router, prefix="/v1", max_body_size=settings.max_upload_bytes)
    app.include_router(jobs.router, prefix="/v1", max_body_size=settings.max_query_bytes)
    app.include_router(queries.router, prefix="/v1", max_body_size=settings.max_query_bytes)
    return app


class _Application(FastAPI):
    def openapi(self) -> dict[str, Any]:
        """Return FastAPI's document, with errors as they are here."""
        schema = super().openapi()
        for template, path in schema["paths"].items():
            for operation in path.values():
                if not is_open(template):
                    operation["security"] = [{"apiKey": []}, {}]
                    operation["responses"].update(_REFUSALS)
                operation["responses"] = {
                    status: _as_problem(response) if status >= "400" else response
                    for status, response in operation["responses"].items()
                    if response["description"] != _FASTAPI_S_OWN
                }
        for name in ("HTTPValidationError", "ValidationError"):
            schema["components"]["schemas"].pop(name, None)
        schema["components"]["securitySchemes"] = {"apiKey": _SECURITY_SCHEME}
        return schema


_SECURITY_SCHEME = {
    "type": "http",
    "scheme": "bearer",
    "description": "A key of this service, where it asks for one.",
}
_PROBLEM = {"schema": {"$ref": "#/components/schemas/ProblemDocument"}}
_REFUSALS = {
    str(status): {"description": refusal["description"], "content": {PROBLEM_JSON: _PROBLEM}}
    for status, refusal in problems("unauthorized", "rate_limited").items()
}
_FASTAPI_S_OWN = "Validation Error"  # what it supposes of each operation with parameters


def _as_problem(response: dict[str, Any]) -> dict[str, Any]:
    # FastAPI writes the media type of the answer to the errors as well.
    (model,) = response["content"].values()
    return {**response, "content": {PROBLEM_JSON: model}}
