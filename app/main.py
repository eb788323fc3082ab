"""The application: settings, service, middleware and routes put together."""

import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware

from app import __version__
from app.http import exception_handlers, page
from app.http.event_loop import measuring_lag
from app.http.large_bodies import LargeBodies
from app.http.metrics import Metrics
from app.http.middleware.admission import AdmissionMiddleware
from app.http.middleware.body_timeout import BodyTimeoutMiddleware
from app.http.middleware.cross_site import CrossSiteMiddleware
from app.http.middleware.head import HeadMiddleware
from app.http.middleware.observation import ObservationMiddleware
from app.http.middleware.probes import PROBES
from app.http.middleware.request_id import RequestIdMiddleware
from app.http.openapi import DOCUMENT, SERVERS, TAGS
from app.http.prefix import path_in
from app.http.routes import about, jobs, meshes, queries
from app.service.service import Service
from app.settings import Settings


def create_app(settings: Settings) -> FastAPI:
    """Build the application; it starts nothing and writes nothing before its lifespan begins."""
    service = Service(settings)

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        async with service.running(), measuring_lag(metrics.note_lag):
            yield

    metrics = Metrics(service)
    app = _Application(
        title="Geodesic",
        version=__version__,
        summary="Geodesic distances and paths on triangle meshes, exact or within a chosen error",
        lifespan=lifespan,
        servers=SERVERS,
        openapi_tags=TAGS,
        docs_url=None,  # FastAPI's page loads scripts from elsewhere
        redoc_url=None,
        telemetry={
            "auto_configure": True,  # from the variables OTEL_…
            "operation_spans": False,
            "metrics": False,  # those of Prometheus are more
            "logs": False,
            "exclude": lambda scope: path_in(scope) in PROBES,
        },
    )
    app.state.service = service
    app.state.metrics = metrics
    app.state.about = about.about(settings)
    app.state.large_bodies = LargeBodies()
    # The last one added is the outermost.
    app.add_middleware(HeadMiddleware)
    app.add_middleware(BodyTimeoutMiddleware, settings=settings)
    app.add_middleware(AdmissionMiddleware, settings=settings)
    app.add_middleware(CrossSiteMiddleware, settings=settings)
    app.add_middleware(RequestIdMiddleware, settings=settings)
    if settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=settings.cors_origins,
            allow_methods=["GET", "HEAD", "POST", "DELETE"],
            allow_headers=["*"],
            expose_headers=["*"],
        )
    app.add_middleware(ObservationMiddleware, metrics=metrics, settings=settings)
    exception_handlers.install(app, settings)
    # Routes are tried in order: the most frequent go first.
    app.include_router(queries.router, prefix="/v1", max_body_size=settings.max_query_bytes)
    app.include_router(meshes.router, prefix="/v1", max_body_size=settings.max_upload_bytes)
    app.include_router(jobs.router, prefix="/v1", max_body_size=settings.max_query_bytes)
    app.include_router(about.router, max_body_size=settings.max_query_bytes)
    if page.is_built():
        app.mount(page.ASSETS, page.Assets())
    return app


class _Application(FastAPI):
    _document: dict[str, Any] | None = None

    def openapi(self) -> dict[str, Any]:
        """Return the OpenAPI document, which was generated ahead of time."""
        if self._document is None:
            self._document = json.loads(DOCUMENT.read_bytes())
        return self._document
